"""Strips between outlines that meet, or nearly meet, at a corner: closing a gap leaves nothing there to join them."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

__all__ = ["connected"]

#: Half the width of a strip, metres.
_HALF_WIDTH = 0.01


def connected(polygons: NDArray[np.object_], gap: float) -> NDArray[np.object_]:
    """Return polygons, those that are closer to each other than `gap` (m) connected by a strip of 2 cm.

    Examples
    --------
    >>> corner = np.array([shapely.box(0, 0, 5, 5), shapely.box(5, 5, 9, 9), shapely.box(20, 0, 25, 9)])
    >>> [round(area, 3) for area in shapely.area(connected(corner, 0.1))]
    [41.0, 45.0]
    """
    first, second = shapely.STRtree(polygons).query(polygons, predicate="dwithin", distance=gap)
    first, second = first[first < second], second[first < second]
    apart = shapely.distance(polygons[first], polygons[second]) < gap
    first, second = first[apart], second[apart]
    if not len(first):
        return polygons
    lines = shapely.shortest_line(polygons[first], polygons[second])
    strips = shapely.buffer(lines, _HALF_WIDTH, cap_style="square", join_style="mitre")
    # Of length 0 where they touch: a buffer of such a line with flat or square ends is empty.
    touching = shapely.length(lines) == 0
    strips[touching] = shapely.buffer(shapely.get_point(lines[touching], 0), _HALF_WIDTH, cap_style="square")
    met = np.unique(np.concatenate([first, second]))
    others = np.delete(polygons, met)
    joined = shapely.get_parts(shapely.union_all(np.concatenate([polygons[met], strips])))
    return np.concatenate([others, joined])
