"""What all recipes share: the call of the script, the points of the scene, and the outlines of building points.

A recipe is called as ``SCENE_FOLDER PARAMETER_FILE OUTPUT`` and gets from its tool which points are on buildings. The
outlines are made here, in the same way for every tool: points on a grid, a mask where at least half of them are on
buildings, an opening, tracing, straight walls, and a minimum area. The settings of the parameter file override the
defaults in `DEFAULTS`.
"""

from __future__ import annotations

import importlib
import json
import math
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import shapely
from numpy.typing import NDArray

from ....core.processes import death_reason
from ....scenes.folder import open_scene
from ....scenes.geodata.density import point_spacing
from ....scenes.geodata.footprints import Footprints
from ....scenes.geodata.outlines import coverage_of_mask, trace
from ....scenes.geodata.points import PointCloud
from ....scenes.geodata.raster import Grid
from ....scenes.geodata.vector_files import write_footprints
from ...shared.morphology import closed, opened
from ...shared.regularise import regularise

__all__ = [
    "DEFAULTS",
    "RecipeCall",
    "leave",
    "read_call",
    "require_program",
    "required_module",
    "run_tool",
    "write_buildings",
]

#: Exit code that says that the tool or an input is missing.
_SKIP = 77
#: Least height above ground of building points where the tool gives none (m), radius of the opening (m), least area
#: (m2), and cell size (m; 0: 1.4 times the point spacing, 0.25 to 2 m).
DEFAULTS: Mapping[str, float] = {"height": 2.5, "opening": 1.5, "smallest_area": 10.0, "cell": 0.0}


@dataclass(frozen=True)
class RecipeCall:
    """A call of a recipe.

    Attributes
    ----------
    folder : Path
        Scene folder.
    settings : mapping
        Of the parameter file, with the defaults.
    output : Path
        File for the footprints.
    points : PointCloud
    extent : tuple of float
    crs : str, optional
    """

    folder: Path
    settings: Mapping[str, Any]
    output: Path
    points: PointCloud
    extent: tuple[float, float, float, float]
    crs: str | None


def read_call(**defaults: Any) -> RecipeCall:
    """Return the call of this script; `defaults` are settings of the tool."""
    folder, parameters, output = map(Path, sys.argv[1:])
    given = json.loads(parameters.read_text(encoding="utf-8"))
    known = {**DEFAULTS, **defaults}
    for name, value in given.items():
        if name not in known and name != "seed":
            sys.exit(f"no setting {name!r}: there are {', '.join(known)}")
        if type(value) not in (int, float) or not 0 <= value < math.inf:
            sys.exit(f"the setting {name} must be a number of at least 0, not {json.dumps(value)}")
    scene = open_scene(folder)
    assert scene.points is not None
    return RecipeCall(folder, {**known, **given}, output, scene.points, scene.extent, scene.crs)


def required_module(name: str, package: str) -> Any:
    """Return a Python module, or exit with the code for a missing tool."""
    try:
        return importlib.import_module(name)
    except ImportError:
        leave(f"{package} is not installed: pip install {package}")


def require_program(name: str, package: str) -> None:
    """Exit with the code for a missing tool unless there is an executable of that name."""
    if shutil.which(name) is None:
        leave(f"{name} is not installed: it is part of {package}")


def run_tool(words: Sequence[str]) -> None:
    """Run a program of the tool; where it fails, exit with its code, so that its last line is the reason."""
    code = subprocess.run(words, check=False).returncode  # noqa: S603 - the program of the recipe
    if code < 0:
        print(death_reason(code, words[0]), file=sys.stderr)
    if code:
        sys.exit(code if 0 < code != _SKIP else 1)


def write_buildings(call: RecipeCall, on_building: NDArray[np.bool_]) -> None:
    """Write the outlines of building points.

    Parameters
    ----------
    call : RecipeCall
    on_building : ndarray of bool, shape (n,)
        For each point of the scene.
    """
    points, settings = call.points, call.settings
    spacing = point_spacing(points.x, points.y, call.extent, square=2.0) or 1.0
    cell = settings["cell"] or min(max(1.4 * spacing, 0.25), 2.0)
    grid = Grid.covering(call.extent, cell)
    index, inside = grid.cells(points.x, points.y)
    size = grid.rows * grid.columns
    count = np.bincount(index[inside], minlength=size)
    roof = np.bincount(index[inside & on_building], minlength=size) if inside.any() else count
    share = np.where(count > 0, roof / np.maximum(count, 1), np.nan).reshape(grid.shape).astype(np.float32)
    solid = closed(np.nan_to_num(share) >= 0.5, 1.5)
    solid &= ~(share < 0.5)  # only cells without points are filled
    mask = opened(solid, settings["opening"] / cell)
    outlines = regularise(trace(coverage_of_mask(mask, share), grid), max(cell, 0.5))
    outlines = outlines[shapely.area(outlines) >= settings["smallest_area"]]
    write_footprints(Footprints.of(outlines, crs=call.crs), call.output)


def leave(reason: str) -> NoReturn:
    """Exit with the code for a detector that cannot run here."""
    print(reason, file=sys.stderr)
    raise SystemExit(_SKIP)
