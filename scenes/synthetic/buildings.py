"""Houses, halls and towers on their parcels, put together from rectangles that overlap as the papers' references do.

Parcel coordinates: a along the street, b from the front towards the back, metres, origin in the parcel's centre.
Every parcel has its own row of random draws, so that a knob changes what it names and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError
from ..raster import Elevation
from .layout import HALLS, TOWERS
from .palettes import PALETTES, draw_colour
from .parcels import Sites
from .recipe import SceneParameters
from .roofscape import furnish
from .solids import Roof, Solid, Texture
from .streams import stream

__all__ = ["Draws", "Town", "build"]

_DRAWS = 96
#: Least area and height of what the reference holds (Awrangjeb et al. 2010, section 4.3).
SMALLEST, LOWEST = 10.0, 2.5


class Draws:
    """Uniform random numbers of one parcel, taken one after the other."""

    def __init__(self, row: NDArray[np.float64]) -> None:
        self._numbers: Iterator[float] = iter(row.tolist())

    def unit(self) -> float:
        """Return the next number in [0, 1)."""
        return next(self._numbers)

    def between(self, low: float, high: float) -> float:
        """Return a number between two bounds."""
        return low + (high - low) * self.unit()

    def chance(self, share: float) -> bool:
        """Return whether an event of this probability happens."""
        return self.unit() < share

    def normal(self) -> float:
        """Return a nearly normal number: the sum of four uniforms, at most 3.46."""
        return (self.unit() + self.unit() + self.unit() + self.unit() - 2) * 1.7320508


@dataclass(frozen=True)
class Parcel:
    """A site's frame.

    Attributes
    ----------
    x, y, angle, facing : float
        As in `parcels.Sites`.
    width, depth : float
        Metres.
    """

    x: float
    y: float
    angle: float
    facing: float
    width: float
    depth: float

    def place(self, a: float, b: float, along: float, deep: float, turn: float = 0.0, **more: object) -> Solid:
        """Return a solid over a rectangle given in parcel coordinates; its ridge runs along the longer side.

        `turn` is an extra rotation of the whole building about the parcel's centre, radians.
        """
        b *= self.facing
        angle = self.angle + turn
        cosine, sine = math.cos(angle), math.sin(angle)
        x, y = self.x + cosine * a - sine * b, self.y + sine * a + cosine * b
        if deep > along:
            angle, along, deep = angle + math.pi / 2, deep, along
        return Solid(x, y, angle, along, deep, **more)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Town:
    """What was built.

    Attributes
    ----------
    solids : tuple of Solid
        Parts of buildings and their roof furniture; `Solid.owner` is the building number.
    built : ndarray of bool, shape (sites,)
        Which sites carry a building.
    garages : tuple of Solid
        Outbuildings that a driveway leads to.
    """

    solids: tuple[Solid, ...]
    built: NDArray[np.bool_]
    garages: tuple[tuple[int, Solid], ...]


def build(sites: Sites, terrain: Elevation, recipe: SceneParameters, seed: int) -> Town:
    """Build exactly ``recipe.buildings`` buildings, sites in the order of their mark.

    Raises
    ------
    ParameterError
        When the parcels of this extent cannot hold that many.
    """
    shapes = stream(seed, "buildings").random((len(sites), _DRAWS))
    colours = stream(seed, "colours").random((len(sites), 24))
    greens = stream(seed, "green-roofs").random((len(sites), 8))
    roofs = stream(seed, "roofs").random((len(sites), _DRAWS * 2))
    solids: list[Solid] = []
    garages: list[tuple[int, Solid]] = []
    built = np.zeros(len(sites), dtype=bool)
    number = 0
    for site in np.argsort(sites.mark, kind="stable"):
        if number == recipe.buildings:
            break
        parcel = Parcel(
            *(float(column[site]) for column in (sites.x, sites.y, sites.angle, sites.facing, sites.width, sites.depth))
        )
        draws = Draws(shapes[site])
        zone = int(sites.zone[site])
        compose = {HALLS: _hall, TOWERS: _tower}.get(zone, _house)
        groups = compose(parcel, recipe, draws)
        # Without its house a parcel has no garage either.
        if not groups or not all(_inside(part, recipe) for part in groups[0]):
            continue
        groups = [group for group in groups if all(_inside(part, recipe) for part in group)]
        built[site] = True
        for rank, group in enumerate(groups[: recipe.buildings - number]):
            _paint(group, rank, zone, recipe, Draws(colours[site][rank * 6 :]), Draws(greens[site][rank * 2 :]))
            floor = float(terrain.sample(group[0].x, group[0].y))
            furniture = furnish(group, zone, Draws(roofs[site][rank * 48 :])) if rank == 0 else []
            for solid in (*group, *furniture):
                solid.owner, solid.base = number, floor
                solids.append(solid)
            if rank:
                garages.append((int(site), group[0]))
            number += 1
    if number < recipe.buildings:
        raise ParameterError(
            f"buildings must be at most {number} on {recipe.width:g} x {recipe.height:g} m with parcels of "
            f"{recipe.parcel_width:g} x {recipe.parcel_depth:g} m, not {recipe.buildings}: "
            "widen the extent, narrow the parcels or ask for fewer buildings"
        )
    return Town(tuple(solids), built, tuple(garages))


def _inside(solid: Solid, recipe: SceneParameters) -> bool:
    corners = solid.corners()
    low, high = corners.min(axis=0), corners.max(axis=0)
    return bool(low.min() > 0.3 and high[0] < recipe.width - 0.3 and high[1] < recipe.height - 0.3)


def _pitched(draws: Draws, recipe: SceneParameters) -> tuple[Roof, float]:
    """Draw a house's roof kind and the tangent of its pitch."""
    flat, gable, shape = draws.unit(), draws.unit(), draws.normal()
    if flat < recipe.flat_roofs:
        return (Roof.FLAT, 0.0) if gable < 0.6 else (Roof.SHED, math.tan(math.radians(4 + 8 * draws.unit())))
    pitch = math.radians(min(max(recipe.roof_pitch * (1 + 0.12 * shape), 4), 62))
    return (Roof.GABLE if gable < recipe.gable_roofs else Roof.HIP), math.tan(pitch)


