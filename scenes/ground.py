"""Bare earth from laser points: elevation models of ground points, and a ground filter where nobody told them apart.

Nouns
-----
lowest surface
    Per cell the lowest point that is not isolated, metres.
object
    A connected region of cells that an opening of the lowest surface removes and that stands on walls: a roof, a
    crown, a bridge. A hill top, which an opening removes too, ends without walls and stays ground.
wall
    A step of the lowest surface by more than the wall height within two cells, beyond the slope of its surroundings.

The filter is a progressive opening with growing windows and a height threshold that grows with the window (Zhang et
al. 2003, "A progressive morphological filter for removing nonground measurements from airborne LIDAR data", IEEE TGRS
41(4); Pingel, Clarke & McBride 2013, "An improved simple morphological filter", ISPRS J. 77), taken relative to a
robust plane, so that a uniform slope costs nothing, with the test for walls added, so that windows as wide as the
largest halls do not cut hills. Axis order of grids: (row, column), row 0 northernmost.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .points import PointCloud
from .raster import Elevation, Grid

__all__ = ["elevation_from_points", "fill_unknown", "ground_surface"]

_Floats = NDArray[np.float32]
_Mask = NDArray[np.bool_]

#: Points in height within this many metres of a cell's lowest point support it, itself included; how many must, and
#: which share of the points around.
_SUPPORT_HEIGHT, _SUPPORT, _SUPPORT_SHARE = 1.0, 3, 0.05
#: Windows up to this radius in metres remove what they remove, walls or not: shrubs and crowns have ragged borders.
_NARROW = 6.0
#: Share of the border of a wide object that must be wall.
_WALLED = 0.4


def ground_surface(
    points: PointCloud,
    extent: Sequence[float],
    *,
    cell: float | None = None,
    largest_object: float = 100.0,
    slope: float = 0.15,
    wall_height: float = 1.0,
    tolerance: float = 0.4,
) -> Elevation:
    """Return the bare earth below all points, whatever they were reflected by.

    Parameters
    ----------
    points : PointCloud
        Any returns; points that are not finite are left out.
    extent : sequence of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    cell : float, optional
        Cell size in metres; by default 1 m, more where the points are so sparse that a cell would hold less than two.
    largest_object : float
        Width in metres up to which an object is taken off the ground.
    slope : float
        Rise over run, besides that of the whole scene, that is still ground.
    wall_height : float
        Least step, metres, at the border of an object.
    tolerance : float
        Lowest points nearer than this, metres, to the ground found are ground themselves.

    Returns
    -------
    Elevation
        Known everywhere, unless there is no point at all (then NaN).
    """
    x, y, z = _finite(points)
    grid = Grid.covering(extent, cell or default_cell(x, y, extent))
    lowest = lowest_surface(x, y, z, grid)
    if np.isnan(lowest).all():
        return Elevation(lowest, grid)
    plane = _robust_plane(lowest)
    relief = lowest - plane
    objects = _objects(fill_unknown(relief), grid.gsd, largest_object, slope, wall_height)
    ground = fill_unknown(np.where(objects, np.float32(np.nan), relief))
    # Cut hill tops and the feet of shrubs come back; what they add lets the next round reach a little further.
    for _ in range(2):
        again = objects & (np.abs(relief - ground) < tolerance)
        if not again.any():
            break
        objects &= ~again
        ground = fill_unknown(np.where(objects, np.float32(np.nan), relief))
    return _averaged(x, y, z, grid, ground + plane, tolerance)


def elevation_from_points(points: PointCloud, extent: Sequence[float], *, cell: float | None = None) -> Elevation:
    """Return the mean height of points per cell, with cells without points interpolated.

    Made for points that are known to be ground; a cloud without a finite point gives NaN everywhere.

    Parameters
    ----------
    points : PointCloud
    extent : sequence of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    cell : float, optional
        Cell size in metres; by default as in `ground_surface`.
    """
    x, y, z = _finite(points)
    grid = Grid.covering(extent, cell or default_cell(x, y, extent))
    index, inside = grid.cells(x, y)
    index, height = index[inside], z[inside]
    size = grid.rows * grid.columns
    count = np.bincount(index, minlength=size)
    base = float(height.min()) if len(height) else 0.0
    total = np.bincount(index, weights=height - base, minlength=size)
    mean = np.full(size, np.nan)
    np.divide(total, count, out=mean, where=count > 0)
    return Elevation(fill_unknown((mean + base).astype(np.float32).reshape(grid.shape)), grid)


def default_cell(x: NDArray[np.float64], y: NDArray[np.float64], extent: Sequence[float]) -> float:
    """Return the cell size in metres at which an average covered cell holds two points, at least 1 m.

    Cells of 4 m without points do not count as covered, so that water and a ragged border do not coarsen the grid.
    """
    coarse = Grid.covering(extent, 4.0)
    index, inside = coarse.cells(x, y)
    covered = np.count_nonzero(np.bincount(index[inside], minlength=1))
    if covered == 0:
        return 1.0
    density = np.count_nonzero(inside) / (covered * 16.0)
    return max(1.0, math.ceil(10 * math.sqrt(2.0 / density)) / 10)


def lowest_surface(x: NDArray[np.float64], y: NDArray[np.float64], z: NDArray[np.float64], grid: Grid) -> _Floats:
    """Return the lowest point of each cell that is not isolated, shape (rows, columns); NaN without one.

    A lowest point is isolated when fewer than three points, or 5 % of the points, in its 5 x 5 cells lie within 1 m
    of its height: a reflection from below the ground or a no-data height. It is passed over for the next lowest.
    """
    index, inside = grid.cells(x, y)
    order = np.argsort(index[inside], kind="stable")
    cells = index[inside][order]
    heights = z[inside][order].astype(np.float32)
    start = np.searchsorted(cells, np.arange(grid.rows * grid.columns + 1))
    return _lowest_supported(heights, start, grid.rows, grid.columns)  # type: ignore[no-any-return]


@njit(cache=True)
def _lowest_supported(heights, start, rows, columns):  # type: ignore[no-untyped-def]
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


@njit(cache=True)
def _supported(heights, start, rows, columns, row, column, height):  # type: ignore[no-untyped-def]
    support, around = 0, 0
    for r in range(max(row - 2, 0), min(row + 3, rows)):
        first = start[r * columns + max(column - 2, 0)]
        last = start[r * columns + min(column + 2, columns - 1) + 1]
        around += last - first
        for i in range(first, last):
            if abs(heights[i] - height) < _SUPPORT_HEIGHT:
                support += 1
    return support >= max(_SUPPORT, _SUPPORT_SHARE * around)


def fill_unknown(values: _Floats) -> _Floats:
    """Return the values with NaN replaced by a smooth surface through the known ones (all NaN stays NaN).

    Pull and push: unknown cells take the bilinear value of the filled grid of half the resolution, and each level is
    then relaxed towards the mean of the four neighbours (membrane), so that a gap in a slope is filled along it.
    """
    known = np.isfinite(values)
    if known.all() or not known.any():
        return values.astype(np.float32)
    # Heights above sea are large against the float32 step of their sums.
    base = np.float32(values[known].mean())
    filled = _pull_push(np.where(known, values - base, 0).astype(np.float32), known)
    filled += base
    filled[known] = values[known]
    return filled


def _pull_push(values: _Floats, known: _Mask) -> _Floats:
    import cv2

    rows, columns = values.shape
    if not known.all() and max(rows, columns) > 1:
        even = ((0, rows % 2), (0, columns % 2))
        weight = _blocks(np.pad(known.astype(np.float32), even))
        total = _blocks(np.pad(values * known, even))
        mean: _Floats = (total / np.maximum(weight, 1)).astype(np.float32)
        coarse = _pull_push(mean, weight > 0)
        finer = cv2.resize(coarse, (columns + columns % 2, rows + rows % 2), interpolation=cv2.INTER_LINEAR)
        values = np.where(known, values, finer[:rows, :columns])
        _relax(values, known, 20)
    return values


def _blocks(values: _Floats) -> _Floats:
    return values[::2, ::2] + values[1::2, ::2] + values[::2, 1::2] + values[1::2, 1::2]


@njit(cache=True)
def _relax(values, known, rounds):  # type: ignore[no-untyped-def]
    """Move unknown cells to the mean of their neighbours, in place, `rounds` sweeps in alternating order."""
    rows, columns = values.shape
    for sweep in range(rounds):
        for i in range(rows):
            r = i if sweep % 2 == 0 else rows - 1 - i
            for j in range(columns):
                c = j if sweep % 2 == 0 else columns - 1 - j
                if known[r, c]:
                    continue
                total, count = 0.0, 0
                if r > 0:
                    total += values[r - 1, c]
                    count += 1
                if r < rows - 1:
                    total += values[r + 1, c]
                    count += 1
                if c > 0:
                    total += values[r, c - 1]
                    count += 1
                if c < columns - 1:
                    total += values[r, c + 1]
                    count += 1
                values[r, c] = total / count


def _finite(points: PointCloud) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    finite = np.isfinite(points.x) & np.isfinite(points.y) & np.isfinite(points.z)
    if finite.all():
        return points.x, points.y, points.z
    return points.x[finite], points.y[finite], points.z[finite]


def _robust_plane(surface: _Floats) -> _Floats:
    """Return a plane through the low part of a surface, on its grid: what lies above it counts less each round."""
    rows, columns = np.nonzero(np.isfinite(surface))
    heights = surface[rows, columns].astype(np.float64)
    scale = float(max(surface.shape))
    design = np.column_stack([np.ones(len(heights)), rows / scale, columns / scale])
    weights = np.ones(len(heights))
    coefficients = np.zeros(3)
    for _ in range(8):
        root = np.sqrt(weights)[:, None]
        coefficients = np.linalg.lstsq(design * root, heights * root[:, 0], rcond=None)[0]
        residual = heights - design @ coefficients
        spread = 1.4826 * np.median(np.abs(residual)) + 0.1
        weights = np.where(
            residual > 0, 1 / (1 + (residual / (0.5 * spread)) ** 2), 1 / (1 + (residual / (2 * spread)) ** 2)
        )
    row, column = np.indices(surface.shape, dtype=np.float32)
    plane: _Floats = (coefficients[0] + coefficients[1] / scale * row + coefficients[2] / scale * column).astype(
        np.float32
    )
    return plane


def _objects(relief: _Floats, cell: float, largest: float, slope: float, wall_height: float) -> _Mask:
    """Return the cells of objects: removed by an opening and, where the window is wide, standing on walls."""
    import cv2

    objects = np.zeros(relief.shape, dtype=bool)
    walls = _wall_cells(relief, wall_height)
    surface = relief
    for radius in _radii(largest / 2 / cell, min(relief.shape)):
        window = cv2.getStructuringElement(cv2.MORPH_RECT, (2 * radius + 1, 2 * radius + 1))
        opened = cv2.morphologyEx(surface, cv2.MORPH_OPEN, window)
        removed = surface - opened > np.minimum(0.3 + slope * radius * cell, 2.0)
        if radius * cell > _NARROW:
            removed = _standing(removed | objects, walls, objects)
        objects |= removed
        surface = np.where(removed, opened, surface)
    return objects


def _radii(largest: float, size: int) -> list[int]:
    """Window radii in cells, 1, 2, 3, 4, 6, 8, 12 ... up to the largest, none wider than the grid."""
    radii, radius = [], 1.0
    while True:
        radii.append(round(radius))
        if radius >= largest or 2 * radius + 1 >= size:
            return sorted(set(radii))
        radius = min(radius + max(1.0, radius * 0.41), largest)


def _wall_cells(relief: _Floats, height: float) -> _Mask:
    """Return the cells above a step: the fall within two cells, less half the rise, exceeds `height`.

    A steep slope rises as much as it falls; the border of a roof falls to the ground and rises to its ridge at most.
    """
    import cv2

    window = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    fall = relief - cv2.erode(relief, window)
    rise = cv2.dilate(relief, window) - relief
    return np.asarray(fall - rise / 2 > height)


def _standing(removed: _Mask, walls: _Mask, objects: _Mask) -> _Mask:
    """Return the removed cells of the regions that were objects before or whose border is wall."""
    import cv2

    count, labels = cv2.connectedComponents(removed.astype(np.uint8), connectivity=4)
    inner = cv2.erode(removed.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1)
    border = removed & (inner == 0)
    length = np.bincount(labels[border], minlength=count)
    walled = np.bincount(labels[border & walls], minlength=count)
    stands = walled >= _WALLED * np.maximum(length, 1)
    stands[0] = False
    return np.asarray(removed & (stands[labels] | objects))


def _averaged(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    z: NDArray[np.float64],
    grid: Grid,
    ground: _Floats,
    tolerance: float,
) -> Elevation:
    """Replace the lowest by the mean of the points within the tolerance of the ground: it is biased by the noise."""
    surface = Elevation(ground, grid)
    index, inside = grid.cells(x, y)
    above = np.where(inside, z - surface.sample(x, y), np.inf)
    near = np.abs(above) < tolerance
    size = grid.rows * grid.columns
    count = np.bincount(index[near], minlength=size)
    shift = np.bincount(index[near], weights=above[near], minlength=size) / np.maximum(count, 1)
    known = np.where(count > 0, shift, np.nan).astype(np.float32).reshape(grid.shape)
    return Elevation(ground + np.nan_to_num(fill_unknown(known)), grid) if count.any() else surface
