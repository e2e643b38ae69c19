"""What polygons have in common, by the overlays of GEOS: exact in topology, slow, for any outline."""

from __future__ import annotations

from functools import reduce

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.polygon_repair import polygonal_part

__all__ = ["common_ground", "overlay_areas", "united_area"]

#: Outlines of more vertices are cut into pieces where they take part in at least so many overlaps.
_MANY_VERTICES = 512
_FEW_PAIRS = 16
#: Share of the areas of all members that rounding may add to a union, and grid of unions that are wrong without one, m.
_ROUNDING, _GRID = 1e-9, 1e-6


def overlay_areas(
    one: NDArray[np.object_], two: NDArray[np.object_], first: NDArray[np.int64], second: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the shared area of general polygons.

    An overlay costs as much as the larger outline has vertices. An outline around a whole quarter would be
    overlaid in full with each of its houses, so it is cut into pieces first.
    """
    # Overlaying an outline with itself is the most expensive case.
    same = shapely.equals_exact(one[first], two[second], 0.0)
    areas = np.where(same, shapely.area(one[first]), 0.0)
    vertices = shapely.get_num_coordinates(one[first]), shapely.get_num_coordinates(two[second])
    lopsided = ~same & (np.minimum(*vertices) <= _MANY_VERTICES)
    direct = ~same
    for large, others, large_row, other_row, count in (
        (one, two, first, second, vertices[0]),
        (two, one, second, first, vertices[1]),
    ):
        candidates = np.flatnonzero(lopsided & (count > _MANY_VERTICES))
        candidates = candidates[np.argsort(large_row[candidates], kind="stable")]
        rows, start = np.unique(large_row[candidates], return_index=True)
        for row, pairs in zip(rows, np.split(candidates, start[1:]), strict=False):
            if len(pairs) < _FEW_PAIRS:
                continue
            pieces = _pieces(large[row])
            smaller = others[other_row[pairs]]
            pair, piece = shapely.STRtree(pieces).query(smaller)
            parts = shapely.area(shapely.intersection(smaller[pair], pieces[piece]))
            areas[pairs] = np.bincount(pair, weights=parts, minlength=len(pairs))
            direct[pairs] = False
    areas[direct] = shapely.area(shapely.intersection(one[first[direct]], two[second[direct]]))
    return areas


def _pieces(polygon: shapely.Geometry) -> NDArray[np.object_]:
    """Halve a polygon until each piece has few vertices or halving no longer helps."""
    pieces, rest = [], [polygon]
    while rest:
        part = rest.pop()
        vertices = shapely.get_num_coordinates(part)
        if vertices > _MANY_VERTICES // 4:
            xmin, ymin, xmax, ymax = shapely.bounds(part)
            x, y = (xmin + xmax) / 2, (ymin + ymax) / 2
            wide = xmax - xmin > ymax - ymin
            halves = [
                shapely.box(xmin, ymin, x if wide else xmax, ymax if wide else y),
                shapely.box(x if wide else xmin, ymin if wide else y, xmax, ymax),
            ]
            cut = common_ground(np.array([part, part], dtype=object), np.array(halves, dtype=object))
            if shapely.get_num_coordinates(cut).max() < vertices:
                rest += [half for half in cut if not half.is_empty]
                continue
        pieces.append(part)
    return np.array(pieces, dtype=object)


def united_area(ground: NDArray[np.object_]) -> float:
    """Return the area of the union of some polygons, m2.

    They are united one after the other: GEOS 3.14 can lose a polygon that touches others where it unites many at once.
    A union is no smaller than its largest member and no larger than all of them; where a result is neither, the
    polygons are united on a fine grid.

    >>> united_area(np.array([shapely.box(0, 0, 2, 2), shapely.box(1, 1, 3, 3)]))
    7.0
    """
    sizes = shapely.area(ground)
    area = float(shapely.area(reduce(shapely.union, ground)))
    slack = _ROUNDING * float(sizes.sum())
    if not sizes.max() - slack <= area <= sizes.sum() + slack:
        area = float(shapely.area(shapely.union_all(ground, grid_size=_GRID)))
    return area


def common_ground(one: NDArray[np.object_], two: NDArray[np.object_] | shapely.Geometry) -> NDArray[np.object_]:
    """Return the ground that polygons share, without the lines and points where they only touch.

    Overlaying a polygon with such a mixture is an error in GEOS.
    """
    common: NDArray[np.object_] = shapely.intersection(one, two)
    for row in np.flatnonzero(~np.isin(shapely.get_type_id(common), (3, 6))):
        common[row] = polygonal_part(common[row])
    return common
