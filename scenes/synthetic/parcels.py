"""Parcels: where buildings may stand, which way they look and in which order they are built on.

A *site* is a parcel on which one house, hall or tower may stand; its *front* faces the street.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .layout import FIELDS, HALLS, PARK, TOWERS, Layout
from .recipe import SceneParameters
from .streams import stream, uniform

__all__ = ["HALL_WIDTH", "Sites", "plan_sites"]

#: Parcel widths that make one industrial parcel.
HALL_WIDTH = 3.2


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
    mark = stream(seed, "sites").random(len(x))
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
