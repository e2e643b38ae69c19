"""roofbench: an evaluation-first benchmark for building detection from airborne LiDAR and orthoimagery.

The short public API; everything is imported when it is first used, so ``import roofbench`` is cheap.

>>> import roofbench as rb
>>> evaluation = rb.evaluate(rb.read_footprints("detected.gpkg"), rb.read_footprints("register.gpkg"))  # doctest: +SKIP
>>> evaluation.object.quality  # doctest: +SKIP
0.93
"""

from __future__ import annotations

import importlib
import os
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .benchmark.session import detect, run
    from .detectors.base import Detector, Step
    from .detectors.registry import make_detector
    from .evaluators.base import Evaluation, Evaluator, Index
    from .evaluators.comparison import evaluate, pool
    from .evaluators.registry import make_evaluator
    from .scenes.errors import RoofbenchError
    from .scenes.folder import open_scene, save_scene
    from .scenes.footprints import Footprints
    from .scenes.importing import import_scene
    from .scenes.parameters import parameter
    from .scenes.points import PointCloud
    from .scenes.raster import Elevation, Grid, Image
    from .scenes.scene import Scene
    from .scenes.synthetic import make_scene
    from .scenes.vector_files import read_footprints, write_footprints

# Compiled kernels go to the user's cache. Beside the modules they would outlive an uninstall, and what is left of the
# folder then hides the package when it is installed in editable mode.
os.environ.setdefault(
    "NUMBA_CACHE_DIR",
    os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or os.path.expanduser("~/.cache"),
        "roofbench",
        "numba",
    ),
)

#: Public name to the module that defines it.
_HOMES = {
    "Detector": "detectors.base",
    "Elevation": "scenes.raster",
    "Evaluation": "evaluators.base",
    "Evaluator": "evaluators.base",
    "Footprints": "scenes.footprints",
    "Grid": "scenes.raster",
    "Image": "scenes.raster",
    "Index": "evaluators.base",
    "PointCloud": "scenes.points",
    "RoofbenchError": "scenes.errors",
    "Scene": "scenes.scene",
    "Step": "detectors.base",
    "detect": "benchmark.session",
    "evaluate": "evaluators.comparison",
    "import_scene": "scenes.importing",
    "make_detector": "detectors.registry",
    "make_evaluator": "evaluators.registry",
    "make_scene": "scenes.synthetic",
    "open_scene": "scenes.folder",
    "parameter": "scenes.parameters",
    "pool": "evaluators.comparison",
    "read_footprints": "scenes.vector_files",
    "run": "benchmark.session",
    "save_scene": "scenes.folder",
    "write_footprints": "scenes.vector_files",
}

__all__ = [
    "Detector",
    "Elevation",
    "Evaluation",
    "Evaluator",
    "Footprints",
    "Grid",
    "Image",
    "Index",
    "PointCloud",
    "RoofbenchError",
    "Scene",
    "Step",
    "detect",
    "evaluate",
    "import_scene",
    "make_detector",
    "make_evaluator",
    "make_scene",
    "open_scene",
    "parameter",
    "pool",
    "read_footprints",
    "run",
    "save_scene",
    "write_footprints",
]
__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
    raise AttributeError(f"module 'roofbench' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
