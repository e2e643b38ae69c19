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
from ...scenes.geodata.footprints import Footprints
from .convex import convex_intersection_areas
from .polygon_overlay import overlay_areas

__all__ = [
    "NUMERICAL_ZERO",
    "Overlaps",
    "overlaps_between",
    "overlaps_within",
    "quadrilateral_rows",
    "shared_areas",
]

#: Share of the smaller area up to which an intersection is rounding (docs/reference/evaluation.md).
NUMERICAL_ZERO = 1e-6

_CHUNK = 1 << 18

#: From so many footprints on, pairs come from compiled code, and from so many pairs on, areas: of general outlines, and
#: of pairs of all kinds. Below, loading the compiled code takes longer than what it saves.
_MANY_FOOTPRINTS, _MANY_OUTLINES, _MANY_ALL = 50_000, 10_000, 50_000

#: Most pairs of footprints whose bounds meet: 5 GB and two minutes. A city has ten for each of its buildings.
_MOST_PAIRS = 5e7


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

    @classmethod
    def of(
        cls,
        first: NDArray[np.int64],
        second: NDArray[np.int64],
        area: NDArray[np.float64],
        sizes: tuple[NDArray[np.float64], NDArray[np.float64]],
    ) -> Overlaps:
        """Keep the pairs that share area; `sizes` are the areas of the footprints of both sets, m2."""
        smaller = np.minimum(sizes[0][first], sizes[1][second])
        return cls(first, second, area, area > NUMERICAL_ZERO * smaller).where(area > 0)

    def __len__(self) -> int:
        return len(self.first)

    @cached_property
    def only_significant(self) -> Overlaps:
        """The pairs that overlap in the sense of the evaluation."""
        return self.where(self.significant)

    def where(self, mask: NDArray[np.bool_]) -> Overlaps:
        """Return the pairs at `mask`."""
        if mask.all():
            return self
        return Overlaps(self.first[mask], self.second[mask], self.area[mask], self.significant[mask])


def overlaps_between(detected: Footprints, reference: Footprints) -> Overlaps:
    """Return the pairs (detection, reference) that share area; cost grows with the number of such pairs."""
    if not len(detected) or not len(reference):
        return _measured(detected, reference, np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    if max(len(detected), len(reference)) > _MANY_FOOTPRINTS:
        from .bounds_index import bounds_tree, meeting_bounds  # compiled code: a comparison of small files does without

        pairs = meeting_bounds(bounds_tree(detected), bounds_tree(reference), most=_MOST_PAIRS)
        return _measured(detected, reference, *_few(pairs, detected))
    tree = shapely.STRtree(reference.polygons)
    _check_crowd(tree, detected)
    return _measured(detected, reference, *_sorted(*tree.query(detected.polygons)))


def overlaps_within(footprints: Footprints) -> Overlaps:
    """Return the pairs of one set that share area, each once, with first < second."""
    if len(footprints) < 2:
        return _measured(footprints, footprints, np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    if len(footprints) > _MANY_FOOTPRINTS:
        from .bounds_index import bounds_tree, meeting_bounds_within

        pairs = meeting_bounds_within(bounds_tree(footprints), most=_MOST_PAIRS)
        return _measured(footprints, footprints, *_few(pairs, footprints))
    tree = shapely.STRtree(footprints.polygons)
    _check_crowd(tree, footprints)
    first, second = tree.query(footprints.polygons)
    once = first < second
    return _measured(footprints, footprints, *_sorted(first[once], second[once]))


def _sorted(first: NDArray[np.int64], second: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    order = np.lexsort((second, first))
    return first[order].astype(np.int64), second[order].astype(np.int64)


def _few(
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]] | None, footprints: Footprints
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the pairs, or raise `InputError` where there were too many."""
    if pairs is None:
        raise InputError(_crowded(footprints))
    return pairs


def _crowded(footprints: Footprints) -> str:
    return (
        f"{footprints.source}: its {len(footprints)} footprints lie on each other or on others in more than "
        f"{_MOST_PAIRS:,.0f} pairs: is it a stack of duplicates, or of candidates before their selection?"
    )


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
            raise InputError(_crowded(footprints))


def shared_areas(
    one: Footprints, two: Footprints, first: NDArray[np.int64], second: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the area that footprint `first` of one set shares with `second` of the other, m2, shape (n,)."""
    many = max(len(one), len(two)) > _MANY_FOOTPRINTS or len(first) > _MANY_ALL
    if not many:
        row_one, row_two = quadrilateral_rows(one)[first], quadrilateral_rows(two)[second]
        convex = (row_one >= 0) & (row_two >= 0)
    if many or np.count_nonzero(~convex) > _MANY_OUTLINES:
        # Compiled code: a comparison of small files does without.
        from .outline_arrays import outlines_of
        from .outline_overlaps import shared_by_outlines, shared_within

        if one is two:
            return shared_within(outlines_of(one), first, second)
        return shared_by_outlines(outlines_of(one), outlines_of(two), first, second)
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
        areas[slow] = overlay_areas(one.polygons, two.polygons, first[slow], second[slow])
    return areas


def quadrilateral_rows(footprints: Footprints) -> NDArray[np.int64]:
    """Return for each footprint its row among the convex quadrilaterals of its set, or -1."""
    rows = np.full(len(footprints), -1, dtype=np.int64)
    index = footprints.quadrilaterals[0]
    rows[index] = np.arange(len(index))
    return rows


def _measured(one: Footprints, two: Footprints, first: NDArray[np.int64], second: NDArray[np.int64]) -> Overlaps:
    return Overlaps.of(first, second, shared_areas(one, two, first, second), (one.areas, two.areas))
