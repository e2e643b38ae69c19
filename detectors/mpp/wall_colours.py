"""The colours of roofs beside party walls, read from the image around one block only.

A roof covering ends at a party wall: tiles of another colour are another house, whatever the heights say.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.raster import Grid, Image
from ..shared.pixel_cues import DARKEST, chromaticity
from .arrays import Floats

__all__ = ["Colours", "colours_at", "colours_of"]

#: Metres around a block: rectangles reach beyond it, and means of pixels beyond them.
_AROUND = 4.0


class Colours(NamedTuple):
    """Shares of red and of blue, shape (2, rows, columns), in a window of the grid that begins at `top` and `left`."""

    shares: NDArray[np.float32]
    top: int
    left: int


def colours_of(block: Any, image: Image | None, grid: Grid) -> Colours | None:
    """Return the colours around a block (polygon in metres of the CRS); None without an image in colours there."""
    if image is None or not image.is_colour:
        return None
    xmin, ymin, xmax, ymax = block.bounds
    part = grid.part((xmin - _AROUND, ymin - _AROUND, xmax + _AROUND, ymax + _AROUND))
    if part is None:
        return None
    window = grid.cut(*part)
    west, south, east, north = window.extent
    pixels = image.window((west - _AROUND, south - _AROUND, east + _AROUND, north + _AROUND))
    shares = None if pixels is None else chromaticity(pixels, window, darkest=DARKEST)
    return None if shares is None else Colours(shares, part[0].start, part[1].start)


def colours_at(colours: Colours, row: NDArray[np.int64], column: NDArray[np.int64]) -> Floats:
    """Return the shares at cells of the grid, shape (2, *row.shape); NaN outside the window."""
    _, rows, columns = colours.shares.shape
    row, column = row - colours.top, column - colours.left
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    flat = np.where(inside, row * columns + column, 0)
    found: Floats = colours.shares.reshape(2, -1).take(flat, axis=1).astype(np.float64)
    found[:, ~inside] = np.nan
    return found
