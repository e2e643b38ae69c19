"""SAGA GIS: the slope-based filter ``DTM Filter`` (Vosselman 2000) on a grid of the lowest points.

A cell is ground unless a cell within the radius lies lower than the slope of the terrain allows. Points that are high
above the nearest ground cell are taken as buildings; the opening in `write_buildings` is what removes trees.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import NearestNDInterpolator

from .recipe_scene import read_call, require_program, run_tool, write_buildings

__all__ = ["main"]

_LOWEST = "3"


def main() -> None:
    """Run the recipe."""
    require_program("saga_cmd", "the Debian package saga")
    call = read_call(cell_of_filter=1.0, radius=30.0, slope=30.0)
    points, settings = call.points, call.settings
    cell = float(settings["cell_of_filter"])
    x, y = points.x - call.extent[0], points.y - call.extent[1]
    np.savetxt("points.txt", np.column_stack([x, y, points.z]), fmt="%.3f")
    _saga("io_shapes", "16", POINTS="points.sg-pts", FILE="points.txt", SEPARATOR="1")
    lowest = {"GRID": "lowest.sgrd", "AGGREGATION": _LOWEST, "CELLSIZE": f"{cell:g}"}
    _saga("pointcloud_tools", "4", POINTS="points.sg-pts", **lowest)
    radius = max(1, round(float(settings["radius"]) / cell))
    steep = {"RADIUS": str(radius), "TERRAINSLOPE": f"{float(settings['slope']):g}"}
    _saga("grid_filter", "7", INPUT="lowest.sgrd", GROUND="ground.sgrd", **steep)
    places, heights = _cells(Path("ground.sgrd"))
    below = NearestNDInterpolator(places, heights)
    write_buildings(call, points.z - below(x, y) >= settings["height"])


def _saga(library: str, tool: str, **options: str) -> None:
    run_tool(["saga_cmd", "--flags=s", library, tool, *(f"-{name}={value}" for name, value in options.items())])


def _cells(header: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return centre and value of the cells with data of a grid in SAGA's format."""
    lines = (line.partition("=") for line in header.read_text(encoding="utf-8").splitlines())
    facts = {name.strip(): value.strip() for name, _, value in lines}
    columns, rows = int(facts["CELLCOUNT_X"]), int(facts["CELLCOUNT_Y"])
    values = np.fromfile(header.with_suffix(".sdat"), dtype="<f4").reshape(rows, columns)
    row, column = np.nonzero(values != np.float32(facts["NODATA_VALUE"].partition(";")[0]))
    size = float(facts["CELLSIZE"])
    places = [float(facts["POSITION_XMIN"]) + column * size, float(facts["POSITION_YMIN"]) + row * size]
    return np.column_stack(places), values[row, column].astype(np.float64)


if __name__ == "__main__":
    main()
