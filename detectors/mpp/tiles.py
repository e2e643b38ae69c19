"""A city as many small jobs that give one result, whatever the number and order of threads.

Nouns
-----
tile
    Square of a grid that is fixed in absolute coordinates; it owns the buildings whose centre lies in it (half open).
halo
    Buildings of other tiles within reach of a tile's own: its job sees them, fixed, and cannot overlap them unseen.
group
    One of four; tiles of one group do not touch, so that no job reads what another of its group writes. The groups are
    processed one after the other, the tiles of one group in parallel.

Because every job starts from what its neighbours have found, a building on a seam belongs to one tile and is never
found twice; a second round on a grid shifted by half a tile lets those on the seams move and merge. Random streams
come from (seed, column, row) of the tile in the absolute grid.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.raster import Grid
from .threads import ONE_THREAD, Threads

__all__ = ["Tile", "process_tiles", "tiles_of"]

_Rectangles = NDArray[np.float64]


@dataclass(frozen=True)
class Tile:
    """One square.

    Attributes
    ----------
    column, row : int
        Place in the absolute grid, row counted from south to north.
    window : tuple of float
        x0, y0, x1, y1 in cells of the working grid.
    """

    column: int
    row: int
    window: tuple[float, float, float, float]

    @property
    def group(self) -> int:
        """0 to 3."""
        return self.column % 2 + 2 * (self.row % 2)

    def owns(self, rectangles: _Rectangles) -> NDArray[np.bool_]:
        """Return which rectangles have their centre here."""
        x0, y0, x1, y1 = self.window
        x, y = rectangles[:, 0], rectangles[:, 1]
        return np.asarray((x >= x0) & (x < x1) & (y >= y0) & (y < y1))

    def sees(self, rectangles: _Rectangles, reach: float) -> NDArray[np.bool_]:
        """Return which rectangles have their centre in the halo, and not here."""
        x0, y0, x1, y1 = self.window
        x, y = rectangles[:, 0], rectangles[:, 1]
        near = (x >= x0 - reach) & (x < x1 + reach) & (y >= y0 - reach) & (y < y1 + reach)
        return np.asarray(near & ~self.owns(rectangles))


def tiles_of(grid: Grid, size: float, *, shifted: bool = False) -> list[Tile]:
    """Return the tiles that a grid meets, by row and column.

    Parameters
    ----------
    grid : Grid
    size : float
        Side of a tile, metres.
    shifted : bool
        Whether the grid of tiles is moved by half a tile east and north.
    """
    west, south, east, north = grid.extent
    offset = size / 2 if shifted else 0.0
    columns = range(math.floor((west - offset) / size), math.ceil((east - offset) / size))
    rows = range(math.floor((south - offset) / size), math.ceil((north - offset) / size))
    tiles = []
    for row in rows:
        for column in columns:
            x0, y0 = column * size + offset, row * size + offset
            tiles.append(
                Tile(
                    column,
                    row,
                    (
                        max((x0 - west) / grid.gsd, 0.0),
                        max((north - y0 - size) / grid.gsd, 0.0),
                        min((x0 + size - west) / grid.gsd, float(grid.columns)),
                        min((north - y0) / grid.gsd, float(grid.rows)),
                    ),
                )
            )
    return tiles


def process_tiles(
    tiles: Sequence[Tile],
    start: _Rectangles,
    job: Callable[[Tile, _Rectangles, _Rectangles], _Rectangles],
    *,
    reach: float,
    threads: Threads = ONE_THREAD,
) -> _Rectangles:
    """Run a job per tile, group by group, and return all rectangles.

    Parameters
    ----------
    tiles : sequence of Tile
        Covering the centres of `start`.
    start : ndarray, shape (n, 5)
    job : callable
        ``job(tile, own, fixed)`` returns the tile's new rectangles, centred in it.
    reach : float
        Width of the halo, cells; less than a tile, so that tiles of one group are independent.
    threads : Threads
    """
    rectangles = start
    for group in range(4):
        batch = [tile for tile in tiles if tile.group == group]
        before = rectangles

        def run(tile: Tile, before: _Rectangles = before) -> _Rectangles:
            return job(tile, before[tile.owns(before)], before[tile.sees(before, reach)])

        found = threads.map(run, batch)
        kept = np.ones(len(rectangles), dtype=bool)
        for tile in batch:
            kept &= ~tile.owns(rectangles)
        rectangles = np.concatenate([rectangles[kept], *found])
    return rectangles
