"""Streets, blocks and parcels: where buildings may stand and which way they look.

Nouns
-----
layout coordinates
    u along the streets, v across them, metres. World coordinates turned by the orientation and bent by smooth noise
    (`winding`), so that straight streets in (u, v) wind in (x, y). Stored on a coarse raster, interpolated between.
row, block
    Street centre lines lie at v = j * period; a row is what lies between two of them and is cut into blocks by cross
    streets, whose position differs from row to row (*stagger*). A block holds two rows of parcels back to back.
site
    A parcel on which one house, hall or tower may stand; its *front* faces the street.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..raster import Elevation, Grid
from .recipe import SceneParameters
from .streams import counter_key, fractal_field, stream, uniform

__all__ = ["HALLS", "HOUSES", "PARK", "TOWERS", "Layout", "Sites", "locate", "plan_layout", "plan_sites"]

HOUSES, HALLS, TOWERS, PARK = 0, 1, 2, 3
_CELL = 4.0
_MARGIN = 80.0


@dataclass(frozen=True)
class Layout:
    """The street pattern.

    Attributes
    ----------
    u, v : Elevation
        Layout coordinates on a raster in local world coordinates.
    pattern : ndarray of float64, shape (10,)
        Row period, block period, street width, cross street width, u and v of the origin, stagger, parcel width,
        cosine and sine of the orientation.
    key : int
        Of the counter noise that staggers rows and colours parcels.
    zones : ndarray of uint8, shape (blocks along u, rows)
    first : tuple of int
        Block number and row number of ``zones[0, 0]``.
    """

    u: Elevation
    v: Elevation
    pattern: NDArray[np.float64]
    key: np.uint64
    zones: NDArray[np.uint8]
    first: tuple[int, int]

    def to_world(
        self, u: NDArray[np.float64], v: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Invert the layout coordinates by fixed-point iteration (the bending is gentle, so it converges)."""
        grid = self.u.grid
        x = np.full(u.shape, grid.west + grid.columns * grid.gsd / 2)
        y = np.full(u.shape, grid.north - grid.rows * grid.gsd / 2)
        cosine, sine = self._turn
        for _ in range(30):
            du, dv = u - self._extended(self.u, x, y, 0), v - self._extended(self.v, x, y, 1)
            x, y = x + cosine * du - sine * dv, y + sine * du + cosine * dv
        return x, y

    @property
    def _turn(self) -> tuple[float, float]:
        return float(self.pattern[8]), float(self.pattern[9])

    def _extended(
        self, raster: Elevation, x: NDArray[np.float64], y: NDArray[np.float64], axis: int
    ) -> NDArray[np.float64]:
        """Sample with linear continuation beyond the raster, so that the iteration cannot get stuck at its border."""
        west, south, east, north = raster.grid.extent
        half = raster.grid.gsd / 2
        inside_x, inside_y = np.clip(x, west + half, east - half), np.clip(y, south + half, north - half)
        cosine, sine = self._turn
        along = (cosine, sine) if axis == 0 else (-sine, cosine)
        return raster.sample(inside_x, inside_y) + along[0] * (x - inside_x) + along[1] * (y - inside_y)


