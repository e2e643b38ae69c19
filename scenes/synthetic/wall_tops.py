"""What stands on the party walls of a row: chimneys and parapets. The reference ignores both.

Nouns
-----
chimney
    The stack of the fireplaces on both sides of a party wall. It stands on the wall, near the middle of its depth,
    and ends above the ridges of both houses.
parapet
    A fire wall that ends above the roofs on both sides: as deep as the higher house, parallel to its roof.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from .palettes import BRICK
from .parcels import Parcel
from .recipe import SceneParameters
from .row_houses import along_street, slanted
from .solids import Body, Roof, Solid
from .streams import Draws

__all__ = ["DRAWS_OF_WALL", "has_chimney", "wall_tops"]

#: Random numbers of one party wall; the first decides on its chimney.
DRAWS_OF_WALL = 8
#: Metres: houses farther apart along the street share no wall.
_APART = 0.1


class _House(NamedTuple):
    """Centre and size of a house along the street and across it, parcel coordinates, and its lift above a floor."""

    solid: Solid
    a: float
    b: float
    wide: float
    deep: float
    lift: float


def has_chimney(first: float, recipe: SceneParameters) -> bool:
    """Return whether a chimney stands on a party wall whose first random number is given."""
    return first < recipe.row_chimneys


def wall_tops(parcel: Parcel, recipe: SceneParameters, left: Solid, right: Solid, draws: Draws) -> list[Solid]:
    """Return what stands on the wall between the main parts of two neighbours; nothing where they share no wall.

    Heights are above the floor of `right`. `Solid.base` of both must be set.
    """
    chimney, parapet = has_chimney(draws.unit(), recipe), draws.chance(recipe.row_parapets)
    first, second = _in_parcel(parcel, left, left.base - right.base), _in_parcel(parcel, right, 0.0)
    skew = math.radians(recipe.row_skew)

    def wall_at(b: float) -> float:
        return second.a - second.wide / 2 + math.tan(skew) * (b - second.b)

    front, back = (
        end(first.b + sign * first.deep / 2, second.b + sign * second.deep / 2) for end, sign in ((max, -1), (min, 1))
    )
    if abs(first.a + first.wide / 2 - wall_at(first.b)) > _APART or front >= back:
        return []
    look: dict[str, Any] = {"body": Body.ROOF_STRUCTURE, "colour": BRICK, "wall": BRICK}
    higher = first if left.ridge + first.lift > right.ridge else second
    thick, rise = draws.between(0.3, 0.4), draws.between(0.3, 0.6)
    long, deep, above = draws.between(0.6, 0.9), draws.between(0.7, 1.6), draws.between(0.5, 1.0)
    middle = (front + back) / 2 + draws.between(-0.08, 0.08) * (back - front)
    tops = []
    if parapet:
        eave = higher.solid.eave + higher.lift + rise
        wall = parcel.place(wall_at(higher.b), higher.b, thick, higher.deep, eave=eave, **look)
        if higher.solid.roof == Roof.GABLE and along_street(parcel, higher.solid):
            # A placed solid has its ridge along the longer side; this one runs along the street as that of the house.
            wall = wall.turned()
            wall.roof, wall.pitch = Roof.GABLE, higher.solid.pitch
        tops.append(slanted(parcel, wall, skew))
    if chimney:
        top = higher.solid.ridge + higher.lift + above
        tops.append(parcel.place(wall_at(middle), middle, long, deep, eave=top, **look))
    return tops


def _in_parcel(parcel: Parcel, house: Solid, lift: float) -> _House:
    """Return where a house stands on its parcel."""
    cosine, sine = math.cos(parcel.angle), math.sin(parcel.angle)
    dx, dy = house.x - parcel.x, house.y - parcel.y
    if along_street(parcel, house):
        wide, deep = house.length, house.width
    else:
        # Sides that are not perpendicular to the street are longer than the house is deep.
        turned = abs(math.sin(house.angle - parcel.angle))
        wide, deep = house.width / turned, house.length * turned
    return _House(house, cosine * dx + sine * dy, (cosine * dy - sine * dx) * parcel.facing, wide, deep, lift)
