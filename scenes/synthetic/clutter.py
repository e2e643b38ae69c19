"""Clutter: low objects between houses that disturb a height threshold, and the ground covers there.

Cars, hedges, fences, pools, small sheds and carports: none is in the reference, because each stays below 2.5 m or
10 m2. Ground *patches* (driveways, patios, pools, yards) have no height.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .buildings import Town
from .layout import HALLS, HOUSES, Layout
from .palettes import PALETTES, draw_colour, shaded
from .parcels import Parcel, Sites
from .recipe import SceneParameters
from .solids import Body, Roof, Solid, Texture
from .streams import Draws, stream
from .vegetation import nearest_rectangle, rectangle_table

__all__ = ["Cover", "Patch", "patch_table", "scatter"]

_HEDGE = PALETTES["leaves"]
_TIMBER = (0.50, 0.44, 0.37, 0.48)


class Cover(enum.IntEnum):
    """Ground covers; the numbers are the rows of `palettes.GROUND`."""

    ASPHALT = 0
    FOOTPATH = 1
    DRIVEWAY = 2
    GRAVEL = 3
    POOL = 4
    EARTH = 5
    PLAZA = 6
    STUBBLE = 7
    MAIZE = 8
    VINES = 9


@dataclass(frozen=True)
class Patch:
    """A rectangle of ground with a cover of its own; lengths in metres, angle in radians."""

    x: float
    y: float
    angle: float
    length: float
    width: float
    cover: Cover


def scatter(
    sites: Sites, town: Town, layout: Layout, recipe: SceneParameters, seed: int
) -> tuple[list[Solid], list[Patch]]:
    """Return the clutter of all parcels and streets, and the ground patches."""
    rows = stream(seed, "clutter").random((len(sites), 160))
    walls = [solid for solid in town.solids if solid.body == Body.BUILDING]
    garages: dict[int, list[Solid]] = {}
    for site, solid in town.garages:
        garages.setdefault(site, []).append(solid)
    solids: list[Solid] = []
    patches: list[Patch] = []
    for site in range(len(sites)):
        parcel = sites.parcel(site)
        draws = Draws(rows[site])
        zone = int(sites.zone[site])
        if zone == HOUSES:
            things, grounds = _garden(parcel, recipe, draws, garages.get(site, []), bool(town.built[site]))
        elif zone == HALLS:
            things, grounds = _yard(parcel, recipe, draws)
        else:
            things, grounds = _forecourt(parcel, recipe, draws, bool(town.built[site]))
        solids += things
        patches += grounds
    solids += _parked(layout, recipe, seed)
    inside = [solid for solid in solids if 1 < solid.x < recipe.width - 1 and 1 < solid.y < recipe.height - 1]
    return _clear_of_buildings(inside, walls), patches


def _clear_of_buildings(things: list[Solid], buildings: Sequence[Solid]) -> list[Solid]:
    """Return the objects outside all buildings, tested at points along their axis."""
    steps = [max(2, math.ceil(thing.length / 2) + 1) for thing in things]
    starts = np.cumsum([0, *steps])[:-1]
    x, y = np.empty(sum(steps)), np.empty(sum(steps))
    for thing, start, count in zip(things, starts.tolist(), steps, strict=True):
        along = (np.arange(count) / (count - 1) - 0.5) * thing.length
        x[start : start + count] = thing.x + math.cos(thing.angle) * along
        y[start : start + count] = thing.y + math.sin(thing.angle) * along
    distance = nearest_rectangle(x, y, rectangle_table(buildings))
    nearest = np.minimum.reduceat(distance, starts) if things else distance
    return [thing for thing, away in zip(things, nearest.tolist(), strict=True) if away >= thing.width / 2]


def _garden(
    parcel: Parcel, recipe: SceneParameters, draws: Draws, garages: list[Solid], built: bool
) -> tuple[list[Solid], list[Patch]]:
    things: list[Solid] = []
    grounds: list[Patch] = []
    factor = recipe.clutter
    half, deep = parcel.width / 2, parcel.depth / 2
    for side in (-1.0, 1.0):
        kind, high, tone = draws.unit(), draws.unit(), draws.unit()
        if kind < 0.22 * factor:
            colour = draw_colour(_HEDGE, tone, high, 0.5)
            things += _hedge(parcel, side * (half - 0.6), -deep + 3, deep - 0.5, 0.9 + 1.7 * high, colour)
        elif kind < 0.75 * factor and side > 0:
            things.append(_fence(parcel, side * half, (-deep + 6 + deep) / 2, 2 * deep - 6, across=True))
    back, tone, high = draws.unit(), draws.unit(), draws.unit()
    if back < 0.3 * factor:
        colour = draw_colour(_HEDGE, tone, high, 0.4)
        things.append(
            parcel.place(0, deep - 0.7, parcel.width - 1, 1.2, eave=1.1 + 1.9 * high, body=Body.HEDGE, colour=colour)
        )
    elif back < 0.8 * factor:
        things.append(_fence(parcel, 0, deep, parcel.width, across=False))
    if draws.chance(0.16 * factor):
        colour = draw_colour(_HEDGE, draws.unit(), draws.unit(), 0.6)
        things.append(
            parcel.place(
                -1.5, -deep + 0.7, parcel.width - 5, 0.9, eave=0.7 + 0.8 * draws.unit(), body=Body.HEDGE, colour=colour
            )
        )
    if not built:
        return things, grounds
    side = -1.0 if draws.chance(0.5) else 1.0
    drive = parcel.place(side * (half - 1.9), -deep / 2 + 1.5, 2.9, deep + 3.0)
    grounds.append(_patch(drive, Cover.DRIVEWAY if draws.chance(0.7) else Cover.GRAVEL))
    if draws.chance(0.5 * factor):
        things += _car(parcel, side * (half - 1.9), -deep + 2 + 6 * draws.unit(), math.pi / 2, draws)
    if draws.chance(0.14 * factor):
        things.append(
            parcel.place(
                side * (half - 1.9),
                -0.5,
                3.1,
                5.6,
                eave=2.25 + 0.2 * draws.unit(),
                body=Body.CARPORT,
                colour=draw_colour(PALETTES["halls"], draws.unit(), draws.unit(), 0.5),
            )
        )
    if draws.chance(0.13 * factor):
        pool = parcel.place(-side * half * 0.35, deep - 6.5, draws.between(5, 9), draws.between(3, 4.2))
        grounds.append(_patch(pool, Cover.FOOTPATH, grow=1.1))
        grounds.append(_patch(pool, Cover.POOL))
    if draws.chance(0.55):
        patio = parcel.place(side * 1.5, deep - draws.between(12, 17), draws.between(4, 8), draws.between(2.5, 4.5))
        grounds.append(_patch(patio, Cover.FOOTPATH if draws.chance(0.6) else Cover.EARTH))
    if draws.chance(0.35 * factor):
        wide, high = draws.between(1.8, 2.6), draws.between(1.8, 2.3)
        things.append(
            parcel.place(
                -side * (half - 1.0 - wide / 2),
                deep - 2.4,
                wide,
                draws.between(2.0, 3.4),
                eave=high,
                roof=Roof.GABLE,
                pitch=0.12,
                body=Body.CARPORT,
                colour=draw_colour(PALETTES["halls"], draws.unit(), draws.unit(), 0.4),
                texture=Texture.CORRUGATED,
            )
        )
    if draws.chance(0.4):
        bed = parcel.place(
            draws.between(-0.5, 0.5) * half, deep - draws.between(3, 9), draws.between(2, 5), draws.between(1, 3)
        )
        grounds.append(_patch(bed, Cover.EARTH))
    return things, grounds


def _yard(parcel: Parcel, recipe: SceneParameters, draws: Draws) -> tuple[list[Solid], list[Patch]]:
    things: list[Solid] = []
    ground = parcel.place(0, 0, parcel.width - 1.5, parcel.depth - 3)
    grounds = [_patch(ground, Cover.DRIVEWAY if draws.chance(0.6) else Cover.ASPHALT)]
    row = -parcel.depth / 2 + 5
    count = int((parcel.width - 6) / 2.7)
    for k in range(min(count, 18)):
        if draws.chance(0.5 * min(recipe.clutter, 1.6)):
            things += _car(parcel, -parcel.width / 2 + 4 + 2.7 * k, row, math.pi / 2, draws)
    return things, grounds


def _forecourt(parcel: Parcel, recipe: SceneParameters, draws: Draws, built: bool) -> tuple[list[Solid], list[Patch]]:
    ground = parcel.place(0, 0, parcel.width, parcel.depth)
    plaza, green = draws.unit(), draws.unit()
    things: list[Solid] = []
    if plaza < (0.85 if built else 0.15):
        return things, [_patch(ground, Cover.PLAZA)]
    if green < 0.35:
        return things, []
    # A car park: rows of cars across the parcel.
    for row in range(2):
        for k in range(min(int((parcel.width - 4) / 2.8), 14)):
            if draws.chance(0.5 * min(recipe.clutter, 2)):
                a, b = -parcel.width / 2 + 3 + 2.8 * k, (0.5 - row) * 0.6 * parcel.depth
                things += _car(parcel, a, b, math.pi / 2, draws)
    return things, [_patch(ground, Cover.ASPHALT)]


def _hedge(
    parcel: Parcel, a: float, start: float, end: float, high: float, colour: tuple[float, float, float, float]
) -> list[Solid]:
    """Return a hedge in pieces, so that a house in its way interrupts it."""
    pieces = max(1, round((end - start) / 5))
    long = (end - start) / pieces
    return [
        parcel.place(
            a,
            start + (k + 0.5) * long,
            1.1,
            long,
            eave=high * (0.92 + 0.16 * ((k * 7) % 5) / 5),
            body=Body.HEDGE,
            colour=colour,
        )
        for k in range(pieces)
    ]


def _fence(parcel: Parcel, a: float, b: float, long: float, *, across: bool) -> Solid:
    size = (0.12, long) if across else (long, 0.12)
    return parcel.place(a, b, *size, eave=1.7, body=Body.FENCE, colour=_TIMBER, wall=_TIMBER)


def _car(parcel: Parcel, a: float, b: float, turn: float, draws: Draws) -> list[Solid]:
    body = parcel.place(a, b, 1.8, 4.4)
    return car(body.x, body.y, body.angle + (turn - math.pi / 2), draws)


def car(x: float, y: float, angle: float, draws: Draws) -> list[Solid]:
    """Return a car: a low body and a cabin on it."""
    colour = draw_colour(PALETTES["cars"], draws.unit(), 0.5, 0.5)
    long, high = draws.between(4.0, 4.9), draws.between(1.35, 1.8)
    shift = -0.06 * long
    cabin = shaded(colour, 0.55)
    return [
        Solid(x, y, angle, long, 1.78, 0.9, body=Body.CAR, colour=colour, wall=colour),
        Solid(
            x + math.cos(angle) * shift,
            y + math.sin(angle) * shift,
            angle,
            long * 0.48,
            1.55,
            high,
            body=Body.CAR,
            colour=colour if draws.chance(0.6) else cabin,
            wall=(0.2, 0.22, 0.25, 0.2),
        ),
    ]


def _parked(layout: Layout, recipe: SceneParameters, seed: int) -> list[Solid]:
    """Return cars along the kerbs."""
    rng = stream(seed, "ground")
    count = round(recipe.hectares * 14)
    table = rng.random((count, 12))
    x, y = table[:, 0] * recipe.width, table[:, 1] * recipe.height
    u, v = layout.u.sample(x, y), layout.v.sample(x, y)
    period, origin, street = layout.pattern[0], layout.pattern[5], layout.pattern[2]
    side = np.where(table[:, 2] < 0.5, -1.0, 1.0)
    v = origin + np.round((v - origin) / period) * period + side * max(street / 2 - 4.6, 1.2)
    u = np.round(u / 6.0) * 6.0
    px, py = layout.to_world(u, v)
    qx, qy = layout.to_world(u + 1, v)
    things: list[Solid] = []
    taken: set[tuple[int, int]] = set()
    for k in range(count):
        spot = (round(float(u[k])), round(float(v[k])))
        if table[k, 3] < 0.55 * recipe.clutter and spot not in taken:
            taken.add(spot)
            angle = math.atan2(qy[k] - py[k], qx[k] - px[k])
            things += car(float(px[k]), float(py[k]), angle, Draws(table[k, 4:]))
    return things


def _patch(solid: Solid, cover: Cover, grow: float = 0.0) -> Patch:
    return Patch(solid.x, solid.y, solid.angle, solid.length + 2 * grow, solid.width + 2 * grow, cover)


def patch_table(patches: list[Patch]) -> NDArray[np.float64]:
    """Return patches as rows x, y, angle, length, width, cover."""
    return np.array([(p.x, p.y, p.angle, p.length, p.width, p.cover) for p in patches], dtype=np.float64).reshape(-1, 6)
