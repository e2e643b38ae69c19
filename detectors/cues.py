"""Cues that tell roofs from trees, per cell of a grid.

Nouns
-----
high point
    A point more than the height threshold above the ground.
high share
    High points among all points of a cell: the share of the cell that something high covers, and 1 over a roof. Pulses
    pass through a crown, so its share is lower: the complement is the *penetration*.
multiple share
    High points whose pulse gave several returns, among the high points around: 0 on a roof, 1 in a crown.
roughness
    Standard deviation, metres, of the high points of 3 x 3 cells about their plane; each cell takes the smoothest of
    the windows that hold it, so that ridges, eaves and steps between roofs stay smooth.
greenness
    (NIR - R) / (NIR + R), or (G - R) / (G + R) without near infrared; NaN in the dark, where colours are noise.

Axis order (row, column), row 0 northernmost. Cells where a cue says nothing are NaN.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..scenes.points import PointCloud
from ..scenes.raster import Grid, Image

__all__ = ["CellCues", "cell_cues", "greenness"]

_Floats = NDArray[np.float32]

#: Number of moments kept per cell: n, x, y, z, xx, xy, yy, xz, yz, zz.
_MOMENTS = 10
#: A plane through fewer points than this fits by chance.
_LEAST_POINTS = 6
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
        Per cell; NaN without points.
    penetration : ndarray
        1 - high share over 3 x 3 cells.
    multiple_share : ndarray or None
        Over 3 x 3 cells; None when the points do not tell.
    roughness : ndarray
        Metres; NaN where too few points are high.
    height : ndarray
        Mean height of the high points, metres; NaN without.
    """

    grid: Grid
    count: _Floats
    high_share: _Floats
    penetration: _Floats
    multiple_share: _Floats | None
    roughness: _Floats
    height: _Floats


def cell_cues(points: PointCloud, heights: NDArray[np.float32], grid: Grid, *, threshold: float) -> CellCues:
    """Gather the cues of points on a grid.

    Parameters
    ----------
    points : PointCloud
    heights : ndarray of float32, shape (n,)
        Metres above ground; NaN leaves a point out.
    grid : Grid
    threshold : float
        Height in metres above which a point is high.
    """
    import cv2

    index, inside = grid.cells(points.x, points.y)
    used = np.flatnonzero(inside & np.isfinite(heights))
    size = grid.rows * grid.columns
    high = used[heights[used] > threshold]
    count = _on_grid(np.bincount(index[used], minlength=size), grid)
    moments = np.zeros((grid.rows, grid.columns, _MOMENTS))
    _gather(points.x, points.y, points.z, index, high, grid.west, grid.north, grid.gsd, moments)
    n_high = moments[..., 0].astype(np.float32)
    sums = np.bincount(index[high], weights=heights[high], minlength=size)

    multiple_share = None
    returns = points.number_of_returns
    if returns is not None and (returns[used] > 1).any():
        multiple = _on_grid(np.bincount(index[high[returns[high] > 1]], minlength=size), grid)
        multiple_share = _share(_box(multiple), _box(n_high))
    roughness = _roughness(moments, grid.gsd)
    # Where there is no plane, a deviation that never wins.
    smoothest = cv2.erode(np.where(np.isnan(roughness), _NO_PLANE, roughness), np.ones((3, 3), np.uint8))
    return CellCues(
        grid=grid,
        count=count,
        high_share=_share(n_high, count),
        penetration=1 - _share(_box(n_high), _box(count)),
        multiple_share=multiple_share,
        roughness=np.where((smoothest < _NO_PLANE) & (n_high > 0), smoothest, np.float32(np.nan)),
        height=_share(_on_grid(sums, grid), n_high),
    )


