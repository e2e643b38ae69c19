"""Parcels: where buildings may stand, their orientation, and the order in which they are built on.

A *site* is a parcel on which one house, hall or tower may stand; its *front* faces the street. Parcel coordinates: a
along the street, b from the front towards the back, metres, origin in the parcel's centre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .layout import FIELDS, HALLS, PARK, TOWERS, Layout
from .recipe import SceneParameters
from .solids import Solid
from .streams import stream, uniform

__all__ = ["HALL_WIDTH", "Parcel", "Sites", "plan_sites"]

#: Parcel widths that make one industrial parcel.
HALL_WIDTH = 3.2
#: Steps of a sequence that fills the unit square evenly: powers of the root of t^3 = t + 1.
_EVEN = np.array((0.7548776662466927, 0.5698402909980532))


@dataclass(frozen=True)
class Parcel:
    """The frame of one site; attributes as in `Sites`."""

    x: float
    y: float
    angle: float
    facing: float
    width: float
    depth: float
    even: tuple[float, float]

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
    even : ndarray, shape (n, 2)
        Two numbers in [0, 1), spread evenly over the sites in their order: with them the first houses have the same mix
        of plans and outbuildings as all, and every seed nearly the same one.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    angle: NDArray[np.float64]
    facing: NDArray[np.float64]
    width: NDArray[np.float64]
    depth: NDArray[np.float64]
    zone: NDArray[np.uint8]
    mark: NDArray[np.float64]
    even: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.x)

    def parcel(self, site: int) -> Parcel:
        """Return the frame of one site."""
        columns = (self.x, self.y, self.angle, self.facing, self.width, self.depth)
        x, y, angle, facing, width, depth = (float(column[site]) for column in columns)
        plan, shed = self.even[site].tolist()
        return Parcel(x, y, angle, facing, width, depth, (plan, shed))


def plan_sites(layout: Layout, recipe: SceneParameters, seed: int) -> Sites:
    """List the parcels whose centre lies in the extent, in a fixed order."""
    columns: list[tuple[float, ...]] = []
    for i in range(layout.zones.shape[0]):
        for j in range(layout.zones.shape[1]):
            if layout.zones[i, j] not in (PARK, FIELDS):
                columns += _parcels_of_block(layout, i, j)
    table = np.array(columns, dtype=np.float64).reshape(-1, 6)
    x, y = layout.to_world(table[:, 0], table[:, 1])
    ahead_x, ahead_y = layout.to_world(table[:, 0] + 1.0, table[:, 1])
    rng = stream(seed, "sites")
    mark = rng.random(len(x))
    inside = (x > 0) & (x < recipe.width) & (y > 0) & (y < recipe.height)
    mark = mark[inside]
    rank = np.argsort(np.argsort(mark, kind="stable"), kind="stable")
    return Sites(
        x=x[inside],
        y=y[inside],
        angle=np.arctan2(ahead_y - y, ahead_x - x)[inside],
        facing=table[inside, 2],
        width=table[inside, 3],
        depth=table[inside, 4],
        zone=table[inside, 5].astype(np.uint8),
        mark=mark,
        even=(rng.random(2) + rank[:, None] * _EVEN) % 1.0,
    )


def _parcels_of_block(layout: Layout, i: int, j: int) -> list[tuple[float, ...]]:
    """Return u, v, facing, width, depth and zone of the parcels of one block."""
    period, block, street, cross = layout.pattern[:4]
    zone = int(layout.zones[i, j])
    start, front = layout.block_start(i, j)
    start, front = start + cross / 2, front + street / 2
    depth, usable = (period - street) / 2, block - cross
    count = max(1, round(usable / (layout.pattern[7] * (HALL_WIDTH if zone == HALLS else 1.0))))
    # Houses lie back to back; the parcel of a hall, and of some towers, reaches from street to street.
    through = zone == HALLS or (zone == TOWERS and uniform(layout.key, (i << 20) + j) < 0.3)
    rows = ((depth, 1.0, 2 * depth),) if through else ((depth / 2, 1.0, depth), (depth * 1.5, -1.0, depth))
    parcels: list[tuple[float, ...]] = []
    for side, (across, facing, deep) in enumerate(rows):
        # Downtown parcels differ in width, others hardly.
        uneven = 0.55 if zone == TOWERS else 0.0
        shares = [
            1 + uneven * (2 * float(uniform(layout.key, (i << 40) + (j << 20) + 8 * lot + side)) - 1)
            for lot in range(count)
        ]
        edge = start
        for share in shares:
            wide = usable * share / math.fsum(shares)
            parcels.append((edge + wide / 2, front + across, facing, wide, deep, zone))
            edge += wide
    return parcels
