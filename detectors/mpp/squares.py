"""A scene as many small jobs that give one result, whatever the number and order of threads.

Nouns
-----
square
    Tile of the fixed grid of `detectors.tiling`, with the side `side_of`; its job changes the buildings whose centre
    lies in it (half open).
fixed
    Buildings centred in other squares, within reach: a job sees them and cannot overlap them unseen.
group
    One of four; squares of one group do not touch. The groups are processed one after the other, the squares of one
    group in parallel: their jobs see what the groups before left.

Two rounds: a greedy search of the squares, group by group, and a local search of squares shifted by half a side, group
by group, which lets buildings on the borders move and merge. It is made twice, with and without the rectangles at the
borders of the first round, and the state of lower energy is kept. The sampler adds a round between the two: a chain in
each square, between what the first round left in its neighbours. It alone draws random numbers, and it starts from a
result that depends on few metres around. So what is found at a place depends on little more than the squares around
it: a window of a scene gives what the scene gives.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.raster import Grid
from ..tiling import tiles_over
from .arrays import Floats, Rectangles
from .rectangles import corners
from .threads import ONE_THREAD, Threads

__all__ = ["Rounds", "Square", "at_borders", "process_squares", "rounds_of", "side_of"]

#: Cells between a rectangle and a border that it touches, at most.
_TOUCH = 1.5

_Extent = tuple[float, float, float, float]


class Square(NamedTuple):
    """One square.

    Attributes
    ----------
    column, row : int
        Place in the grid, row counted from south to north.
    edges : ndarray, shape (4,)
        x0, y0, x1, y1 in cells of the working grid.
    """

    column: int
    row: int
    edges: Floats

    @property
    def place(self) -> tuple[int, int]:
        """Column and row as whole numbers that are not negative, for a random stream."""
        return self.column % 2**32, self.row % 2**32

    @property
    def group(self) -> int:
        """0 to 3."""
        return self.column % 2 + 2 * (self.row % 2)

    def owns(self, rectangles: Rectangles) -> NDArray[np.bool_]:
        """Return which rectangles have their centre here."""
        x0, y0, x1, y1 = self.edges
        x, y = rectangles[:, 0], rectangles[:, 1]
        return np.asarray((x >= x0) & (x < x1) & (y >= y0) & (y < y1))

    def sees(self, rectangles: Rectangles, largest: float) -> NDArray[np.bool_]:
        """Return which rectangles are centred elsewhere and can overlap one of a largest side that is centred here."""
        x0, y0, x1, y1 = self.edges
        x, y = rectangles[:, 0], rectangles[:, 1]
        apart = np.hypot(np.maximum(np.maximum(x0 - x, x - x1), 0), np.maximum(np.maximum(y0 - y, y - y1), 0))
        near = apart < 0.5 * (np.hypot(rectangles[:, 2], rectangles[:, 3]) + math.sqrt(2.0) * largest)
        return np.asarray(near & ~self.owns(rectangles))


class Rounds(NamedTuple):
    """The squares of each round, by row and column."""

    greedy: list[Square]
    chains: list[Square]
    shifted: list[Square]


def side_of(largest_side: float) -> float:
    """Return the side of a square, metres: the power of two that is at least the largest side of a building.

    >>> side_of(120)
    128.0
    """
    return 2.0 ** math.ceil(math.log2(largest_side))


def rounds_of(grid: Grid, core: _Extent, largest_side: float) -> Rounds:
    """Return the squares of each round; chains run in those around the core alone.

    The searches process the whole window: a hall that is built in the core can reach far beyond it.
    """
    side = side_of(largest_side)
    greedy, shifted = _squares(grid, grid.extent, side, 0.0), _squares(grid, grid.extent, side, side / 2)
    around = _outer(core, side, side / 2)
    return Rounds(greedy, _squares(grid, around, side, 0.0), shifted if len(greedy) > 1 else [])


def _outer(extent: _Extent, side: float, shift: float) -> _Extent:
    """Return the extent of the squares that an extent meets."""
    west, south = (math.floor((low - shift) / side) * side + shift for low in extent[:2])
    east, north = (math.ceil((high - shift) / side) * side + shift for high in extent[2:])
    return west, south, east, north


def _squares(grid: Grid, extent: _Extent, side: float, shift: float) -> list[Square]:
    """Return the squares that meet both an extent and the grid, cut to the grid."""
    west, south, east, north = grid.extent
    met = max(west, extent[0]), max(south, extent[1]), min(east, extent[2]), min(north, extent[3])
    found = []
    for tile in tiles_over(tuple(edge - shift for edge in met), side):  # type: ignore[arg-type]
        x0, y0, x1, y1 = (edge + shift for edge in tile.core)
        edges = [
            max((x0 - west) / grid.gsd, 0.0),
            max((north - y1) / grid.gsd, 0.0),
            min((x1 - west) / grid.gsd, float(grid.columns)),
            min((north - y0) / grid.gsd, float(grid.rows)),
        ]
        found.append(Square(tile.column, tile.row, np.array(edges)))
    return found


def at_borders(rectangles: Rectangles, squares: Sequence[Square]) -> NDArray[np.bool_]:
    """Return which rectangles cross or touch a border between squares that cover a grid, shape (n,).

    >>> halves = [Square(0, 0, np.array([0.0, 0, 10, 8])), Square(1, 0, np.array([10.0, 0, 20, 8]))]
    >>> at_borders(np.array([[9.0, 4, 4, 2, 0], [6, 4, 4, 2, 0], [19, 4, 4, 2, 0]]), halves).tolist()
    [True, False, False]
    """
    place = corners(rectangles)
    low, high = place.min(axis=1) - _TOUCH, place.max(axis=1) + _TOUCH
    edges = np.array([square.edges for square in squares]).reshape(-1, 2, 2)
    found = np.zeros(len(rectangles), dtype=np.bool_)
    for axis in range(2):
        # The first and the last are the edges of the grid.
        borders = np.unique(edges[..., axis])[1:-1]
        found |= np.searchsorted(borders, low[:, axis]) < np.searchsorted(borders, high[:, axis])
    return found


def process_squares(
    squares: Sequence[Square],
    start: Rectangles,
    job: Callable[[Square, Rectangles, Rectangles], Rectangles],
    *,
    largest: float,
    groups: int = 4,
    threads: Threads = ONE_THREAD,
) -> Rectangles:
    """Run a job per square and return all rectangles; those outside the squares stay.

    Parameters
    ----------
    squares : sequence of Square
    start : ndarray, shape (n, 5)
    job : callable
        ``job(square, own, fixed)`` returns the square's new rectangles, centred in it.
    largest : float
        Largest side of a building, cells.
    groups : int
        4, or 1 where every job starts from what was there before the round.
    threads : Threads
    """
    rectangles = start
    for group in range(groups):
        batch = [square for square in squares if square.group % groups == group]
        before = rectangles

        def run(square: Square, before: Rectangles = before) -> Rectangles:
            return job(square, before[square.owns(before)], before[square.sees(before, largest)])

        found = threads.map(run, batch)
        kept = np.ones(len(rectangles), dtype=bool)
        for square in batch:
            kept &= ~square.owns(rectangles)
        rectangles = np.concatenate([rectangles[kept], *found])
    return rectangles
