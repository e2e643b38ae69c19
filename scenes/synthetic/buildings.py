"""Buildings on their parcels, put together from rectangles that overlap as the papers' references do.

Every parcel has its own row of random draws, so that changing one parameter leaves everything else as it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import ParameterError
from ..geodata.raster import Elevation
from .entities import count_entities
from .houses import compose_house
from .layout import HALLS, TOWERS
from .palettes import PALETTES, draw_colour
from .parcels import Parcel, Sites
from .recipe import SceneParameters
from .roofscape import furnish
from .row_houses import MOST_HOUSES, compose_row, is_row
from .solids import Roof, Solid, Texture
from .streams import Draws, stream
from .wall_tops import DRAWS_OF_WALL, has_chimney, wall_tops

__all__ = ["Town", "build"]

_DRAWS = 96
#: Random numbers of the look of a house of a row; share of the houses with own colours besides those by variety;
#: random numbers of a row, and most parts of one.
_HOUSE_DRAWS = 104
_OWN_COLOUR = 0.2
_ROW_DRAWS = 10 * _HOUSE_DRAWS
_MOST_PARTS = 20
#: Least distance of two buildings, metres.
_APART = 0.3


@dataclass(frozen=True)
class Town:
    """What was built.

    Attributes
    ----------
    solids : tuple of Solid
        Parts of buildings and the structures on their roofs; `Solid.owner` is the building number.
    built : ndarray of bool, shape (sites,)
        Which sites carry a building.
    garages : tuple of Solid
        Outbuildings that a driveway leads to.
    """

    solids: tuple[Solid, ...]
    built: NDArray[np.bool_]
    garages: tuple[tuple[int, Solid], ...]


def build(sites: Sites, terrain: Elevation, recipe: SceneParameters, seed: int) -> Town:
    """Build exactly as many buildings or entities as the recipe says, sites in the order of their mark.

    Where entities are counted, the last building has only as many parts as are still missing.

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
    rows = stream(seed, "rows").random((len(sites), _ROW_DRAWS)) if recipe.row_share > 0 else None
    # A row of ten houses with annexes takes more numbers than a parcel has.
    reserve = stream(seed, "long-rows").random((0 if rows is None else len(sites), _DRAWS))
    walls = stream(seed, "party-walls").random((0 if rows is None else len(sites), MOST_HOUSES + 1, DRAWS_OF_WALL))
    taken = _Taken(len(sites) * (8 if rows is None else _MOST_PARTS))
    number = counted = 0
    for site in np.argsort(sites.mark, kind="stable"):
        if counted == recipe.buildings:
            break
        parcel = sites.parcel(site)
        draws = Draws(shapes[site])
        zone = int(sites.zone[site])
        compose = {HALLS: _hall, TOWERS: _tower}.get(zone, compose_house)
        in_row = rows is not None and compose is compose_house and is_row(parcel, recipe)
        if in_row:
            compose, draws = compose_row, Draws(np.concatenate([shapes[site], reserve[site]]))
        groups = compose(parcel, recipe, draws)
        # Without its house a parcel has no garage either.
        if not groups or not _fits(groups[0], taken, recipe):
            continue
        groups = [group for group in groups if _fits(group, taken, recipe)]
        built[site] = True
        for rank, whole in enumerate(groups):
            group, worth = _within_quota(whole, recipe.buildings - counted, recipe.counted)
            if not group:
                break
            if rows is not None and in_row:
                numbers = rows[site][rank * _HOUSE_DRAWS : (rank + 1) * _HOUSE_DRAWS]
                # Houses of a row that do not differ have the colours of the first one.
                look = numbers if numbers[-1] < _OWN_COLOUR + recipe.row_variety else rows[site]
                _paint(group, 0, zone, recipe, Draws(look), Draws(look[6:]))
                beside = [place for place in (rank, rank + 1) if 0 < place < len(groups)]
                free = not any(has_chimney(walls[site, place, 0], recipe) for place in beside)
                structures = furnish(group, zone, Draws(numbers[8:]), chimney=free)
            else:
                _paint(group, rank, zone, recipe, Draws(colours[site][rank * 6 :]), Draws(greens[site][rank * 2 :]))
                structures = furnish(group, zone, Draws(roofs[site][rank * 48 :])) if rank == 0 else []
            floor = float(terrain.sample(group[0].x, group[0].y))
            if in_row:
                group[0].base = floor
                if rank:
                    left = groups[rank - 1][0]
                    structures += wall_tops(parcel, recipe, left, group[0], Draws(walls[site, rank]))
            taken.add(group)
            for solid in (*group, *structures):
                solid.owner, solid.base = number, floor
                solids.append(solid)
            if rank and not in_row:
                garages.append((int(site), group[0]))
            number += 1
            counted += worth
    if counted < recipe.buildings:
        what, more = "buildings", ""
        if recipe.counted != "buildings":
            what, more = f"buildings ({recipe.counted} of the reference)", "lower plain_plans, raise outbuildings "
        raise ParameterError(
            f"{what} must be at most {counted} on {recipe.width:g} x {recipe.height:g} m with parcels of "
            f"{recipe.parcel_width:g} x {recipe.parcel_depth:g} m and this seed, not {recipe.buildings}: "
            f"widen the extent, narrow the parcels, {more}or ask for fewer"
        )
    return Town(tuple(solids), built, tuple(garages))


def _within_quota(building: list[Solid], quota: int, counted: str) -> tuple[list[Solid], int]:
    """Return the first parts of a building, as many as the quota allows, and what they count."""
    if quota == 0:
        return [], 0
    if counted == "buildings":
        return building, 1
    worth = count_entities(building)
    while worth > quota:
        building = building[:-1]
        worth = count_entities(building)
    return building, worth


class _Taken:
    """Ground taken by buildings: where streets wind, parcels of two streets can overlap."""

    def __init__(self, room: int) -> None:
        self._circles = np.empty((room, 3))
        self._outlines: list[shapely.Polygon] = []

    def add(self, building: list[Solid]) -> None:
        """Add the ground below the parts of a building."""
        for part in building:
            self._circles[len(self._outlines)] = part.x, part.y, math.hypot(part.length, part.width) / 2
            self._outlines.append(shapely.Polygon(part.corners()))

    def touches(self, part: Solid) -> bool:
        """Return whether a part would come within `_APART` of another building."""
        x, y, reach = self._circles[: len(self._outlines)].T
        near = np.hypot(x - part.x, y - part.y) < reach + math.hypot(part.length, part.width) / 2 + 2 * _APART
        outline = shapely.Polygon(part.corners(_APART))
        return any(outline.intersects(self._outlines[index]) for index in np.flatnonzero(near))


def _fits(building: list[Solid], taken: _Taken, recipe: SceneParameters) -> bool:
    return all(_inside(part, recipe) and not taken.touches(part) for part in building)


def _inside(solid: Solid, recipe: SceneParameters) -> bool:
    corners = solid.corners()
    low, high = corners.min(axis=0), corners.max(axis=0)
    return bool(low.min() > 0.3 and high[0] < recipe.width - 0.3 and high[1] < recipe.height - 0.3)


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
