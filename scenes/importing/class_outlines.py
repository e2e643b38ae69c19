"""Outlines of classified points: a reference derived from points classified as building.

The points of one class are put on cells, gaps between them are closed, and the regions are traced and simplified.
Such outlines are as good as the classification and as the point spacing; scenes that use them call their reference
*derived*.
"""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import InputError
from ..geodata.density import point_spacing
from ..geodata.footprints import Footprints
from ..geodata.outlines import coverage_of_mask, simplify, trace
from ..geodata.points import PointCloud
from ..geodata.raster import Grid

__all__ = ["BUILDING_CLASS", "outlines_of_class"]

#: How far an outline may move when it is simplified, in cells.
_TOLERANCE = 1.5
#: ASPRS LAS 1.4 R15, table 17.
BUILDING_CLASS = 6


def outlines_of_class(
    points: PointCloud,
    extent: tuple[float, float, float, float],
    *,
    code: int = BUILDING_CLASS,
    cell: float | None = None,
    minimum_area: float = 10.0,
    crs: str | None = None,
    source: str = "point cloud",
) -> Footprints:
    """Return the traced outlines of the points of one class.

    Parameters
    ----------
    points : PointCloud
        With classification.
    extent : tuple of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    code : int
        ASPRS class; 6 is building.
    cell : float, optional
        Cell size in metres; by default the one at which a cell on a roof holds two points, from 0.25 m to 2 m.
    minimum_area : float
        Regions and holes smaller than this, m2, are dropped; holes below a quarter of it are filled.
    crs : str, optional
    source : str
        File or files, for messages.

    Raises
    ------
    InputError
        No classification or no point of this class.
    """
    from scipy import ndimage

    if points.classification is None:
        raise InputError(f"{source}: the points are not classified, so no reference can be derived from class {code}")
    chosen = points.classification == code
    if not chosen.any():
        classes = ", ".join(map(str, np.unique(points.classification)))
        raise InputError(f"{source}: no point is of class {code} (there are {classes}): give footprints by reference=")
    x, y = points.x[chosen], points.y[chosen]
    grid = _padded(Grid.covering(extent, cell if cell is not None else _cell(x, y, extent)))
    index, inside = grid.cells(x, y)
    mask = np.bincount(index[inside], minlength=grid.rows * grid.columns).reshape(grid.shape) > 0
    disc = ndimage.generate_binary_structure(2, 1)
    mask = ndimage.binary_closing(mask, disc)
    mask = ndimage.binary_opening(mask, np.ones((3, 3), dtype=bool))
    traced = trace(coverage_of_mask(mask), grid)
    outlines = simplify(_without_small_holes(traced, minimum_area / 4), _TOLERANCE * grid.gsd)
    if len(outlines):
        outlines = outlines[shapely.area(outlines) >= minimum_area]
    # From north to south, west to east, so that numbers follow the order of reading.
    bounds = shapely.bounds(outlines).reshape(-1, 4)
    return Footprints.of(outlines[np.lexsort((bounds[:, 0], -bounds[:, 3]))], crs=crs, source=source)


def _cell(x: NDArray[np.float64], y: NDArray[np.float64], extent: tuple[float, float, float, float]) -> float:
    """Return the cell size that holds two points where a typical point lies, 0.25 to 2 m in steps of 0.05 m."""
    spacing = point_spacing(x, y, extent, square=2.0, statistic="median-point") or 1.0
    return min(max(math.ceil(20 * math.sqrt(2) * spacing - 1e-9) / 20, 0.25), 2.0)


def _padded(grid: Grid) -> Grid:
    """Return the grid with three more cells on each side, so that closing and opening see no border."""
    return Grid(grid.west - 3 * grid.gsd, grid.north + 3 * grid.gsd, grid.gsd, grid.rows + 6, grid.columns + 6)


def _without_small_holes(polygons: NDArray[np.object_], smallest: float) -> NDArray[np.object_]:
    """Return the polygons with holes below an area, m2, filled."""
    filled = []
    for polygon in polygons:
        holes = [hole for hole in polygon.interiors if shapely.Polygon(hole).area >= smallest]
        filled.append(shapely.Polygon(polygon.exterior, holes))
    return np.array(filled, dtype=object)
