"""Cues from the colours of an image, per cell of a grid.

Nouns
-----
greenness
    (NIR - R) / (NIR + R), or (G - R) / (G + R) without near infrared; NaN in the dark, where colours are noise.
chromaticity
    Shares of red and of blue in the sum of red, green and blue; NaN in the dark.
usable pixel
    One that has data and is not dark.

Values of pixels are averaged over squares about as wide as a cell, and interpolated between their centres. Axis order
(row, column), row 0 northernmost.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.raster import Grid, Image

__all__ = ["DARKEST", "LEAST_GREEN_RED", "LEAST_NDVI", "chromaticity", "greenness"]

_Floats = NDArray[np.float32]

#: Greenness of vegetation with and without near infrared, and brightness (0..1) below which colours are noise.
LEAST_NDVI, LEAST_GREEN_RED, DARKEST = 0.15, 0.05, 0.1

#: Least share of usable pixels around a cell.
_LEAST_USABLE = np.float32(0.25)
#: Stands for the mask of an image that has data everywhere.
_ALL_VALID = np.empty((0, 0), dtype=np.bool_)


class _Pixels(NamedTuple):
    """An image as the kernel reads it.

    Attributes
    ----------
    bands : ndarray, shape (bands, rows, columns)
        All bands of the image.
    chosen : ndarray of int64, shape (2 or 3,)
        Two bands whose normalised difference is wanted, or red, blue and green, whose shares are.
    valid : ndarray of bool, shape (rows, columns)
        Whether a pixel has data; empty where all have.
    white : float32
        Value of white.
    darkest : float32
        Least brightness of a usable pixel, 0..1.
    """

    bands: NDArray[Any]
    chosen: NDArray[np.int64]
    valid: NDArray[np.bool_]
    white: np.float32
    darkest: np.float32


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
    pixels = _pixels(image, (leaves, "red"), darkest)
    if not any(pixels.bands[band].max(initial=0) for band in pixels.chosen):
        return None
    index: _Floats = _cell_means(pixels, *_places(image, grid))[0]
    return index


def chromaticity(image: Image, grid: Grid, *, darkest: float) -> _Floats | None:
    """Return the shares of red and of blue in the colour of each cell of a grid, shape (2, rows, columns).

    Shares do not depend on how brightly a slope is lit. None when the image has no colours; `darkest`: see `greenness`.
    """
    if not image.is_colour:
        return None
    shares: _Floats = _cell_means(_pixels(image, ("red", "blue", "green"), darkest), *_places(image, grid))
    return shares


def _pixels(image: Image, bands: tuple[str, ...], darkest: float) -> _Pixels:
    values: NDArray[Any] = np.ascontiguousarray(image.values)
    chosen = np.array([image.bands.index(name) for name in bands])
    valid = _ALL_VALID if image.valid is None else np.ascontiguousarray(image.valid)
    return _Pixels(values, chosen, valid, np.float32(np.iinfo(values.dtype).max), np.float32(darkest))


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
def _cell_means(pixels: _Pixels, rows: _Floats, columns: _Floats, width: int) -> _Floats:
    """Return the index (1), or the shares (2), averaged over usable pixels, per cell, shape (1 or 2, rows, columns).

    NaN where three quarters of a square or more are not usable. Pixels are read row by row, and no raster of the size
    of the image is made. `rows`, `columns` and `width` are `_places`.
    """
    count, (_, high, wide) = len(pixels.chosen), pixels.bands.shape
    one_band, other_band, last_band = pixels.chosen[0], pixels.chosen[1], pixels.chosen[count - 1]
    means = np.empty((count - 1, len(rows), len(columns)), dtype=np.float32)
    # Sums of the two values and of the weights of usable pixels in each column of the image.
    first, second, weight = np.empty((3, wide), dtype=np.float32)
    for i in range(len(rows)):
        first[:], second[:], weight[:] = 0, 0, 0
        top = math.floor(rows[i]) - width // 2
        for r in range(max(top, 0), min(top + width + 1, high)):
            share = _share_of(rows[i], r - top, width, high)
            for c in range(wide if share > 0 else 0):
                # np.divide: a loop with an error for division by zero is not vectorised.
                a = np.divide(np.float32(pixels.bands[one_band, r, c]), pixels.white)
                b = np.divide(np.float32(pixels.bands[other_band, r, c]), pixels.white)
                g = np.divide(np.float32(pixels.bands[last_band, r, c]), pixels.white)
                usable = share if max(a, b, g) >= pixels.darkest else np.float32(0)
                if len(pixels.valid) > 0:
                    usable *= np.float32(pixels.valid[r, c])
                weight[c] += usable
                if count == 2:
                    first[c] += usable * np.divide(a - b, max(a + b, np.float32(1e-6)))
                else:
                    total = max(a + g + b, np.float32(1e-6))
                    first[c] += usable * np.divide(a, total)
                    second[c] += usable * np.divide(b, total)
        for j in range(len(columns)):
            left, weights = math.floor(columns[j]) - width // 2, np.float32(0)
            one, other = np.float32(0), np.float32(0)
            for c in range(max(left, 0), min(left + width + 1, wide)):
                share = _share_of(columns[j], c - left, width, wide)
                one, other, weights = one + share * first[c], other + share * second[c], weights + share * weight[c]
            known = weights > _LEAST_USABLE * np.float32(width * width)
            means[0, i, j] = np.divide(one, weights) if known else np.float32(np.nan)
            if count > 2:
                means[1, i, j] = np.divide(other, weights) if known else np.float32(np.nan)
    return means


@kernel(inline="always")
def _share_of(place: np.float32, offset: int, width: int, count: int) -> np.float32:
    """Return the share of a pixel, `offset` behind the start of the first of two squares, in their interpolation.

    The squares are those around the pixels before and after a place; one whose centre is outside the image counts 0.
    """
    before, share = math.floor(place), np.float32(0)
    beyond = place - np.float32(before)
    if offset < width and 0 <= before < count:
        share += np.float32(1) - beyond
    if offset > 0 and 0 <= before + 1 < count:
        share += beyond
    return share
