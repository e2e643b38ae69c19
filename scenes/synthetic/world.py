"""The world of a scene: the true state that the simulated sensors measure.

Local world coordinates: x east, y north from the lower left corner of the extent, metres; z is elevation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ..geodata.raster import Elevation, Frame
from ..geodata.sampling import bilinear_at
from .buildings import build
from .clutter import patch_table, scatter
from .layout import Layout, plan_layout
from .parcels import plan_sites
from .recipe import SceneParameters
from .solids import Body, Solids
from .terrain import natural_terrain, terraced
from .vegetation import Trees, grow

__all__ = ["CellIndex", "CellLists", "Relief", "World", "ground_at", "make_world"]

_CELL = 4.0
#: Objects are listed in the cells within this distance, so that a path sampled every 2 m cannot miss one.
_REACH = 1.1


@dataclass(frozen=True)
class World:
    """Everything that stands in a scene.

    Attributes
    ----------
    recipe : SceneParameters
    seed : int
    terrain : Elevation
        Bare earth with its pads, local coordinates.
    layout : Layout
    solids : Solids
    trees : Trees
    patches : ndarray of float64, shape (n, 6)
        x, y, angle, length, width, cover.
    """

    recipe: SceneParameters
    seed: int
    terrain: Elevation
    layout: Layout
    solids: Solids
    trees: Trees
    patches: NDArray[np.float64]


def make_world(recipe: SceneParameters, seed: int) -> World:
    """Return the world of a recipe and a seed."""
    ground = natural_terrain(recipe, seed)
    layout = plan_layout(recipe, seed)
    sites = plan_sites(layout, recipe, seed)
    town = build(sites, ground, recipe, seed)
    terrain = terraced(ground, [part for part in town.solids if part.body == Body.BUILDING], recipe.terracing)
    clutter, patches = scatter(sites, town, layout, recipe, seed)
    if clutter:
        levels = terrain.sample([thing.x for thing in clutter], [thing.y for thing in clutter])
        for thing, level in zip(clutter, levels.tolist(), strict=True):
            thing.base = level
    trees = grow(terrain, layout, list(town.solids), recipe, seed)
    return World(recipe, seed, terrain, layout, Solids.of([*town.solids, *clutter]), trees, patch_table(patches))


class Relief(NamedTuple):
    """An elevation as kernels take it."""

    values: NDArray[np.float32]
    frame: Frame

    @classmethod
    def of(cls, elevation: Elevation) -> Relief:
        """Return the relief of an elevation."""
        return cls(elevation.values, elevation.grid.frame)


@kernel
def ground_at(relief: Relief, x: float, y: float) -> float:
    """Return the elevation at a place, bilinear, clamped at the border."""
    return float(bilinear_at(relief.values, relief.frame.west, relief.frame.north, relief.frame.gsd, x, y))


class CellLists(NamedTuple):
    """A `CellIndex` as kernels take it; `highest` is the highest elevation of any object."""

    start: NDArray[np.int64]
    items: NDArray[np.int32]
    top: NDArray[np.float64]
    highest: float
    columns: int
    rows: int


@dataclass(frozen=True)
class CellIndex:
    """Which objects touch which square cell of the extent: compressed rows, ``items[start[c]:start[c + 1]]``.

    Attributes
    ----------
    columns, rows : int
        Cells, row 0 in the south.
    start : ndarray of int64, shape (rows * columns + 1,)
    items : ndarray of int32
    top : ndarray of float64, shape (rows * columns,)
        Highest elevation of any object in the cell, -inf without one.
    """

    columns: int
    rows: int
    start: NDArray[np.int64]
    items: NDArray[np.int32]
    top: NDArray[np.float64]

    @property
    def lists(self) -> CellLists:
        """The index for kernels."""
        return CellLists(self.start, self.items, self.top, float(self.top.max()), self.columns, self.rows)

    @classmethod
    def of(cls, recipe: SceneParameters, boxes: NDArray[np.float64], top: NDArray[np.float64]) -> CellIndex:
        """Index objects by their boxes ``xmin, ymin, xmax, ymax``, shape (n, 4)."""
        columns, rows = int(recipe.width // _CELL) + 1, int(recipe.height // _CELL) + 1
        start, items, highest = _fill_cells(boxes, top, columns, rows)
        return cls(columns, rows, start, items, highest)

    @classmethod
    def of_solids(cls, world: World) -> CellIndex:
        """Index the solids."""
        solids = world.solids
        cosine, sine = np.abs(np.cos(solids.rectangle[:, 2])), np.abs(np.sin(solids.rectangle[:, 2]))
        long = solids.rectangle[:, 3] + np.abs(solids.slant) * solids.rectangle[:, 4]
        half_x = (long * cosine + solids.rectangle[:, 4] * sine) / 2
        half_y = (long * sine + solids.rectangle[:, 4] * cosine) / 2
        x, y = solids.rectangle[:, 0], solids.rectangle[:, 1]
        boxes = np.stack([x - half_x, y - half_y, x + half_x, y + half_y], axis=-1)
        return cls.of(world.recipe, boxes, solids.ridge)

    @classmethod
    def of_blobs(cls, world: World) -> CellIndex:
        """Index the blobs of the trees."""
        x, y, z, across, up = world.trees.blobs.T
        return cls.of(world.recipe, np.stack([x - across, y - across, x + across, y + across], axis=-1), z + up)


@kernel
def _fill_cells(
    boxes: NDArray[np.float64], top: NDArray[np.float64], columns: int, rows: int
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float64]]:
    start = np.zeros(rows * columns + 1, dtype=np.int64)
    highest = np.full(rows * columns, -np.inf)
    items = np.empty(0, dtype=np.int32)
    cursor = np.zeros(0, dtype=np.int64)
    for filling in (False, True):
        if filling:
            for cell in range(rows * columns):
                start[cell + 1] += start[cell]
            items = np.empty(start[-1], dtype=np.int32)
            cursor = start.copy()
        for k in range(len(boxes)):
            left = max(0, int((boxes[k, 0] - _REACH) // _CELL))
            right = min(columns - 1, int((boxes[k, 2] + _REACH) // _CELL))
            bottom = max(0, int((boxes[k, 1] - _REACH) // _CELL))
            upper = min(rows - 1, int((boxes[k, 3] + _REACH) // _CELL))
            for j in range(bottom, upper + 1):
                for i in range(left, right + 1):
                    cell = j * columns + i
                    if filling:
                        items[cursor[cell]] = k
                        cursor[cell] += 1
                        highest[cell] = max(highest[cell], top[k])
                    else:
                        start[cell + 1] += 1
    return start, items, highest