def _house(parcel: Parcel, recipe: SceneParameters, draws: Draws) -> list[list[Solid]]:
    """Compose a house of one to three rectangles, and the outbuildings behind it."""
    size = recipe.building_size
    left, right = (max(0.3, recipe.gap / 2 * draws.between(0.6, 1.4)) for _ in range(2))
    drive = draws.chance(0.55) * draws.between(1.6, 2.8)
    room = parcel.width - left - right - drive
    width = min(room, draws.between(9.0, 14.5)) * min(size, room / max(room * 0.8, 1e-9))
    width = max(min(width, room), 5.0)
    deep = min(draws.between(9.0, 15.0) * size, parcel.depth - recipe.setback - 6)
    deep = max(deep, 6.0)
    slack = max(room - width, 0.0)
    mirror = 1.0 if draws.chance(0.5) else -1.0
    a = mirror * (-parcel.width / 2 + left + width / 2 + slack * draws.unit() * 0.5)
    front = -parcel.depth / 2 + recipe.setback * draws.between(0.8, 1.25)
    turn = math.radians(recipe.orientation_spread) * draws.normal()
    kind, pitch = _pitched(draws, recipe)
    storeys = 2 if draws.chance(recipe.two_storeys) else 1
    eave = recipe.storey_height * storeys * draws.between(0.94, 1.06)
    more = {"turn": turn, "eave": eave, "roof": kind, "pitch": pitch}
    shape, swing, reach = draws.unit(), draws.unit(), draws.between(0.4, 0.75)
    back = max(0.0, min(parcel.depth / 2 - 5 - (front + deep), 8.0))
    group: list[Solid] = []
    if shape < 0.34 or back < 2.5:
        group.append(parcel.place(a, front + deep / 2, width, deep, **more))
    else:
        # The body lies across the parcel; wings start at its middle, so their roofs and rectangles overlap.
        body = max(min(deep * 0.72, 9.5), 6.0)
        middle = front + (deep - body) * 0.5 + body / 2
        group.append(parcel.place(a, middle, width, body, **more))
        wing = max(width * draws.between(0.38, 0.52), 4.2)
        length = body / 2 + min(back, deep * reach)
        aside = (width - wing) / 2
        step = 0.12 * draws.unit()
        lower = {**more, "eave": eave - step}
        sides = (mirror,) if shape < 0.62 else (0.0,) if shape < 0.74 else (-1.0, 1.0)
        towards = 1.0 if swing < 0.72 or recipe.setback < 5 else -1.0
        if len(sides) == 2 and wing * 2 > width - 2:
            wing = max((width - 2.5) / 2, 3.2)
            aside = (width - wing) / 2
        for rank, side in enumerate(sides):
            this = length * (1.0 if rank == 0 or shape > 0.87 else 0.7)
            if towards < 0:
                this = min(this, body / 2 + recipe.setback * 0.55)
            group.append(parcel.place(a + side * aside, middle + towards * this / 2, wing, this, **lower))
    groups = [group]
    rear = max(float(_deepest(parcel, part)) for part in group)
    count = recipe.outbuildings
    for rank in range(2):
        wanted, car, corner = draws.chance(count - rank), draws.chance(0.62 if rank == 0 else 0.3), draws.unit()
        wide = draws.between(3.0, 3.9) if car else draws.between(3.2, 4.4)
        long = draws.between(5.6, 7.4) if car else draws.between(3.4, 5.2)
        high, top, rise = draws.between(2.55, 2.95), draws.unit(), draws.between(0.05, 0.35)
        if not wanted:
            continue
        wide, long = wide * max(size, 1.0), max(long * max(size, 1.0), SMALLEST / wide + 0.05)
        side = -mirror if car or corner < 0.5 else mirror
        side = -side if rank else side
        place_b = min(rear + 1.5 + 4 * corner * (not car), parcel.depth / 2 - 0.8 - long) + long / 2
        if place_b - long / 2 < rear + 0.7:
            continue
        roof = Roof.FLAT if top < 0.3 else Roof.SHED if top < 0.5 else Roof.GABLE
        shed = parcel.place(
            side * (parcel.width / 2 - 0.5 - wide / 2),
            place_b,
            wide,
            long,
            eave=high,
            roof=roof,
            pitch=0.0 if roof == Roof.FLAT else rise * (0.3 if roof == Roof.SHED else 1.0),
        )
        groups.append([shed])
    return groups


