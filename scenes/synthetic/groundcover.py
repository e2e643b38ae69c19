"""Ground cover: streets, footpaths, verges, lawns and the patches of gardens and yards, as codes on a raster.

Codes below 16 are rows of `palettes.GROUND` (see `clutter.Cover`); codes from 64 are grass, and their lower six bits
are its dryness, which differs from parcel to parcel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ..geodata.raster import Frame, Grid
from ..geodata.sampling import bilinear_at
from .clutter import Cover
from .layout import FIELDS, HALLS, PARK, TOWERS, zone_of
from .parcels import HALL_WIDTH
from .streams import uniform
from .world import World

__all__ = ["GRASS", "cover_codes"]

GRASS = 64
_ASPHALT, _FOOTPATH, _EARTH, _PLAZA = map(int, (Cover.ASPHALT, Cover.FOOTPATH, Cover.EARTH, Cover.PLAZA))
_GRAVEL, _STUBBLE, _MAIZE, _VINES = map(int, (Cover.GRAVEL, Cover.STUBBLE, Cover.MAIZE, Cover.VINES))


def cover_codes(world: World, grid: Grid) -> NDArray[np.uint8]:
    """Return the ground cover on a grid in local coordinates, shape (rows, columns)."""
    layout = world.layout
    codes = np.empty(grid.shape, dtype=np.uint8)
    _streets(
        codes,
        grid.frame,
        _Streets(
            layout.u.values,
            layout.v.values,
            layout.u.grid.frame,
            layout.pattern,
            layout.key,
            layout.zones,
            np.array(layout.first),
        ),
        world.recipe.dryness,
    )
    _patches(codes, grid.frame, world.patches)
    return codes


class _Streets(NamedTuple):
    """A `Layout` as kernels take it: `u` and `v` on the raster `frame`."""

    u: NDArray[np.float32]
    v: NDArray[np.float32]
    frame: Frame
    pattern: NDArray[np.float64]
    key: np.uint64
    zones: NDArray[np.uint8]
    first: NDArray[np.int64]


@kernel
def _streets(codes: NDArray[np.uint8], frame: Frame, streets: _Streets, dryness: float) -> None:
    """Fill the codes of streets, parcels and fields."""
    west, north, gsd, _, _ = frame
    u, v, raster, pattern, key, zones, first = streets
    period, length, street, cross = pattern[0], pattern[1], pattern[2], pattern[3]
    line = np.empty((2, u.shape[1]))
    known, offset = 1 << 30, 0.0
    lot, grass = -1, 0
    for r in range(codes.shape[0]):
        # Interpolated down once a row, then across for every cell.
        y = north - (r + 0.5) * gsd
        for k in range(u.shape[1]):
            x = raster.west + (k + 0.5) * raster.gsd
            line[0, k] = bilinear_at(u, raster.west, raster.north, raster.gsd, x, y)
            line[1, k] = bilinear_at(v, raster.west, raster.north, raster.gsd, x, y)
        for c in range(codes.shape[1]):
            position = (west + (c + 0.5) * gsd - raster.west) / raster.gsd - 0.5
            k = int(position)
            right = position - k
            pu = line[0, k] + (line[0, k + 1] - line[0, k]) * right
            pv = line[1, k] + (line[1, k + 1] - line[1, k]) * right
            row = math.floor((pv - pattern[5]) / period)
            if row != known:
                # Its stagger is the same all along a row, and hashing is slow.
                known, offset = row, pattern[4] + pattern[6] * uniform(key, row) * length
            block = math.floor((pu - offset) / length)
            along, across = pu - offset - block * length, pv - pattern[5] - row * period
            zone = zone_of(block, row, zones, first)
            main = street / 2 - min(across, period - across)  # depth into the street, negative on parcels
            side = cross / 2 - min(along, length - along)
            if (main > 0 or side > 0) and zone == FIELDS:
                # A road where houses stand on its other side, a track where fields lie on both.
                beyond = zone_of(block, row + (1 if across > period / 2 else -1), zones, first) if main > 0 else FIELDS
                if beyond == FIELDS:
                    main, side = main - street / 2 + 1.6, side - cross / 2 + 1.6
                    if main > 0 or side > 0:
                        codes[r, c] = _GRAVEL
                    else:
                        codes[r, c] = _field_code(block, row, along, across, pattern, key)
                else:
                    codes[r, c] = _street_code(main, street, side, cross, zone)
            elif main > 0 or side > 0:
                codes[r, c] = _street_code(main, street, side, cross, zone)
            elif zone == FIELDS:
                codes[r, c] = _field_code(block, row, along, across, pattern, key)
            else:
                number = _parcel_number(block, row, along, across, pattern, zone)
                if number != lot:
                    lot, grass = number, _parcel_code(number, key, zone, dryness)
                codes[r, c] = grass


@kernel
def _street_code(main: float, street: float, side: float, cross: float, zone: int) -> int:
    """Cross section from the parcel front: footpath, verge, carriageway; downtown has wide pavements instead."""
    pavement = 4.0 if zone == TOWERS else 3.4
    road = main > min(pavement, street * 0.28) or side > min(pavement, cross * 0.28)
    if road:
        return _ASPHALT
    depth = max(main, side)
    if zone == TOWERS or depth < 0.2 or (0.5 < depth < 1.7):
        return _FOOTPATH if zone != TOWERS else _PLAZA
    return GRASS + 22


@kernel
def _parcel_number(block: int, row: int, along: float, across: float, pattern: NDArray[np.float64], zone: int) -> int:
    """Return a number of the parcel that differs from those of nearby parcels; a park is one parcel."""
    usable = pattern[1] - pattern[3]
    wide = pattern[7] * (HALL_WIDTH if zone == HALLS else 1.0)
    count = max(1, round(usable / wide))
    lot = int((along - pattern[3] / 2) / usable * count)
    half = 0 if across < pattern[0] / 2 or zone == HALLS else 1
    if zone == PARK:
        lot, half = 0, 0
    return ((block & 0xFFFF) << 32) | ((row & 0xFFFF) << 16) | ((lot & 0xFF) << 1) | half


@kernel
def _parcel_code(number: int, key: int, zone: int, dryness: float) -> int:
    """Grass of a parcel, drier on some; earth on a few."""
    draw, bare = uniform(key, number), uniform(key, number + (1 << 60))
    if bare < 0.05 and zone != PARK:
        return _EARTH
    dry = min(max(dryness + (draw - 0.5) * 0.9, 0.0), 1.0)
    return GRASS + int(dry * 63)


@kernel
def _field_code(block: int, row: int, along: float, across: float, pattern: NDArray[np.float64], key: int) -> int:
    """Crop of a field: strips of a block are meadow, stubble, ploughed, maize or vines."""
    strip = int(across / pattern[0] * 3.0) if uniform(key, block * 31 + row) < 0.5 else int(along / pattern[1] * 3.0)
    draw = uniform(key, (1 << 50) + block * 7919 + row * 104729 + strip)
    if draw < 0.5:
        return GRASS + 6 + int(draw * 50)
    return _STUBBLE if draw < 0.68 else _EARTH if draw < 0.8 else _MAIZE if draw < 0.92 else _VINES


@kernel
def _patches(codes: NDArray[np.uint8], frame: Frame, patches: NDArray[np.float64]) -> None:
    """Overwrite the codes inside the rectangles of the patches."""
    west, north, gsd, _, _ = frame
    for k in range(len(patches)):
        x0, y0, angle, length, width, code = patches[k]
        cosine, sine = math.cos(angle), math.sin(angle)
        reach_x = (abs(cosine) * length + abs(sine) * width) / 2
        reach_y = (abs(sine) * length + abs(cosine) * width) / 2
        for r in range(
            max(0, int((north - y0 - reach_y) / gsd)), min(codes.shape[0], int((north - y0 + reach_y) / gsd) + 1)
        ):
            dy = north - (r + 0.5) * gsd - y0
            for c in range(
                max(0, int((x0 - reach_x - west) / gsd)), min(codes.shape[1], int((x0 + reach_x - west) / gsd) + 1)
            ):
                dx = west + (c + 0.5) * gsd - x0
                if abs(cosine * dx + sine * dy) <= length / 2 and abs(cosine * dy - sine * dx) <= width / 2:
                    codes[r, c] = int(code)
