"""Cues of laser points that separate roofs from trees, per cell of a grid; those of an image are `pixel_cues`.

Nouns
-----
high point
    A point more than the height threshold above the ground.
high share
    High points among all points of a cell: the share of the cell that a high object covers, 1 over a roof. Pulses pass
    through a crown, so its share is lower: the complement is the *penetration*.
multiple share
    High points whose pulse gave several returns, among the high points around whose number of returns is known (not 0):
    0 on a roof, 1 in a crown.
roughness
    Standard deviation, metres, of the high points of a window about their plane; each cell has the smallest value of
    the windows that contain it, so that ridges, eaves and steps between roofs are smooth.
rating
    What a cue says of a cell: -1 (roof) to +1 (tree).

Axis order (row, column), row 0 northernmost. Cells without a value are NaN.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Grid

__all__ = ["CellCues", "cell_cues", "rated"]

_Floats = NDArray[np.float32]

#: Least number of points in the 3 x 3 cells around a cell without points from which its high share is taken.
_NEIGHBOURS = 3
#: Least number of points for a plane; fewer fit one by chance.
_LEAST_POINTS = 6
#: Least ratio of the spread of the points in two directions (determinant over squared mean of their covariance).
_FLATTEST = 1e-3
#: Metres: side of the blocks in which the noise of low points is estimated, and height below which a point is low.
_BLOCK, _GROUND = 2.0, 1.0
#: Cells of a strip.
_STRIP = 1_000_000
#: Stands for the numbers of returns of a cloud without them.
_NO_RETURNS = np.empty(0, dtype=np.uint8)
#: Deviation where there is no plane: larger than any real one.
_NO_PLANE = np.float32(1e9)


@dataclass(frozen=True, eq=False)
class CellCues:
    """Cues of the laser points on a grid; all arrays of shape (rows, columns), float32.

    Attributes
    ----------
    grid : Grid
    count : ndarray
        Points per cell, high or low.
    high_share : ndarray
        Per cell, or over 3 x 3 cells where a cell has no points; NaN where those have none either.
    penetration : ndarray
        1 - high share over 3 x 3 cells.
    multiple_share : ndarray or None
        Over 3 x 3 cells, NaN where no number of returns is known; None when no point has several.
    roughness : ndarray
        Metres; NaN where too few points are high.
    height : ndarray
        Mean height of the high points, metres; NaN without.
    noise : float
        Standard deviation of the heights of low points within `_BLOCK` metres, median, metres; 0 where too few are near
        each other.
    """

    grid: Grid
    count: _Floats
    high_share: _Floats
    penetration: _Floats
    multiple_share: _Floats | None
    roughness: _Floats
    height: _Floats
    noise: float = 0.0


def cell_cues(
    points: PointCloud, heights: NDArray[np.float32], grid: Grid, *, threshold: float, window: float
) -> CellCues:
    """Return the cues of points on a grid.

    Parameters
    ----------
    points : PointCloud
    heights : ndarray of float32, shape (n,)
        Metres above ground; NaN leaves a point out.
    grid : Grid
    threshold : float
        Height in metres above which a point is high.
    window : float
        Width in metres of the windows in which planes are fitted; at least two cells.
    """
    index, inside = grid.cells(points.x, points.y)
    returns = points.number_of_returns
    found = _tally(index, inside, heights, _NO_RETURNS if returns is None else returns, threshold, grid.shape)
    count, n_high, multiple, unknown, sums, high, low, several = found
    multiple_share = _share(_box(multiple), _box(n_high - unknown)) if several else None
    smoothest = _smoothest_plane(points, index, high, grid, max(2, round(window / grid.gsd)))
    shared = _share(_box(n_high), _box(count))
    return CellCues(
        grid=grid,
        count=count,
        high_share=np.where((count > 0) | (_box(count) < _NEIGHBOURS), _share(n_high, count), shared),
        penetration=1 - shared,
        multiple_share=multiple_share,
        roughness=np.where((smoothest < _NO_PLANE) & (n_high > 0), smoothest, np.float32(np.nan)),
        height=_share(sums.astype(np.float32), n_high),
        noise=_noise(points, heights, low, grid),
    )


@kernel
def _tally(
    index: NDArray[np.intp],
    inside: NDArray[np.bool_],
    heights: NDArray[np.float32],
    returns: NDArray[np.uint8],
    threshold: float,
    shape: tuple[int, int],
) -> tuple[_Floats, _Floats, _Floats, _Floats, NDArray[np.float64], NDArray[np.intp], NDArray[np.intp], bool]:
    """Tally points in their cells; `returns` is empty where the number of returns is not known of any, 0 of one.

    Returns per cell the number of points, of high points, of high points of several and of an unknown number of
    returns, and the sum of the heights of high points; the rows of the high and of the low points; and whether any
    point has several returns.
    """
    size = shape[0] * shape[1]
    count, n_high = np.zeros(size, dtype=np.float32), np.zeros(size, dtype=np.float32)
    multiple, unknown, sums = np.zeros(size, dtype=np.float32), np.zeros(size, dtype=np.float32), np.zeros(size)
    high, low = np.empty(len(heights), dtype=np.intp), np.empty(len(heights), dtype=np.intp)
    many, few, several = 0, 0, False
    least = np.float32(threshold)
    for i in range(len(heights)):
        if not (inside[i] and math.isfinite(heights[i])):
            continue
        cell = np.uintp(index[i])
        is_multiple = len(returns) > 0 and returns[i] > 1
        several |= is_multiple
        count[cell] += 1
        if heights[i] > least:
            n_high[cell] += 1
            sums[cell] += heights[i]
            multiple[cell] += is_multiple
            unknown[cell] += len(returns) > 0 and returns[i] == 0
            high[many] = i
            many += 1
        if heights[i] < _GROUND:
            low[few] = i
            few += 1
    on_grid = count.reshape(shape), n_high.reshape(shape), multiple.reshape(shape), unknown.reshape(shape)
    return (*on_grid, sums.reshape(shape), high[:many], low[:few], several)


def _noise(points: PointCloud, heights: NDArray[np.float32], low: NDArray[np.intp], grid: Grid) -> float:
    """Return the noise of the heights of low points, metres; see `CellCues`."""
    blocks = Grid.covering(grid.extent, max(_BLOCK, grid.gsd))
    index, _ = blocks.cells(points.x, points.y)
    count, total, squares = _sums(index, heights, low, blocks.rows * blocks.columns)
    several = count >= _LEAST_POINTS
    if not several.any():
        return 0.0
    n, mean, squares = count[several], total[several] / count[several], squares[several] / count[several]
    return float(np.median(np.sqrt(np.maximum(squares - mean**2, 0) * n / (n - 1))))


def rated(values: _Floats, threshold: float, width: float) -> _Floats:
    """Return the rating of values: -1 (roof) to +1 (tree), 0 at the threshold, the ends a width away from it."""
    ratings: _Floats = np.clip((values - np.float32(threshold)) / np.float32(width), -1, 1)
    return ratings


@kernel
def _sums(
    index: NDArray[np.intp], heights: NDArray[np.float32], chosen: NDArray[np.intp], size: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the number, the sum of the heights and the sum of their squares of the chosen points of each block."""
    count, total, squares = np.zeros(size), np.zeros(size), np.zeros(size)
    for i in chosen:
        block, height = np.uintp(index[np.uintp(i)]), np.float64(heights[np.uintp(i)])
        count[block] += 1
        total[block] += height
        squares[block] += height * height
    return count, total, squares


