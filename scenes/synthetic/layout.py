"""Streets, blocks and zones: the pattern that parcels, ground cover and trees follow.

Nouns
-----
layout coordinates
    u along the streets, v across them, metres. World coordinates turned by the orientation and bent by smooth noise
    (`winding`), so that straight streets in (u, v) wind in (x, y). Stored on a coarse raster, interpolated between.
row, block
    Street centre lines lie at v = j * period; a row is what lies between two of them and is cut into blocks by cross
    streets, whose position differs from row to row (*stagger*). A block holds two rows of parcels back to back.
zone
    What a block is used for: houses, halls (industry), towers (downtown), park, or fields around a village.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ..geodata.raster import Elevation, Grid
from .recipe import SceneParameters
from .streams import counter_key, fractal_field, stream, uniform

__all__ = ["FIELDS", "HALLS", "HOUSES", "PARK", "TOWERS", "Layout", "locate", "plan_layout", "zone_of"]

HOUSES, HALLS, TOWERS, PARK, FIELDS = 0, 1, 2, 3, 4
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

    def block_start(self, i: int, j: int) -> tuple[float, float]:
        """Return the layout coordinates of the lower corner of block ``zones[i, j]``, street axes included."""
        row = self.first[1] + j
        shift = float(self.pattern[6] * uniform(self.key, row) * self.pattern[1])
        u = float(self.pattern[4]) + shift + (self.first[0] + i) * float(self.pattern[1])
        return u, float(self.pattern[5] + row * self.pattern[0])

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


@kernel
def locate(u: float, v: float, pattern: NDArray[np.float64], key: int) -> tuple[int, int, float, float]:
    """Return block number, row number, and the position in the block: along from its start, across from its street."""
    row = math.floor((v - pattern[5]) / pattern[0])
    across = v - pattern[5] - row * pattern[0]
    shifted = u - pattern[4] - pattern[6] * uniform(key, row) * pattern[1]
    block = math.floor(shifted / pattern[1])
    return int(block), int(row), shifted - block * pattern[1], across


@kernel
def zone_of(block: int, row: int, zones: NDArray[np.uint8], first: NDArray[np.int64]) -> int:
    """Return the zone of a block; blocks beyond the table are like the nearest in it."""
    i = min(max(block - first[0], 0), zones.shape[0] - 1)
    j = min(max(row - first[1], 0), zones.shape[1] - 1)
    return int(zones[i, j])


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
    u = Elevation(cosine * x + sine * y + bend[0], grid)  # type: ignore[arg-type]
    v = Elevation(-sine * x + cosine * y + bend[1], grid)  # type: ignore[arg-type]
    # A street of houses, or a block of towers, lies about the centre: small extents hold as many parcels with any seed.
    downtown = recipe.zone == "towers"
    origin_v = float(v.sample(recipe.width / 2, recipe.height / 2)) + 0.16 * (phase[1] - 0.5) * period
    origin_u = phase[0] * block
    if downtown:
        origin_v -= period / 2
        origin_u = float(u.sample(recipe.width / 2, recipe.height / 2)) + (0.16 * phase[0] - 0.58) * block
    pattern = np.array(
        (
            *(period, block, recipe.street_width, recipe.street_width * (1.0 if downtown else 0.75)),
            *(origin_u, origin_v, 0.0 if downtown else 1.0, recipe.parcel_width, cosine, sine),
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
    unused = np.zeros(shape, dtype=np.uint8)
    layout = Layout(u, v, pattern, counter_key(seed, "streets"), unused, first)
    return replace(layout, zones=_zones(layout, recipe, seed))


def _zones(layout: Layout, recipe: SceneParameters, seed: int) -> NDArray[np.uint8]:
    """Industry gathers on one side of the scene, fields lie around a village, parks anywhere."""
    rng = stream(seed, "zones")
    shape = layout.zones.shape
    direction, core = rng.random(2) - 0.5, 0.35 + 0.3 * rng.random(2)
    noise, park = rng.random(shape), rng.random(shape)
    starts = np.array([[layout.block_start(i, j) for j in range(shape[1])] for i in range(shape[0])])
    half = layout.pattern[1] / 2, layout.pattern[0] / 2
    x, y = layout.to_world(starts[..., 0] + half[0], starts[..., 1] + half[1])
    x, y = x / recipe.width, y / recipe.height
    area = _areas(layout, recipe)
    towards = (x * direction[0] + y * direction[1]) / np.hypot(*direction) + 0.12 * noise
    # A block cut by the border shows no hall: prefer whole ones.
    towards += 10.0 * (area < 0.7 * layout.pattern[0] * layout.pattern[1])
    away = np.hypot(x - core[0], y - core[1]) + 0.10 * noise
    zones = np.full(shape, TOWERS if recipe.zone == "towers" else HOUSES, dtype=np.uint8)
    zones[_lowest(park, area, recipe.park_share)] = PARK
    zones[_lowest(towards, area, recipe.hall_share)] = HALLS
    zones[_lowest(-away, area, recipe.open_share)] = FIELDS
    return zones


def _areas(layout: Layout, recipe: SceneParameters) -> NDArray[np.float64]:
    """Return the area of each block inside the extent, m2, counted in cells of the raster."""
    grid = layout.u.grid
    x, y = grid.to_world(np.arange(grid.rows)[:, None] + 0.5, np.arange(grid.columns)[None, :] + 0.5)
    inside = (x > 0) & (x < recipe.width) & (y > 0) & (y < recipe.height)
    area = np.zeros(layout.zones.shape)
    for u, v in zip(layout.u.values[inside].tolist(), layout.v.values[inside].tolist(), strict=True):
        block, row, _, _ = locate(u, v, layout.pattern, layout.key)
        area[block - layout.first[0], row - layout.first[1]] += _CELL**2
    return area


def _lowest(values: NDArray[np.float64], area: NDArray[np.float64], share: float) -> NDArray[np.bool_]:
    """Return the blocks of lowest values, as many as come nearest to a share of the extent."""
    order = np.argsort(values, axis=None, kind="stable")
    covered = np.concatenate([[0.0], np.cumsum(area.ravel()[order])])
    count = int(np.argmin(np.abs(covered - share * covered[-1])))
    chosen = np.zeros(values.size, dtype=bool)
    chosen[order[:count]] = True
    return chosen.reshape(values.shape)