def _deepest(parcel: Parcel, part: Solid) -> float:
    """Return the greatest b of a part's corners."""
    offset = part.corners() - (parcel.x, parcel.y)
    b = (-math.sin(parcel.angle) * offset[:, 0] + math.cos(parcel.angle) * offset[:, 1]) * parcel.facing
    return float(b.max())


def _hall(parcel: Parcel, recipe: SceneParameters, draws: Draws) -> list[list[Solid]]:
    """Compose an industrial hall, often with an annex or an office in front, and sometimes a second hall."""
    size = recipe.building_size
    width = min((parcel.width - draws.between(5, 14)) * min(size, 1.15), 75)
    deep = min((parcel.depth - draws.between(12, 26)) * min(size, 1.15), 70)
    if width < 8 or deep < 8:
        return []
    kind = Roof.FLAT if draws.chance(0.3) else Roof.GABLE
    pitch = 0.0 if kind == Roof.FLAT else math.tan(math.radians(draws.between(3, 9)))
    eave = draws.between(4.8, 9.0)
    more = {"eave": eave, "roof": kind, "pitch": pitch, "turn": math.radians(0.4 * draws.normal())}
    shape, cut = draws.unit(), draws.between(0.45, 0.65)
    back = parcel.depth / 2 - draws.between(3, 7)
    if shape < 0.4:
        return [[parcel.place(0, back - deep / 2, width, deep, **more)]]
    if shape < 0.75:
        side = 1.0 if draws.chance(0.5) else -1.0
        body = parcel.place(0, back - deep * cut / 2, width, deep * cut, **more)
        wing = width * draws.between(0.35, 0.5)
        annex = parcel.place(
            side * (width - wing) / 2, back - deep / 2, wing, deep, **{**more, "eave": eave * draws.between(0.7, 1.0)}
        )
        return [[body, annex]]
    if shape < 0.88:
        half = width * draws.between(0.42, 0.5) - 2
        second = {**more, "eave": draws.between(4.5, 8.0)}
        return [
            [parcel.place(-width / 4 - 1, back - deep / 2, half, deep, **more)],
            [parcel.place(width / 4 + 1, back - deep * cut / 2, half, deep * cut, **second)],
        ]
    body = parcel.place(0, back - deep * cut / 2, width, deep * cut, **more)
    office = parcel.place(
        width * 0.2,
        back - deep * cut - 4,
        width * 0.4,
        12,
        eave=draws.between(3.2, 6.5),
        roof=Roof.FLAT,
        turn=more["turn"],
    )
    return [[body, office]]


