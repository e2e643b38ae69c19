"""Points put on a grid without copies of them: the lowest of each cell, and the mean near a surface.

Nouns
-----
lowest surface
    Per cell the lowest point that is not isolated, metres; NaN without one.

A cloud holds more points than its grid has cells, so further arrays have the size of the grid: nothing is sorted, and
the only array of the points' size holds heights in four bytes each. Axis order of grids: (row, column), row 0
northernmost.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ..geodata.density import point_spacing
from ..geodata.raster import Elevation, Frame, Grid

__all__ = ["default_cell", "lowest_surface", "mean_above"]

_Coordinates = NDArray[np.float64]

#: Points in height within this many metres of a cell's lowest point support it, itself included; how many must, and
#: which share of the points around.
_SUPPORT_HEIGHT, _SUPPORT, _SUPPORT_SHARE = 1.0, 3, 0.05
#: Points whose height above a surface is computed at a time.
_CHUNK = 1 << 18


def default_cell(x: _Coordinates, y: _Coordinates, extent: Sequence[float]) -> float:
    """Return the cell size in metres at which an average covered cell holds two points, at least 1 m.

    Squares of 4 m without points do not count as covered, so that water and a ragged border do not coarsen the grid.
    """
    spacing = point_spacing(x, y, extent) or 0.0
    # A spacing of 1.4142136 m, as of one point in two square metres, is no reason for cells of more than 2 m.
    return max(1.0, math.ceil(10 * math.sqrt(2) * spacing - 1e-9) / 10)


def lowest_surface(x: _Coordinates, y: _Coordinates, z: _Coordinates, grid: Grid) -> NDArray[np.float32]:
    """Return the lowest point of each cell that is not isolated, shape (rows, columns); NaN without one.

    A lowest point is isolated when fewer than three points, or 5 % of the points, in its 5 x 5 cells lie within 1 m
    of its height: a reflection from below the ground or a no-data height. It is passed over for the next lowest.
    """
    start = np.zeros(grid.rows * grid.columns + 1, dtype=np.int64)
    _count(x, y, grid.frame, start)
    np.cumsum(start, out=start)
    heights = np.empty(start[-1], dtype=np.float32)
    _group(x, y, z, grid.frame, start, heights)
    lowest: NDArray[np.float32] = _lowest_supported(heights, start, grid.rows, grid.columns)
    return lowest


@kernel(inline="always")
def _cell_of(x: float, y: float, frame: Frame) -> int:
    """Return the flat cell of a place, -1 outside."""
    row, column = (frame.north - y) / frame.gsd, (x - frame.west) / frame.gsd
    return int(row) * frame.columns + int(column) if 0 <= row < frame.rows and 0 <= column < frame.columns else -1


@kernel
def _count(x: _Coordinates, y: _Coordinates, frame: Frame, counts: NDArray[np.int64]) -> None:
    """Fill the counts of the points of each cell, in the place after its own."""
    for i in range(len(x)):
        k = _cell_of(x[i], y[i], frame)
        if k >= 0:
            counts[k + 1] += 1


@kernel
def _group(
    x: _Coordinates,
    y: _Coordinates,
    z: _Coordinates,
    frame: Frame,
    start: NDArray[np.int64],
    heights: NDArray[np.float32],
) -> None:
    """Write the heights cell by cell; afterwards as before, cell c begins at ``start[c]``."""
    for i in range(len(x)):
        k = _cell_of(x[i], y[i], frame)
        if k >= 0:
            heights[start[k]] = z[i]
            start[k] += 1
    for k in range(frame.rows * frame.columns, 0, -1):
        start[k] = start[k - 1]
    start[0] = 0


@kernel
def _lowest_supported(
    heights: NDArray[np.float32], start: NDArray[np.int64], rows: int, columns: int
) -> NDArray[np.float32]:
    """Lowest supported height per cell; `heights` is grouped by cell, cell c holds ``start[c]:start[c + 1]``."""
    lowest = np.full((rows, columns), np.nan, dtype=np.float32)
    for row in range(rows):
        for column in range(columns):
            first, last = start[row * columns + column], start[row * columns + column + 1]
            passed = -np.inf
            while np.isnan(lowest[row, column]):
                height = np.inf
                for i in range(first, last):
                    if passed < heights[i] < height:
                        height = heights[i]
                if height == np.inf:
                    break
                if _supported(heights, start, rows, columns, row, column, height):
                    lowest[row, column] = height
                passed = height
    return lowest


@kernel
def _supported(
    heights: NDArray[np.float32],
    start: NDArray[np.int64],
    rows: int,
    columns: int,
    row: int,
    column: int,
    height: float,
) -> bool:
    """Return whether enough points around lie near a height."""
    support, around = 0, 0
    for r in range(max(row - 2, 0), min(row + 3, rows)):
        first = start[r * columns + max(column - 2, 0)]
        last = start[r * columns + min(column + 2, columns - 1) + 1]
        around += last - first
        for i in range(first, last):
            if abs(heights[i] - height) < _SUPPORT_HEIGHT:
                support += 1
    return bool(support >= max(_SUPPORT, _SUPPORT_SHARE * around))


def mean_above(
    x: _Coordinates, y: _Coordinates, z: _Coordinates, surface: Elevation, *, tolerance: float
) -> NDArray[np.float32]:
    """Return the mean height above a surface of the points near it, per cell, metres; NaN without one.

    Parameters
    ----------
    x, y, z : ndarray, shape (n,)
        Metres.
    surface : Elevation
        Known everywhere.
    tolerance : float
        Points nearer to the surface than this, metres, are near.
    """
    grid = surface.grid
    count, total = np.zeros(grid.rows * grid.columns, dtype=np.int32), np.zeros(grid.rows * grid.columns)
    for first in range(0, len(x), _CHUNK):
        part = slice(first, first + _CHUNK)
        _add_near(x[part], y[part], z[part] - surface.sample(x[part], y[part]), tolerance, grid.frame, count, total)
    mean = np.full(grid.shape, np.nan, dtype=np.float32)
    np.divide(total.reshape(grid.shape), count.reshape(grid.shape), out=mean, where=count.reshape(grid.shape) > 0)
    return mean


@kernel
def _add_near(
    x: _Coordinates,
    y: _Coordinates,
    above: NDArray[np.float64],
    tolerance: float,
    frame: Frame,
    count: NDArray[np.int32],
    total: NDArray[np.float64],
) -> None:
    """Add the points near a surface, `above` it in metres, to number and sum of their cells, in place."""
    for i in range(len(x)):
        k = _cell_of(x[i], y[i], frame)
        if k >= 0 and abs(above[i]) < tolerance:
            count[k] += 1
            total[k] += above[i]
