"""Rows of houses: several buildings wall to wall on one wide parcel.

Nouns
-----
row
    Houses that share party walls, under one ridge along the street or each with a gable that faces it.
variety
    Share of the party walls at which eaves and fronts step, and the spread of widths and depths. Without it a row is
    one long roof, and nothing shows where one house ends but colours and what stands on the walls (`wall_tops`).
annex
    A low flat part behind a house, of the same building.
skew
    Angle between the party walls of a row and the perpendicular of its street. Fronts and backs stay parallel to the
    street: houses are parallelograms, and gables that face the street have oblique ridges.
"""

from __future__ import annotations

import math
from dataclasses import replace

from .parcels import Parcel
from .recipe import SceneParameters
from .solids import Roof, Solid
from .streams import Draws

__all__ = ["MOST_HOUSES", "along_street", "compose_row", "is_row", "slanted"]

#: Most houses of a row.
MOST_HOUSES = 10


def is_row(parcel: Parcel, recipe: SceneParameters) -> bool:
    """Return whether a parcel of houses carries a row."""
    return parcel.even[1] < recipe.row_share


def along_street(parcel: Parcel, house: Solid) -> bool:
    """Return whether the ridge of a house of a row runs along its street."""
    return abs(math.sin(house.angle - parcel.angle)) < math.sqrt(0.5)


def slanted(parcel: Parcel, house: Solid, skew: float) -> Solid:
    """Return a solid with its sides across the street turned by the skew, radians; its front and back stay."""
    # A turn as seen from the street.
    turn = -parcel.facing * skew
    if not turn:
        return house
    if along_street(parcel, house):
        return replace(house, slant=-math.tan(turn))
    # The ridge turns with the sides, and the ends stay parallel to the street.
    long, wide = house.length / math.cos(turn), house.width * math.cos(turn)
    return replace(house, angle=house.angle + turn, length=long, width=wide, slant=math.tan(turn))


def compose_row(parcel: Parcel, recipe: SceneParameters, draws: Draws) -> list[list[Solid]]:
    """Return the parts of each house of a row, in order along the street."""
    variety = recipe.row_variety
    usable = parcel.width - max(0.4, recipe.gap * draws.between(0.7, 1.3))
    count = min(max(2, round(usable / (recipe.row_house_width * draws.between(0.9, 1.1)))), MOST_HOUSES)
    deep = min(draws.between(8.0, 10.5) * recipe.building_size, parcel.depth - recipe.setback - 3)
    front = -parcel.depth / 2 + recipe.setback * draws.between(0.8, 1.25)
    eave = recipe.storey_height * (2 if draws.chance(recipe.two_storeys) else 1) * draws.between(0.94, 1.06)
    skew = math.radians(recipe.row_skew)
    flat, faces_street = draws.chance(recipe.flat_roofs), draws.chance(recipe.row_gables)
    pitch = math.tan(math.radians(min(max(recipe.roof_pitch * draws.between(0.9, 1.1), 4), 62)))
    roof = {"roof": Roof.FLAT if flat else Roof.GABLE, "pitch": 0.0 if flat else pitch}
    shares = [1 + 0.35 * variety * (2 * draws.unit() - 1) for _ in range(count)]
    edge, top, start = -usable / 2, eave, front
    line = front + deep / 2  # Where houses have the same place whatever the skew.
    houses: list[list[Solid]] = []
    for share in shares:
        wide = usable * share / math.fsum(shares)
        steps, up, back = draws.chance(variety), draws.between(-1.2, 1.2), draws.between(0.0, 1.2)
        own = deep * (1 + 0.2 * variety * (2 * draws.unit() - 1))
        if steps:
            top, start = eave + up, front + back * variety
        middle = start + own / 2
        place = edge + wide / 2
        house = parcel.place(place + math.tan(skew) * (middle - line), middle, wide, own, eave=top, **roof)
        # A placed solid has its ridge along the longer side.
        if (own > wide) != faces_street:
            house = house.turned()
        parts = [slanted(parcel, house, skew)]
        if draws.chance(recipe.outbuildings) and start + own + 4.5 < parcel.depth / 2:
            narrow, long, side = wide * draws.between(0.45, 0.75), draws.between(2.5, 4.2), draws.chance(0.5)
            shift = (wide - narrow) / 2 * (1 if side else -1)
            at = start + own + long / 2 - 0.2
            place += shift + math.tan(skew) * (at - line)
            annex = parcel.place(place, at, narrow, long, eave=draws.between(2.6, 3.1))
            parts.append(slanted(parcel, annex, skew))
        houses.append(parts)
        edge += wide
    return houses