@dataclass(frozen=True)
class Sites:
    """Parcels, one row each.

    Attributes
    ----------
    x, y : ndarray, shape (n,)
        Centre, local world coordinates, metres.
    angle : ndarray, shape (n,)
        Direction of the street, radians from east.
    facing : ndarray, shape (n,)
        +1 when the back lies to the left of the street direction, -1 when to the right.
    width, depth : ndarray, shape (n,)
        Along and across the street, metres.
    zone : ndarray of uint8, shape (n,)
    mark : ndarray, shape (n,)
        Order in which sites are built on, ascending.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    angle: NDArray[np.float64]
    facing: NDArray[np.float64]
    width: NDArray[np.float64]
    depth: NDArray[np.float64]
    zone: NDArray[np.uint8]
    mark: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.x)


@njit(cache=True)
def locate(u: float, v: float, pattern: NDArray[np.float64], key: int) -> tuple[int, int, float, float]:
    """Return block number, row number, and the position in the block: along from its start, across from its street."""
    row = math.floor((v - pattern[5]) / pattern[0])
    across = v - pattern[5] - row * pattern[0]
    shifted = u - pattern[4] - pattern[6] * uniform(key, row) * pattern[1]
    block = math.floor(shifted / pattern[1])
    return int(block), int(row), shifted - block * pattern[1], across


def plan_layout(recipe: SceneParameters, seed: int) -> Layout:
    """Lay out streets and blocks and give each block its zone."""
    rng = stream(seed, "streets")
    grid = Grid.covering((-_MARGIN, -_MARGIN, recipe.width + _MARGIN, recipe.height + _MARGIN), _CELL)
    x, y = grid.to_world(np.arange(grid.rows)[:, None] + 0.5, np.arange(grid.columns)[None, :] + 0.5)
    angle = math.radians(recipe.orientation + (rng.random() - 0.5) * 6)
    cosine, sine = math.cos(angle), math.sin(angle)
    phase = rng.random(2)
    bend = [fractal_field(rng, grid.shape, _CELL, (190.0, 95.0), 0.25) * recipe.winding for _ in range(2)]
    period, block = 2 * recipe.parcel_depth + recipe.street_width, recipe.block_length + recipe.street_width
    stagger = 0.0 if recipe.zone == "towers" else 1.0
    u = Elevation(cosine * x + sine * y + bend[0], grid)  # type: ignore[arg-type]
    v = Elevation(-sine * x + cosine * y + bend[1], grid)  # type: ignore[arg-type]
    # A street passes near the centre, so that small extents hold about as many parcels with any seed.
    middle = float(v.sample(recipe.width / 2, recipe.height / 2)) + 0.16 * (phase[1] - 0.5) * period
    pattern = np.array(
        (
            *(period, block, recipe.street_width, recipe.street_width * (0.75 if stagger else 1.0)),
            *(phase[0] * block, middle, stagger, recipe.parcel_width, cosine, sine),
        )
    )
    first = (
        math.floor((u.values.min() - pattern[4]) / block) - 2,
        math.floor((v.values.min() - pattern[5]) / period) - 1,
    )
    shape = (
        math.floor((u.values.max() - pattern[4]) / block) - first[0] + 2,
        math.floor((v.values.max() - pattern[5]) / period) - first[1] + 2,
    )
    return Layout(u, v, pattern, counter_key(seed, "streets"), _zones(recipe, seed, shape), first)


def _zones(recipe: SceneParameters, seed: int, shape: tuple[int, int]) -> NDArray[np.uint8]:
    """Industry gathers on one side of the scene; parks lie anywhere."""
    rng = stream(seed, "zones")
    direction = rng.random(2) - 0.5
    i, j = np.indices(shape)
    towards = i / max(shape[0], 1) * direction[0] + j / max(shape[1], 1) * direction[1]
    pull = _ranks(towards / np.hypot(*direction) + 0.25 * rng.random(shape))
    park = rng.random(shape) < recipe.park_share
    built = TOWERS if recipe.zone == "towers" else HOUSES
    zones = np.where(pull < recipe.hall_share, HALLS, built)
    return np.where(park & (zones != HALLS), PARK, zones).astype(np.uint8)


def _ranks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    order = np.argsort(values, axis=None, kind="stable")
    ranks = np.empty(values.size)
    ranks[order] = np.arange(values.size) / values.size
    return ranks.reshape(values.shape)


def plan_sites(layout: Layout, recipe: SceneParameters, seed: int) -> Sites:
    """List the parcels whose centre lies in the extent, in a fixed order."""
    columns: list[tuple[float, ...]] = []
    period, block, street, cross = layout.pattern[:4]
    depth = (period - street) / 2
    usable = block - cross
    for i in range(layout.zones.shape[0]):
        for j in range(layout.zones.shape[1]):
            zone = int(layout.zones[i, j])
            if zone == PARK:
                continue
            row = layout.first[1] + j
            start = layout.pattern[4] + layout.pattern[6] * uniform(layout.key, row) * block
            start += (layout.first[0] + i) * block + cross / 2
            front = layout.pattern[5] + row * period + street / 2
            wide = recipe.parcel_width * (3.2 if zone == HALLS else 1.0)
            count = max(1, round(usable / wide))
            # A hall's parcel reaches from street to street, others lie back to back.
            rows = (
                ((depth, 1.0, 2 * depth),) if zone == HALLS else ((depth / 2, 1.0, depth), (depth * 1.5, -1.0, depth))
            )
            for across, facing, deep in rows:
                for lot in range(count):
                    centre = start + (lot + 0.5) * usable / count
                    columns.append((centre, front + across, facing, usable / count, deep, zone))
    table = np.array(columns, dtype=np.float64).reshape(-1, 6)
    x, y = layout.to_world(table[:, 0], table[:, 1])
    ahead_x, ahead_y = layout.to_world(table[:, 0] + 1.0, table[:, 1])
    mark = _marks(recipe, seed, x, y)
    inside = (x > 0) & (x < recipe.width) & (y > 0) & (y < recipe.height)
    return Sites(
        x=x[inside],
        y=y[inside],
        angle=np.arctan2(ahead_y - y, ahead_x - x)[inside],
        facing=table[inside, 2],
        width=table[inside, 3],
        depth=table[inside, 4],
        zone=table[inside, 5].astype(np.uint8),
        mark=mark[inside],
    )


def _marks(recipe: SceneParameters, seed: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Order of building: at random in a suburb; a village fills up from its core, with ragged edges."""
    rng = stream(seed, "sites")
    mark = rng.random(len(x))
    if recipe.zone == "village":
        centre = (0.35 + 0.3 * rng.random(2)) * (recipe.width, recipe.height)
        away = np.hypot(x - centre[0], y - centre[1]) / np.hypot(recipe.width, recipe.height)
        mark = away + 0.22 * mark
    return mark