def _box(values: _Floats) -> _Floats:
    """Return the sums over 3 x 3 cells."""
    import cv2

    total: _Floats = cv2.boxFilter(values, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    return total


def _share(part: _Floats, whole: _Floats) -> _Floats:
    return np.where(whole > 0, part / np.maximum(whole, np.float32(1)), np.float32(np.nan))


@kernel
def _moments(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    z: NDArray[np.float64],
    index: NDArray[np.intp],
    chosen: NDArray[np.intp],
    origin: tuple[float, float, float],
    shape: tuple[int, int],
) -> NDArray[np.float64]:
    """Return the sums of 1, x, y, z, xx, xy, yy, xz, yz, zz of the chosen points in each cell, shape (10, *shape).

    `index` is the cell of each chosen point; coordinates are relative to an origin.
    """
    sums = np.zeros((10, shape[0] * shape[1]))
    for position in range(len(chosen)):
        # Unsigned, so that indices are not tested for counting from the end.
        i, cell = np.uintp(chosen[position]), np.uintp(index[position])
        dx, dy, dz = x[i] - origin[0], y[i] - origin[1], z[i] - origin[2]
        sums[0, cell] += 1
        sums[1, cell] += dx
        sums[2, cell] += dy
        sums[3, cell] += dz
        sums[4, cell] += dx * dx
        sums[5, cell] += dx * dy
        sums[6, cell] += dy * dy
        sums[7, cell] += dx * dz
        sums[8, cell] += dy * dz
        sums[9, cell] += dz * dz
    return sums.reshape((10, shape[0], shape[1]))


def _smoothest_plane(
    points: PointCloud, index: NDArray[np.intp], chosen: NDArray[np.intp], grid: Grid, width: int
) -> _Floats:
    """Return the smallest deviation from a plane among the windows of width x width cells that contain a cell.

    The grid is processed in strips of rows, because ten moments per cell take more memory than the points.
    """
    import cv2

    before = (width - 1) // 2
    after = width - 1 - before
    window = np.ones((width, width), np.uint8)
    smoothest = np.empty(grid.shape, dtype=np.float32)
    x, y = grid.to_world(grid.rows / 2, grid.columns / 2)
    origin = float(x), float(y), float(points.z[chosen].mean()) if len(chosen) else 0.0
    row = index[chosen] // grid.columns
    strip = max(4 * width, _STRIP // grid.columns)
    for top in range(0, grid.rows, strip):
        # A cell's windows reach width - 1 rows beyond it.
        first, last = max(top - width + 1, 0), min(top + strip + width - 1, grid.rows)
        here = chosen[(row >= first) & (row < last)]
        shape = (last - first, grid.columns)
        moments = _moments(points.x, points.y, points.z, index[here] - first * grid.columns, here, origin, shape)
        for moment in moments:
            cv2.boxFilter(
                moment, -1, (width, width), moment, (before, before), normalize=False, borderType=cv2.BORDER_CONSTANT
            )
        least = cv2.erode(_plane_deviation(moments), window, anchor=(after, after))
        smoothest[top : top + strip] = least[top - first : top - first + strip]
    return smoothest


@kernel
def _plane_deviation(moments: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the standard deviation about the least-squares plane, `_NO_PLANE` where the points determine none."""
    _, rows, columns = moments.shape
    deviation = np.full((rows, columns), _NO_PLANE, dtype=np.float32)
    for row in range(rows):
        for column in range(columns):
            n = round(moments[0, row, column])
            if n < _LEAST_POINTS:
                continue
            mx, my, mz = moments[1, row, column] / n, moments[2, row, column] / n, moments[3, row, column] / n
            xx = moments[4, row, column] / n - mx * mx
            xy = moments[5, row, column] / n - mx * my
            yy = moments[6, row, column] / n - my * my
            xz = moments[7, row, column] / n - mx * mz
            yz = moments[8, row, column] / n - my * mz
            zz = moments[9, row, column] / n - mz * mz
            determinant = xx * yy - xy * xy
            # Points on one scan line, or at one place, determine no plane.
            if determinant < max(_FLATTEST * (0.5 * (xx + yy)) ** 2, 1e-8):
                continue
            a = (xz * yy - yz * xy) / determinant
            b = (yz * xx - xz * xy) / determinant
            # Adding the standard error keeps the minimum over windows from favouring windows of few points.
            sigma = np.sqrt(max(zz - a * xz - b * yz, 0.0) * n / (n - 3))
            deviation[row, column] = sigma * (1 + 1 / np.sqrt(2.0 * (n - 3)))
    return deviation
