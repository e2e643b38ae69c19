"""roofbench: an evaluation-first benchmark for building detection from airborne LiDAR and orthoimagery.

The short public API; everything is imported when it is first used, so ``import roofbench`` is cheap.

>>> import roofbench as rb
>>> evaluation = rb.evaluate(rb.read_footprints("detected.gpkg"), rb.read_footprints("register.gpkg"))  # doctest: +SKIP
>>> evaluation.object.quality  # doctest: +SKIP
0.93
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from .core.package import HOMES, VERSION

if TYPE_CHECKING:
    from .benchmark.session import detect
    from .core.errors import RoofbenchError
    from .core.parameters import execution_option, parameter
    from .detectors.base import Detector
    from .detectors.registry import make_detector
    from .detectors.steps import Step
    from .evaluators.base import Evaluation, Evaluator, Index
    from .evaluators.comparison import evaluate, pool
    from .evaluators.registry import make_evaluator
    from .evaluators.uncertainty.intervals import block_intervals
    from .evaluators.uncertainty.paired import compare
    from .evaluators.uncertainty.redrawn import redraw_changes
    from .reports.board import run
    from .reports.listings import list_detectors, list_evaluators, list_indices, list_scenes, list_suites
    from .scenes.folder import open_scene, save_scene
    from .scenes.geodata.footprints import Footprints
    from .scenes.geodata.points import PointCloud
    from .scenes.geodata.raster import Elevation, Grid, Image
    from .scenes.geodata.vector_files import read_footprints, write_footprints
    from .scenes.importing.request import ImportRequest
    from .scenes.importing.scene_import import import_scene
    from .scenes.scene import Scene
    from .scenes.synthetic import make_scene

__all__ = [
    "Detector",
    "Elevation",
    "Evaluation",
    "Evaluator",
    "Footprints",
    "Grid",
    "Image",
    "ImportRequest",
    "Index",
    "PointCloud",
    "RoofbenchError",
    "Scene",
    "Step",
    "block_intervals",
    "compare",
    "detect",
    "evaluate",
    "execution_option",
    "import_scene",
    "list_detectors",
    "list_evaluators",
    "list_indices",
    "list_scenes",
    "list_suites",
    "make_detector",
    "make_evaluator",
    "make_scene",
    "open_scene",
    "parameter",
    "pool",
    "read_footprints",
    "redraw_changes",
    "run",
    "save_scene",
    "write_footprints",
]
__version__ = VERSION


def __getattr__(name: str) -> Any:
    if name in HOMES:
        return getattr(importlib.import_module(f".{HOMES[name]}", __name__), name)
    raise AttributeError(f"module 'roofbench' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
