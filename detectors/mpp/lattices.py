"""Lattices: the places inside a rectangle at which roofs are read, along a row of houses and across it.

Nouns
-----
station, line
    Rows and columns of a lattice, `SPACING` metres apart: stations along the longer side, lines across it.
shear
    How many metres farther along the row a station lies for each metre across it. Oblique party walls follow the
    stations of a lattice with their shear; the middle of a station is where it is without one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.raster import Grid
from .arrays import Floats, Rectangles
from .rectangles import corners

__all__ = ["DECIMALS", "SPACING", "Lattice", "lattice_of"]

#: Metres between stations and between lines.
SPACING = 0.5
#: Bits of the fractions of a cell that places of the lattice are rounded to.
_FRACTION_BITS = 10
#: Decimals of the sides of rectangles, metres.
DECIMALS = 6


class Lattice(NamedTuple):
    """A lattice in a rectangle.

    Attributes
    ----------
    corner, along, across : ndarray, shape (2,)
        The first corner, metres in the grid frame, and the directions of both sides, unit length.
    length, depth : float
        Of the rectangle along the row and across it, m.
    shear : float
    """

    corner: Floats
    along: Floats
    across: Floats
    length: float
    depth: float
    shear: float = 0.0

    @property
    def stations(self) -> int:
        """Number of stations."""
        return len(np.arange(SPACING / 2, self.length, SPACING))

    def cells(self, grid: Grid) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Return row and column of the cells, and which places lie inside, each of shape (stations, lines)."""
        stations = np.arange(SPACING / 2, self.length, SPACING)
        lines = np.arange(SPACING / 2, self.depth, SPACING)
        far = stations[:, None] + self.shear * (lines - self.depth / 2)
        x, y = ((self.corner[k] + far * self.along[k] + lines * self.across[k]) / grid.gsd for k in (0, 1))
        column = np.minimum(np.maximum(_cell_of(x), 0), grid.columns - 1)
        row = np.minimum(np.maximum(_cell_of(y), 0), grid.rows - 1)
        return row, column, (far >= 0) & (far < self.length)

    def wall(self, at: float, grid: Grid) -> tuple[Floats, Floats]:
        """Return a place of a station, cells, and its direction, unit length; `at` is metres along the row."""
        first = self.corner + (at - self.shear * self.depth / 2) * self.along
        way = self.across + self.shear * self.along
        return first / grid.gsd, way / np.hypot(*way)


def lattice_of(rectangle: Rectangles, grid: Grid) -> Lattice:
    """Return the lattice of a rectangle, shape (5,), grid frame, without a shear."""
    place = corners(rectangle)[0] * grid.gsd
    first, second = place[1] - place[0], place[3] - place[0]
    # Rounded, so that a side of exactly so many stations has as many in every window of a scene.
    length, depth = (round(float(np.hypot(*side)), DECIMALS) for side in (first, second))
    if length < depth:
        first, second, length, depth = second, first, depth, length
    return Lattice(place[0], first / length, second / depth, length, depth)


def _cell_of(place: Floats) -> NDArray[np.int64]:
    """Return the cells of places in cells; on a border the same one whatever cell a window of the scene begins with."""
    parts: NDArray[np.int64] = np.rint(place * 2**_FRACTION_BITS).astype(np.int64)
    return parts >> _FRACTION_BITS