def _tower(parcel: Parcel, recipe: SceneParameters, draws: Draws) -> list[list[Solid]]:
    """Compose a downtown building: low blocks with wings or a court, slabs, stepped towers, towers on a podium."""
    size = min(recipe.building_size, 1.1)
    width = max(parcel.width - min(recipe.gap, parcel.width / 3) * draws.between(0.5, 1.6), 8) * size
    deep = max(parcel.depth - draws.between(3, 9), 8) * size
    front = -parcel.depth / 2 + draws.between(1.5, 4)
    kind, rank, low = draws.unit(), draws.unit(), draws.between(6, 26)
    # A downtown's heights are skewed: many blocks of ten to thirty metres, few towers.
    high = 18 + (recipe.tallest - 18) * rank**2.4
    more = {"turn": math.radians(min(recipe.orientation_spread, 5) * draws.normal())}
    side = 1.0 if draws.chance(0.5) else -1.0
    wing, cut = draws.between(0.24, 0.36), draws.between(0.34, 0.5)

    def part(a: float, b: float, along: float, behind: float, eave: float) -> Solid:
        """Place a part; a and b are shares of the building, b from its front."""
        return parcel.place(a * width, front + b * deep, along * width, behind * deep, eave=eave, **more)

    if kind < 0.14:
        return [[part(0, 0.5, 1, 1, low)]]
    if kind < 0.26:
        return [
            [part(0, cut / 2, 1, cut, low), part(side * (0.5 - wing / 2), 0.5, wing, 1, low * draws.between(0.8, 1.3))]
        ]
    if kind < 0.36:
        return [[part(0, cut / 2, 1, cut, low), *(part(s * (0.5 - wing / 2), 0.5, wing, 1, low) for s in (-1, 1))]]
    if kind < 0.46:
        wing *= 0.85
        court = [part(s * (0.5 - wing / 2), 0.5, wing, 1, low) for s in (-1, 1)]
        return [
            [part(0, wing / 2, 1, wing, low), *court, part(0, 1 - wing / 2, 1, wing, low * draws.between(0.8, 1.2))]
        ]
    if kind < 0.58:
        slab = min(draws.between(16, 22) / deep, 1.0)
        return [[part(0, slab / 2, 1, slab, high * 0.7 + 6), part(side * 0.25, 0.5, 0.5, 1, min(low, 12.0))]]
    if kind < 0.72:
        steps = [part(0, 0.5, 1 - 0.16 * k, 1 - 0.16 * k, high * 0.8 * (0.45 + 0.22 * k) + 4) for k in range(3)]
        return [steps]
    podium = draws.between(6, 20)
    across, behind = draws.between(0.42, 0.7), draws.between(0.42, 0.68)
    shift = (0.5 - across / 2) * draws.between(-0.85, 0.85)
    parts = [part(0, 0.5, 1, 1, podium), part(shift, 0.5, across, behind, max(high, podium + 9))]
    if draws.chance(0.35) and width > 45:
        parts[1] = part(-0.28, 0.5, 0.34, behind, max(high, podium + 9))
        parts.append(part(0.28, 0.46, 0.34, behind * 0.9, max(high * 0.8, podium + 6)))
    return [parts]


def _paint(group: list[Solid], rank: int, zone: int, recipe: SceneParameters, draws: Draws, greens: Draws) -> None:
    """Give a building's parts their colours and texture."""
    which, light, tint, facade, wall_light, texture = (draws.unit() for _ in range(6))
    green, kind = greens.unit(), greens.unit()
    flat = group[0].roof in (Roof.FLAT, Roof.SHED)
    palette = PALETTES["halls" if zone == HALLS or rank else recipe.roof_palette]
    look = Texture.TILES
    if zone == TOWERS or (flat and zone != HALLS and not rank):
        palette, look = PALETTES["north-american"], Texture.GRAVEL
    elif zone == HALLS or rank or texture < 0.15:
        look = Texture.CORRUGATED
    if green < recipe.green_roof_share:
        planted = kind < 0.7 if flat else kind < 0.08
        palette, look = PALETTES["planted" if planted else "painted-green"], Texture.PLANTED if planted else look
    colour = draw_colour(palette, which if palette is not PALETTES["planted"] else kind, light, tint)
    wall = draw_colour(PALETTES["facades" if zone == TOWERS else "walls"], facade, wall_light, tint)
    for part in group:
        part.colour, part.wall, part.texture = colour, wall, look
    for part in group[1:]:
        if zone == TOWERS and look == Texture.GRAVEL:
            part.colour = draw_colour(palette, (which + 0.37) % 1, wall_light, tint)
