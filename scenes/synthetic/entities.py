"""Entities: which parts of buildings are rectangles of the reference.

An *entity* is one rectangle of the reference: an I-shaped building is one, an L two, a U three, a C four. The parts of
one building overlap as they were built, which is the *natural overlap* of the papers. A part that lies inside another
part of its building (a tower on its podium) has no separate outline.

Source: Awrangjeb, Ravanbakhsh & Fraser (2010), sections 4.1 and 4.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from .solids import Solid

__all__ = ["LOWEST", "SMALLEST", "count_entities", "entities"]

#: Least area, m2, and least height, m, of an entity in the reference.
SMALLEST, LOWEST = 10.0, 2.5
_WITHIN = 0.9


def entities(
    corners: NDArray[np.float64], heights: NDArray[np.float64], owner: NDArray[np.integer[Any]]
) -> NDArray[np.bool_]:
    """Return which parts of buildings are entities.

    Parameters
    ----------
    corners : ndarray, shape (n, 4, 2)
    heights : ndarray, shape (n,)
        Greatest height above the floor, metres.
    owner : ndarray of int, shape (n,)
        Building number.
    """
    polygons = shapely.polygons(corners)
    areas = shapely.area(polygons)
    kept: NDArray[np.bool_] = (areas >= SMALLEST - 1e-6) & (heights >= LOWEST)
    first, second = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    same = (owner[first] == owner[second]) & (areas[first] < areas[second]) & kept[first] & kept[second]
    first, second = first[same], second[same]
    inside = shapely.area(shapely.intersection(polygons[first], polygons[second]))
    kept[first[inside >= _WITHIN * areas[first]]] = False
    return kept


def count_entities(building: Sequence[Solid]) -> int:
    """Return how many entities the parts of one building are."""
    corners = np.stack([part.corners() for part in building])
    heights = np.array([part.ridge for part in building])
    return int(entities(corners, heights, np.zeros(len(building), dtype=np.int64)).sum())
