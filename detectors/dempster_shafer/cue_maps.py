"""The cues of the Dempster-Shafer detector on a grid: heights, pulse difference, vegetation and texture of the surface.

Nouns
-----
surface
    Mean height of the last returns above ground per cell, metres; cells without points take the nearest value.
pulse difference
    Highest first return minus lowest last return of a cell and its neighbours that lie high, metres: large in crowns.
    Walls also part the pulses, so that the smallest difference of the windows around a cell counts. Points whose return
    numbers are unknown count as first and as last returns: pulses that pass through a crown end at all heights in it.
strength, directedness
    Of the changes of the surface normal, by the structure tensor N of the slopes: strength R = sqrt(trace N), 1/m;
    directedness D = 4 det N / (trace N)^2: 0 where the slope changes in one direction (a ridge, an edge), 1 where it
    changes alike in all (a crown). Source: Fuchs & Förstner (1995), applied to first derivatives as in Rottensteiner et
    al. (2005).

Axis order (row, column), row 0 northernmost. NaN is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Grid

__all__ = ["CueMaps", "cue_maps"]

_Floats = NDArray[np.float32]

#: Least share of the cells with points in which a first and in which a last return is.
_LEAST_NUMBERED = 0.5


@dataclass(frozen=True, eq=False)
class CueMaps:
    """The cues on a grid, float32 of shape (rows, columns).

    Attributes
    ----------
    grid : Grid
    height : ndarray
        The surface: height above ground, metres.
    pulse_difference : ndarray or None
        Metres.
    numbered : bool
        Whether the return numbers of a part of the points are known.
    vegetation : ndarray or None
        Vegetation index of the image.
    strength, directedness : ndarray
    """

    grid: Grid
    height: _Floats
    pulse_difference: _Floats | None
    numbered: bool
    vegetation: _Floats | None
    strength: _Floats
    directedness: _Floats


def cue_maps(
    points: PointCloud, heights: NDArray[np.float32], grid: Grid, *, window: float, vegetation: _Floats | None
) -> CueMaps:
    """Return the cue maps of points.

    Parameters
    ----------
    points : PointCloud
    heights : ndarray of float32, shape (n,)
        Metres above ground; NaN leaves a point out.
    grid : Grid
    window : float
        Sigma of the Gaussian over which the structure tensor is averaged, metres.
    vegetation : ndarray, optional
        Vegetation index per cell.
    """
    index, inside = grid.cells(points.x, points.y)
    used = inside & np.isfinite(heights)
    first, last, numbered = _first_and_last(points, used, index, grid)
    surface, known = _mean(index[last], heights[last], grid)
    surface = _nearest_filled(surface, known)
    highest = _extreme(index[first], heights[first], grid, np.maximum)
    lowest = _extreme(index[last], heights[last], grid, np.minimum)
    strength, directedness = _texture(surface, grid.gsd, window)
    return CueMaps(
        grid=grid,
        height=surface,
        pulse_difference=_least_around(highest - lowest),
        numbered=numbered,
        vegetation=vegetation,
        strength=strength,
        directedness=directedness,
    )


def _first_and_last(
    points: PointCloud, used: NDArray[np.bool_], index: NDArray[np.intp], grid: Grid
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], bool]:
    """Return which points are first and last returns, and whether that is known of any; both where it is not known.

    Some files write the same numbers at every point, none of which is that of a last return.
    """
    number, total = points.return_number, points.number_of_returns
    if number is None or total is None or not (total > 1).any():
        return used, used, False
    known = used & (total > 0)
    first, last = known & (number == 1), known & (number == total)
    size = grid.rows * grid.columns
    covered, *numbered = (np.count_nonzero(np.bincount(index[part], minlength=size)) for part in (known, first, last))
    if min(numbered) < _LEAST_NUMBERED * covered:
        return used, used, False
    unknown = used & ~known
    return first | unknown, last | unknown, True


def _mean(index: NDArray[np.intp], values: NDArray[np.float32], grid: Grid) -> tuple[_Floats, NDArray[np.bool_]]:
    size = grid.rows * grid.columns
    count = np.bincount(index, minlength=size)
    total = np.bincount(index, weights=values, minlength=size)
    known = (count > 0).reshape(grid.shape)
    return (total / np.maximum(count, 1)).reshape(grid.shape).astype(np.float32), known


def _extreme(index: NDArray[np.intp], values: NDArray[np.float32], grid: Grid, choice: np.ufunc) -> _Floats:
    """Return the largest or smallest value of each cell; NaN without."""
    worst = np.float32(-np.inf if choice is np.maximum else np.inf)
    found = np.full(grid.rows * grid.columns, worst, dtype=np.float32)
    choice.at(found, index, values)
    found[~np.isfinite(found)] = np.nan
    return found.reshape(grid.shape)


def _nearest_filled(values: _Floats, known: NDArray[np.bool_]) -> _Floats:
    from scipy.ndimage import distance_transform_edt

    if known.all() or not known.any():
        return np.where(known, values, np.float32(0))
    _, (rows, columns) = distance_transform_edt(~known, return_indices=True)
    filled: _Floats = values[rows, columns]
    return filled


def _least_around(difference: _Floats) -> _Floats:
    """Return the morphological opening of the difference over 3 x 3 cells, unknown cells as 0.

    Narrow lines of large differences, as along walls, disappear; crowns stay.
    """
    import cv2

    square = np.ones((3, 3), np.uint8)
    solid = cv2.dilate(np.nan_to_num(difference), square)
    opened = cv2.erode(cv2.erode(solid, square), square)
    return np.asarray(cv2.dilate(opened, square), dtype=np.float32)


def _texture(surface: _Floats, cell: float, window: float) -> tuple[_Floats, _Floats]:
    """Return strength and directedness of the changes of the slopes."""
    import cv2

    smooth = cv2.GaussianBlur(surface, (0, 0), 0.7, borderType=cv2.BORDER_REPLICATE)
    down, across = np.gradient(smooth, cell)
    tensor = np.zeros((3, *surface.shape), dtype=np.float32)
    for slope in (down, across):
        along, over = np.gradient(slope, cell)
        tensor += np.stack([along * along, over * over, along * over]).astype(np.float32)
    sigma = max(window / cell, 0.5)
    yy, xx, xy = (cv2.GaussianBlur(part, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE) for part in tensor)
    trace = yy + xx
    directedness = np.where(trace > 1e-9, 4 * (yy * xx - xy * xy) / np.maximum(trace * trace, 1e-18), 0)
    return np.sqrt(trace).astype(np.float32), np.clip(directedness, 0, 1).astype(np.float32)
