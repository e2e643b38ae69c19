"""Houses: a plan of one to four rectangles, and the garages and sheds behind it.

Plans
-----
I
    One rectangle.
L, T
    A body across the parcel and a wing, at one end or in the middle.
U, C
    A body and two wings; for a C one wing returns towards the other around a court.
row of garages
    Instead of a house, as behind blocks of flats.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from .entities import SMALLEST
from .parcels import Parcel
from .recipe import SceneParameters
from .solids import Roof, Solid
from .streams import Draws

__all__ = ["compose_house"]


def _pitched(draws: Draws, recipe: SceneParameters) -> tuple[Roof, float]:
    """Draw a house's roof kind and the tangent of its pitch."""
    flat, gable, shape = draws.unit(), draws.unit(), draws.normal()
    if flat < recipe.flat_roofs:
        return (Roof.FLAT, 0.0) if gable < 0.6 else (Roof.SHED, math.tan(math.radians(4 + 8 * draws.unit())))
    pitch = math.radians(min(max(recipe.roof_pitch * (1 + 0.12 * shape), 4), 62))
    return (Roof.GABLE if gable < recipe.gable_roofs else Roof.HIP), math.tan(pitch)


@dataclass(frozen=True, kw_only=True)
class _Plan:
    """Where a house stands in its parcel: centre along the street, front, sides, orientation, roof."""

    a: float
    front: float
    width: float
    deep: float
    mirror: float
    eave: float
    more: dict[str, Any]


def compose_house(parcel: Parcel, recipe: SceneParameters, draws: Draws) -> list[list[Solid]]:
    """Return the parts of a house, then those of each outbuilding behind it; or one row of garages."""
    if parcel.even[1] >= 1 - recipe.garage_rows:
        return [[_garage_row(parcel, recipe, draws)]]
    size = recipe.building_size
    left, right = (max(0.3, recipe.gap / 2 * draws.between(0.6, 1.4)) for _ in range(2))
    drive = draws.chance(0.55) * draws.between(1.6, 2.8)
    room = parcel.width - left - right - drive
    width = min(room, draws.between(9.0, 14.5)) * min(size, 1.25)
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
    more = {"turn": turn, "roof": kind, "pitch": pitch}
    plan = _Plan(a=a, front=front, width=width, deep=deep, mirror=mirror, eave=eave, more=more)
    group = _compose_plan(plan, parcel, recipe, draws)
    rear = max(_deepest(parcel, part) for part in group)
    return [group, *([shed] for shed in _outbuildings(parcel, recipe, draws, rear, mirror))]


def _compose_plan(plan: _Plan, parcel: Parcel, recipe: SceneParameters, draws: Draws) -> list[Solid]:
    """Return the parts of a house: one rectangle, or a body with wings."""
    shape, swing, reach = parcel.even[0], draws.unit(), draws.between(0.4, 0.75)
    share, step = draws.between(0.38, 0.52), 0.12 * draws.unit()
    back = max(0.0, min(parcel.depth / 2 - 5 - (plan.front + plan.deep), 8.0))
    if shape < recipe.plain_plans or back < 2.5:
        return [parcel.place(plan.a, plan.front + plan.deep / 2, plan.width, plan.deep, eave=plan.eave, **plan.more)]
    kind = (shape - recipe.plain_plans) / (1 - recipe.plain_plans)
    # The body lies across the parcel; wings start at its middle, so their roofs and rectangles overlap.
    body = max(min(plan.deep * 0.72, 9.5), 6.0)
    middle = plan.front + plan.deep / 2
    group = [parcel.place(plan.a, middle, plan.width, body, eave=plan.eave, **plan.more)]

    def add(a: float, b: float, along: float, deep: float) -> None:
        """Add a wing, a little lower than the body; a and b from the body's middle."""
        group.append(parcel.place(plan.a + a, middle + b, along, deep, eave=plan.eave - step, **plan.more))

    length = body / 2 + min(back, plan.deep * reach)
    wing = max(plan.width * share, 4.2)
    towards = 1.0 if swing < 0.72 or recipe.setback < 5 else -1.0
    if towards < 0:
        length = min(length, body / 2 + recipe.setback * 0.55)
    if kind < 0.61:
        side = plan.mirror if kind < 0.42 else 0.0
        add(side * (plan.width - wing) / 2, towards * length / 2, wing, length)
        return group
    court = 0.3 * plan.width if kind > 0.9 else 0.0
    wing = max(min(wing, (plan.width - max(court, 2.5)) / 2), 3.2)
    for side, reached in ((plan.mirror, length), (-plan.mirror, length * (1.0 if kind > 0.8 else 0.7))):
        add(side * (plan.width - wing) / 2, towards * reached / 2, wing, reached)
    gap, deep = plan.width - 2 * wing, min(wing, 4.0)
    if court and gap > 2.5 and length - body / 2 - deep > 1.5:
        along = wing + 0.6 * gap
        add(plan.mirror * (plan.width - along) / 2, towards * (length - deep / 2), along, deep)
    return group


def _outbuildings(parcel: Parcel, recipe: SceneParameters, draws: Draws, rear: float, mirror: float) -> Iterator[Solid]:
    """Yield garages and sheds behind a house that ends at `rear`, on the side away from the house."""
    size, count = recipe.building_size, recipe.outbuildings
    for rank in range(2):
        wanted, car, corner = parcel.even[1] < count - rank, draws.chance(0.62 if rank == 0 else 0.3), draws.unit()
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
        yield parcel.place(
            side * (parcel.width / 2 - 0.5 - wide / 2),
            place_b,
            wide,
            long,
            eave=high,
            roof=roof,
            pitch=0.0 if roof == Roof.FLAT else rise * (0.3 if roof == Roof.SHED else 1.0),
        )


def _garage_row(parcel: Parcel, recipe: SceneParameters, draws: Draws) -> Solid:
    """Return a row of garages under one flat roof, which takes the whole frontage."""
    deep = draws.between(5.6, 6.4)
    front = -parcel.depth / 2 + recipe.setback
    turn = math.radians(recipe.orientation_spread) * draws.normal()
    return parcel.place(
        0.0, front + deep / 2, parcel.width - 1.0, deep, turn=turn, eave=draws.between(2.6, 2.9), roof=Roof.FLAT
    )


def _deepest(parcel: Parcel, part: Solid) -> float:
    """Return the greatest b of a part's corners."""
    offset = part.corners() - (parcel.x, parcel.y)
    b = (-math.sin(parcel.angle) * offset[:, 0] + math.cos(parcel.angle) * offset[:, 1]) * parcel.facing
    return float(b.max())
