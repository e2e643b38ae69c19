"""Cues that separate roofs from trees, per cell of a grid.

Nouns
-----
high point
    A point more than the height threshold above the ground.
high share
    High points among all points of a cell: the share of the cell that a high object covers, 1 over a roof. Pulses pass
    through a crown, so its share is lower: the complement is the *penetration*.
multiple share
    High points whose pulse gave several returns, among the high points around: 0 on a roof, 1 in a crown.
roughness
    Standard deviation, metres, of the high points of a window about their plane; each cell has the smallest value of
    the windows that contain it, so that ridges, eaves and steps between roofs are smooth.
greenness
    (NIR - R) / (NIR + R), or (G - R) / (G + R) without near infrared; NaN in the dark, where colours are noise.
chromaticity
    Shares of red and of blue in the sum of red, green and blue; NaN in the dark.

Axis order (row, column), row 0 northernmost. Cells without a value are NaN.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Grid, Image

__all__ = ["DARKEST", "LEAST_GREEN_RED", "LEAST_NDVI", "CellCues", "cell_cues", "chromaticity", "greenness", "rated"]

_Floats = NDArray[np.float32]

#: Greenness of vegetation with and without near infrared, and brightness (0..1) below which colours are noise.
LEAST_NDVI, LEAST_GREEN_RED, DARKEST = 0.15, 0.05, 0.1

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
#: Least share of usable pixels in a cell.
_LEAST_USABLE = np.float32(0.25)
#: Stands for the mask of an image that has data everywhere.
_ALL_VALID = np.empty((0, 0), dtype=np.bool_)
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
        Over 3 x 3 cells; None when the points have no number of returns, or one each.
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
    count, n_high, multiple, sums, high, low, several = found
    multiple_share = _share(_box(multiple), _box(n_high)) if several else None
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
) -> tuple[_Floats, _Floats, _Floats, NDArray[np.float64], NDArray[np.intp], NDArray[np.intp], bool]:
    """Tally points in their cells; `returns` is empty where the number of returns is not known.

    Returns per cell the number of points, of high points and of high points of several returns, and the sum of the
    heights of high points; the rows of the high and of the low points; and whether any point has several returns.
    """
    size = shape[0] * shape[1]
    count, n_high = np.zeros(size, dtype=np.float32), np.zeros(size, dtype=np.float32)
    multiple, sums = np.zeros(size, dtype=np.float32), np.zeros(size)
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
            high[many] = i
            many += 1
        if heights[i] < _GROUND:
            low[few] = i
            few += 1
    on_grid = count.reshape(shape), n_high.reshape(shape), multiple.reshape(shape), sums.reshape(shape)
    return (*on_grid, high[:many], low[:few], several)


def _noise(points: PointCloud, heights: NDArray[np.float32], low: NDArray[np.intp], grid: Grid) -> float:
    """Return the noise of the heights of low points, metres; see `CellCues`."""
    blocks = Grid.covering(grid.extent, max(_BLOCK, grid.gsd))
    index, _ = blocks.cells(points.x[low], points.y[low])
    size, h = blocks.rows * blocks.columns, heights[low].astype(np.float64)
    count = np.bincount(index, minlength=size)
    several = count >= _LEAST_POINTS
    if not several.any():
        return 0.0
    n, mean = count[several], np.bincount(index, weights=h, minlength=size)[several] / count[several]
    squares = np.bincount(index, weights=h * h, minlength=size)[several] / n
    return float(np.median(np.sqrt(np.maximum(squares - mean**2, 0) * n / (n - 1))))


def greenness(image: Image, grid: Grid, *, darkest: float) -> _Floats | None:
    """Return the mean vegetation index of the image per cell of a grid; None when the image has no colours for it.

    Parameters
    ----------
    image : Image
    grid : Grid
    darkest : float
        Pixels whose brightest band is below this (0..1) are ignored.
    """
    leaves = next((name for name in ("nir", "green") if {name, "red"} <= set(image.bands)), None)
    if leaves is None:
        return None
    more, less = (image.values[image.bands.index(name)] for name in (leaves, "red"))
    if not (more.any() or less.any()):
        return None
    row, column, width = _places(image, grid)
    valid = _ALL_VALID if image.valid is None else image.valid
    pixels = _Pixels(more, less, valid, np.float32(np.iinfo(more.dtype).max), np.float32(darkest))
    return np.asarray(_green_cells(pixels, row, column, width))


class _Pixels(NamedTuple):
    """Two bands of an image, whether a pixel has data (empty: all have), the value of white, the darkest brightness."""

    more: NDArray[Any]
    less: NDArray[Any]
    valid: NDArray[np.bool_]
    white: np.float32
    darkest: np.float32


def _places(image: Image, grid: Grid) -> tuple[_Floats, _Floats, int]:
    """Return the rows and the columns of the image at the cell centres (0: centre of the first), and pixels per cell.

    Averaging over about one cell before sampling at the cell centres avoids aliasing.
    """
    x, _ = grid.to_world(0, np.arange(grid.columns) + 0.5)
    _, y = grid.to_world(np.arange(grid.rows) + 0.5, 0)
    _, column = image.grid.to_pixel(x, image.grid.north)
    row, _ = image.grid.to_pixel(image.grid.west, y)
    width = max(1, round(grid.gsd / image.grid.gsd))
    return (row - 0.5).astype(np.float32), (column - 0.5).astype(np.float32), width


@kernel
def _green_cells(pixels: _Pixels, rows: _Floats, columns: _Floats, width: int) -> _Floats:
    """Return (more - less) / (more + less), averaged over the usable pixels of squares and interpolated, per cell.

    The same means as `_cell_means`, but for rounding: pixels are turned into indices row by row, and no raster of the
    size of the image is made. `rows`, `columns` and `width` are `_places`.
    """
    high, wide = pixels.more.shape
    result = np.empty((len(rows), len(columns)), dtype=np.float32)
    total, weight = np.empty(wide, dtype=np.float32), np.empty(wide, dtype=np.float32)
    area = np.float32(width * width)
    for i in range(len(rows)):
        total[:], weight[:] = 0, 0
        top = math.floor(rows[i]) - width // 2
        for r in range(max(top, 0), min(top + width + 1, high)):
            share = _share_of(rows[i], r - top, width, high)
            for c in range(wide if share > 0 else 0):
                # np.divide: a loop with an error for division by zero is not vectorised.
                one = np.divide(np.float32(pixels.more[r, c]), pixels.white)
                other = np.divide(np.float32(pixels.less[r, c]), pixels.white)
                index = np.divide(one - other, max(one + other, np.float32(1e-6)))
                usable = share if max(one, other) >= pixels.darkest else np.float32(0)
                if len(pixels.valid) > 0:
                    usable *= np.float32(pixels.valid[r, c])
                total[c] += usable * index
                weight[c] += usable
        for j in range(len(columns)):
            left, sums, weights = math.floor(columns[j]) - width // 2, np.float32(0), np.float32(0)
            for c in range(max(left, 0), min(left + width + 1, wide)):
                share = _share_of(columns[j], c - left, width, wide)
                sums += share * total[c]
                weights += share * weight[c]
            known = weights > _LEAST_USABLE * area
            result[i, j] = np.divide(sums, weights) if known else np.float32(np.nan)
    return result


@kernel(inline="always")
def _share_of(place: np.float32, offset: int, width: int, count: int) -> np.float32:
    """Return the share of a pixel, `offset` behind the start of the first of two squares, in their interpolation.

    The squares are those around the pixels before and after a place; one whose centre is outside the image counts 0.
    """
    first, share = math.floor(place), np.float32(0)
    beyond = place - np.float32(first)
    if offset < width and 0 <= first < count:
        share += np.float32(1) - beyond
    if offset > 0 and 0 <= first + 1 < count:
        share += beyond
    return share


def chromaticity(image: Image, grid: Grid, *, darkest: float) -> _Floats | None:
    """Return the shares of red and of blue in the colour of each cell of a grid, shape (2, rows, columns).

    Shares do not depend on how brightly a slope is lit. None when the image has no colours; `darkest`: see `greenness`.
    """
    if not image.is_colour:
        return None
    red, green, blue = (image.band(name) for name in ("red", "green", "blue"))
    total = np.maximum(red + green + blue, np.float32(1e-6))
    bright = np.maximum(np.maximum(red, green), blue)
    usable = (bright >= darkest).astype(np.float32)
    return np.stack(_cell_means((usable * (red / total), usable * (blue / total)), usable, image, grid))


def _cell_means(values: tuple[_Floats, ...], usable: _Floats, image: Image, grid: Grid) -> list[_Floats]:
    """Return the means of the usable pixels (1, else 0) per cell; NaN where more than three quarters have none.

    Values are 0 where a pixel is not usable.
    """
    import cv2

    if image.valid is not None:
        usable = usable * image.valid
        values = tuple(one * image.valid for one in values)
    row, column, width = _places(image, grid)
    map_x, map_y = np.meshgrid(column, row)

    def sampled(pixels: _Floats) -> _Floats:
        blurred = cv2.blur(pixels, (width, width), borderType=cv2.BORDER_CONSTANT)
        cells: _Floats = cv2.remap(
            blurred, map_x, map_y, interpolation=cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0
        )
        return cells

    weight = sampled(usable)
    known, divisor = weight > _LEAST_USABLE, np.maximum(weight, _LEAST_USABLE)
    return [np.where(known, sampled(one) / divisor, np.float32(np.nan)) for one in values]


def rated(values: _Floats, threshold: float, width: float) -> _Floats:
    """Return the rating of values: -1 (roof) to +1 (tree), 0 at the threshold, the ends a width away from it."""
    ratings: _Floats = np.clip((values - np.float32(threshold)) / np.float32(width), -1, 1)
    return ratings


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
