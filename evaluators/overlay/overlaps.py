"""Overlaps: which footprints share area, and how much.

Two footprints *overlap* when they share more than `NUMERICAL_ZERO` of the smaller one's area; footprints that merely
touch do not. This is no matching threshold: it separates shared area from rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import InputError
from ...scenes.geodata.footprints import Footprints, polygonal_part
from .convex import convex_intersection_areas

__all__ = [
    "NUMERICAL_ZERO",
    "Overlaps",
    "common_ground",
    "overlaps_between",
    "overlaps_within",
    "quadrilateral_rows",
    "shared_areas",
]

#: Share of the smaller area up to which an intersection is rounding (evaluation.md, section 1).
NUMERICAL_ZERO = 1e-6

_CHUNK = 1 << 18

#: From so many pairs on, areas come from compiled fans: general outlines, and pairs of all kinds. Below, loading the
#: compiled code takes longer than what it saves.
_MANY_OUTLINES, _MANY_ALL = 10_000, 200_000

#: A fan costs the product of the numbers of vertices; beyond so many an overlay is faster.
_LARGEST_FAN = 1 << 18

#: Most pairs of footprints whose bounds meet: 5 GB and two minutes. A city has ten for each of its buildings.
_MOST_PAIRS = 5e7

#: Outlines of more vertices are cut into pieces where they take part in at least so many overlaps.
_MANY_VERTICES = 512
_FEW_PAIRS = 16


@dataclass(frozen=True, eq=False)
class Overlaps:
    """Pairs that share area, sorted by (first, second).

    Attributes
    ----------
    first, second : ndarray of int64, shape (n,)
        Rows in the two sets (in one set: first < second).
    area : ndarray, shape (n,)
        Shared area, m2, more than 0.
    significant : ndarray of bool, shape (n,)
        Whether the pair overlaps; the others share no more than rounding.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    area: NDArray[np.float64]
    significant: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.first)

    @cached_property
    def only_significant(self) -> Overlaps:
        """The pairs that overlap in the sense of the evaluation."""
        return self.where(self.significant)

    def where(self, mask: NDArray[np.bool_]) -> Overlaps:
        """Return the pairs at `mask`."""
        return Overlaps(self.first[mask], self.second[mask], self.area[mask], self.significant[mask])


def overlaps_between(detected: Footprints, reference: Footprints) -> Overlaps:
    """Return the pairs (detection, reference) that share area; cost grows with the number of such pairs."""
    if not len(detected) or not len(reference):
        return _measured(detected, reference, np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    tree = shapely.STRtree(reference.polygons)
    _check_crowd(tree, detected)
    first, second = tree.query(detected.polygons)
    return _measured(detected, reference, first, second)


def overlaps_within(footprints: Footprints) -> Overlaps:
    """Return the pairs of one set that share area, each once, with first < second."""
    if len(footprints) < 2:
        return _measured(footprints, footprints, np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    tree = shapely.STRtree(footprints.polygons)
    _check_crowd(tree, footprints)
    first, second = tree.query(footprints.polygons)
    once = first < second
    return _measured(footprints, footprints, first[once], second[once])


def _check_crowd(tree: shapely.STRtree, footprints: Footprints) -> None:
    """Raise `InputError` when so many footprints lie on each other that their pairs would fill the memory.

    The number of pairs is estimated from footprints picked evenly, a few at a time.
    """
    if len(footprints) * len(tree) <= _MOST_PAIRS:
        return
    picked = np.unique(np.linspace(0, len(footprints) - 1, 4096).astype(np.int64))
    found = 0
    for start in range(0, len(picked), 16):
        found += tree.query(footprints.polygons[picked[start : start + 16]]).shape[1]
        pairs = found * len(footprints) / len(picked)
        if pairs > _MOST_PAIRS:
            raise InputError(
                f"{footprints.source}: its {len(footprints)} footprints lie on each other or on others in more than "
                f"{_MOST_PAIRS:,.0f} pairs: is it a stack of duplicates, or of candidates before their selection?"
            )


def shared_areas(
    one: Footprints, two: Footprints, first: NDArray[np.int64], second: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the area that footprint `first` of one set shares with `second` of the other, m2, shape (n,)."""
    row_one, row_two = quadrilateral_rows(one)[first], quadrilateral_rows(two)[second]
    convex = (row_one >= 0) & (row_two >= 0)
    if len(first) > _MANY_ALL or np.count_nonzero(~convex) > _MANY_OUTLINES:
        return _fanned(one, two, first, second)
    areas = np.empty(len(first))
    corners_one, corners_two = one.quadrilaterals[1], two.quadrilaterals[1]
    for start in range(0, len(first), _CHUNK):
        part = slice(start, start + _CHUNK)
        quick = np.flatnonzero(convex[part]) + start
        sides = corners_one[row_one[quick]], corners_two[row_two[quick]]
        same = (sides[0] == sides[1]).all(axis=(1, 2))
        areas[quick[same]] = one.areas[first[quick[same]]]
        areas[quick[~same]] = convex_intersection_areas(sides[0][~same], sides[1][~same])
        slow = np.flatnonzero(~convex[part]) + start
        areas[slow] = _overlay_areas(one.polygons, two.polygons, first[slow], second[slow])
    return areas


def _fanned(
    one: Footprints, two: Footprints, first: NDArray[np.int64], second: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return shared areas by fans, and by overlay where both outlines have very many vertices."""
    from .fans import fan_areas, outlines_of  # compiled code: a comparison of small files does without

    cost = np.diff(one.rings[0])[first] * np.diff(two.rings[0])[second]
    small = cost <= _LARGEST_FAN
    sides = outlines_of(one), outlines_of(two)
    if small.all():
        return fan_areas(*sides, first, second)
    areas = np.empty(len(first))
    areas[small] = fan_areas(*sides, first[small], second[small])
    areas[~small] = _overlay_areas(one.polygons, two.polygons, first[~small], second[~small])
    return areas


def _overlay_areas(
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


def common_ground(one: NDArray[np.object_], two: NDArray[np.object_] | shapely.Geometry) -> NDArray[np.object_]:
    """Return the ground that polygons share, without the lines and points where they only touch.

    Overlaying a polygon with such a mixture is an error in GEOS.
    """
    common: NDArray[np.object_] = shapely.intersection(one, two)
    for row in np.flatnonzero(~np.isin(shapely.get_type_id(common), (3, 6))):
        common[row] = polygonal_part(common[row])
    return common


def quadrilateral_rows(footprints: Footprints) -> NDArray[np.int64]:
    """Return for each footprint its row among the convex quadrilaterals of its set, or -1."""
    rows = np.full(len(footprints), -1, dtype=np.int64)
    index = footprints.quadrilaterals[0]
    rows[index] = np.arange(len(index))
    return rows


def _measured(one: Footprints, two: Footprints, first: NDArray[np.int64], second: NDArray[np.int64]) -> Overlaps:
    order = np.lexsort((second, first))
    first, second = first[order].astype(np.int64), second[order].astype(np.int64)
    area = shared_areas(one, two, first, second)
    smaller = np.minimum(one.areas[first], two.areas[second])
    return Overlaps(first, second, area, area > NUMERICAL_ZERO * smaller).where(area > 0)