def greenness(image: Image, grid: Grid, *, darkest: float) -> _Floats | None:
    """Return the mean vegetation index of the image per cell of a grid; None when the image has no colours for it.

    Parameters
    ----------
    image : Image
    grid : Grid
    darkest : float
        Pixels whose brightest band is below this (0..1) say nothing.
    """
    import cv2

    if {"nir", "red"} <= set(image.bands):
        more, less = image.band("nir"), image.band("red")
    elif {"green", "red"} <= set(image.bands):
        more, less = image.band("green"), image.band("red")
    else:
        return None
    bright = np.maximum(more, less)
    if not bright.any():
        return None
    told = (bright >= darkest) if image.valid is None else (bright >= darkest) & image.valid
    index = np.where(told, (more - less) / np.maximum(more + less, np.float32(1e-6)), np.float32(0))
    # Blurred to the cell size before it is sampled at the cell centres: a mean over about one cell, also for cells
    # smaller than a pixel.
    width = max(1, round(grid.gsd / image.grid.gsd))
    weight = cv2.blur(told.astype(np.float32), (width, width), borderType=cv2.BORDER_CONSTANT)
    total = cv2.blur(index, (width, width), borderType=cv2.BORDER_CONSTANT)
    x, _ = grid.to_world(0, np.arange(grid.columns) + 0.5)
    _, y = grid.to_world(np.arange(grid.rows) + 0.5, 0)
    _, column = image.grid.to_pixel(x, image.grid.north)
    row, _ = image.grid.to_pixel(image.grid.west, y)
    map_x, map_y = np.meshgrid((column - 0.5).astype(np.float32), (row - 0.5).astype(np.float32))
    options = {"interpolation": cv2.INTER_LINEAR, "borderMode": cv2.BORDER_CONSTANT, "borderValue": 0}
    weight = cv2.remap(weight, map_x, map_y, **options)
    total = cv2.remap(total, map_x, map_y, **options)
    return np.where(weight > 0.25, total / np.maximum(weight, np.float32(0.25)), np.float32(np.nan))


def _on_grid(values: NDArray[np.generic], grid: Grid) -> _Floats:
    return values.astype(np.float32).reshape(grid.shape)


def _box(values: _Floats) -> _Floats:
    """Sum over 3 x 3 cells."""
    import cv2

    total: _Floats = cv2.boxFilter(values, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    return total


def _share(part: _Floats, whole: _Floats) -> _Floats:
    return np.where(whole > 0, part / np.maximum(whole, np.float32(1)), np.float32(np.nan))


@njit(cache=True)
def _gather(x, y, z, index, chosen, west, north, cell, moments):  # type: ignore[no-untyped-def]
    """Add the moments of the chosen points to their cells, relative to the cell's centre and first height."""
    columns = moments.shape[1]
    for i in chosen:
        r, c = index[i] // columns, index[i] % columns
        dx = x[i] - (west + (c + 0.5) * cell)
        dy = y[i] - (north - (r + 0.5) * cell)
        dz = z[i]
        m = moments[r, c]
        m[0] += 1
        m[1] += dx
        m[2] += dy
        m[3] += dz
        m[4] += dx * dx
        m[5] += dx * dy
        m[6] += dy * dy
        m[7] += dx * dz
        m[8] += dy * dz
        m[9] += dz * dz


@njit(cache=True)
def _roughness(moments, cell):  # type: ignore[no-untyped-def]
    """Return the deviation from the least-squares plane of each 3 x 3 window; NaN where no plane is determined."""
    rows, columns, _ = moments.shape
    rough = np.full((rows, columns), np.nan, dtype=np.float32)
    s = np.zeros(_MOMENTS)
    for row in range(rows):
        for column in range(columns):
            s[:] = 0.0
            for r in range(max(row - 1, 0), min(row + 2, rows)):
                for c in range(max(column - 1, 0), min(column + 2, columns)):
                    m = moments[r, c]
                    if m[0] == 0:
                        continue
                    # Shift the origin from the cell's own centre to that of the window.
                    dx, dy = (c - column) * cell, (row - r) * cell
                    s[0] += m[0]
                    s[1] += m[1] + m[0] * dx
                    s[2] += m[2] + m[0] * dy
                    s[3] += m[3]
                    s[4] += m[4] + 2 * dx * m[1] + m[0] * dx * dx
                    s[5] += m[5] + dx * m[2] + dy * m[1] + m[0] * dx * dy
                    s[6] += m[6] + 2 * dy * m[2] + m[0] * dy * dy
                    s[7] += m[7] + dx * m[3]
                    s[8] += m[8] + dy * m[3]
                    s[9] += m[9]
            n = s[0]
            if n < _LEAST_POINTS:
                continue
            mx, my, mz = s[1] / n, s[2] / n, s[3] / n
            xx, xy, yy = s[4] / n - mx * mx, s[5] / n - mx * my, s[6] / n - my * my
            xz, yz, zz = s[7] / n - mx * mz, s[8] / n - my * mz, s[9] / n - mz * mz
            determinant = xx * yy - xy * xy
            # Points on one scan line, or on top of each other, determine no plane.
            if determinant < 1e-3 * (0.5 * (xx + yy)) ** 2 or xx + yy < 0.01 * cell * cell:
                continue
            a = (xz * yy - yz * xy) / determinant
            b = (yz * xx - xz * xy) / determinant
            rough[row, column] = np.sqrt(max(zz - a * xz - b * yz, 0.0) * n / (n - 3))
    return rough
