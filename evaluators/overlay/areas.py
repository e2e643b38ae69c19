"""Exact areas: true positive, false positive and false negative ground, by polygon overlay.

With d and r the two sides of a matched (TP) pair:

- ``T``: union of all (d and r);
- ``F``: union of all (d minus its own r) and of all FP detections, minus T;
- ``M``: union of all (r minus its own d) and of all FN references, minus T.

Multiple detections are ignored (Awrangjeb et al. 2010, section 4.2.2).

Since d is the union of (d minus r) and (d and r), F is the area of the union of all TP and FP detections less T, and M
that of all TP and FN references less T. So three union areas are all that is needed. A union area is the sum of the
areas less what is shared; polygons are united only where three or more of them meet, so the cost grows with the number
of overlaps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from ..tally import Tallies
from .convex import convex_intersection_areas
from .overlaps import Overlaps, common_ground, quadrilateral_rows

__all__ = ["AreaTally", "exact_areas", "mask_areas"]

#: Pairs (first, second) of members that share area, and how much, m2.
_Conflicts: TypeAlias = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]


@dataclass(frozen=True, kw_only=True)
class AreaTally(Tallies):
    """Areas of an evaluation, m2.

    Attributes
    ----------
    true_positive, false_positive, false_negative : float
        T, F and M.
    pair_detected, pair_reference, pair_shared : float
        Sums over the TP pairs alone: area of d, of r, and of (d and r).
    """

    true_positive: float = 0.0
    false_positive: float = 0.0
    false_negative: float = 0.0
    pair_detected: float = 0.0
    pair_reference: float = 0.0
    pair_shared: float = 0.0


def exact_areas(
    detected: Footprints,
    reference: Footprints,
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]],
    shared: NDArray[np.float64],
    *,
    false_positives: NDArray[np.int64],
    false_negatives: NDArray[np.int64],
    within: tuple[Overlaps, Overlaps],
) -> AreaTally:
    """Return T, F and M.

    Parameters
    ----------
    detected, reference : Footprints
    pairs : tuple of ndarray of int64, shape (n,)
        Rows (detections, references) of the TP pairs.
    shared : ndarray, shape (n,)
        Area of (d and r) of each pair, m2.
    false_positives, false_negatives : ndarray of int64
        Rows of the FP detections and of the FN references.
    within : tuple of Overlaps
        Pairs of detections, and pairs of references, that share any area.
    """
    detections, references = pairs
    conflicts = (
        _counted(within[0], detections, false_positives, len(detected)),
        _counted(within[1], references, false_negatives, len(reference)),
    )
    pair_conflicts = _pair_conflicts(detected, reference, pairs, conflicts)

    def pair_ground(group: list[int]) -> NDArray[np.object_]:
        return common_ground(detected.polygons[detections[group]], reference.polygons[references[group]])

    true_positive = _union_area(shared, pair_conflicts, pair_ground)
    beyond = []
    for footprints, own, unmatched, conflict in (
        (detected, detections, false_positives, conflicts[0]),
        (reference, references, false_negatives, conflicts[1]),
    ):
        areas = np.zeros(len(footprints))
        areas[own], areas[unmatched] = footprints.areas[own], footprints.areas[unmatched]
        whole = _union_area(areas, conflict, footprints.polygons.__getitem__)
        # Equal sets leave nothing, whatever the rounding of the sums.
        rest = whole - true_positive
        beyond.append(rest if rest > 1e-13 * whole else 0.0)
    return AreaTally(
        true_positive=true_positive,
        false_positive=beyond[0],
        false_negative=beyond[1],
        pair_detected=float(detected.areas[detections].sum()),
        pair_reference=float(reference.areas[references].sum()),
        pair_shared=float(shared.sum()),
    )


def mask_areas(
    detected: Footprints,
    reference: Footprints,
    overlaps: Overlaps,
    within: tuple[Overlaps, Overlaps],
    counted: tuple[NDArray[np.bool_], NDArray[np.bool_]],
) -> tuple[float, float, float]:
    """Return the areas of the union of the detections, of the references, and of both, m2.

    Parameters
    ----------
    detected, reference : Footprints
    overlaps : Overlaps
        Pairs (detection, reference) that share area.
    within : tuple of Overlaps
        Pairs of detections, and pairs of references, that share area.
    counted : tuple of ndarray of bool
        Which detections and references belong to the masks.
    """
    areas = [np.where(mask, side.areas, 0.0) for side, mask in zip((detected, reference), counted, strict=True)]
    conflicts = []
    for pairs, masks in zip((*within, overlaps), ((counted[0],) * 2, (counted[1],) * 2, counted), strict=True):
        kept = masks[0][pairs.first] & masks[1][pairs.second]
        conflicts.append((pairs.first[kept], pairs.second[kept], pairs.area[kept]))
    one = _union_area(areas[0], conflicts[0], detected.polygons.__getitem__)
    two = _union_area(areas[1], conflicts[1], reference.polygons.__getitem__)
    shift = len(detected)
    first, second, shared = (
        np.concatenate(columns)
        for columns in zip(
            conflicts[0],
            (conflicts[1][0] + shift, conflicts[1][1] + shift, conflicts[1][2]),
            (conflicts[2][0], conflicts[2][1] + shift, conflicts[2][2]),
            strict=True,
        )
    )
    every = np.concatenate([detected.polygons, reference.polygons])
    return one, two, _union_area(np.concatenate(areas), (first, second, shared), every.__getitem__)


def _counted(within: Overlaps, matched: NDArray[np.int64], unmatched: NDArray[np.int64], count: int) -> _Conflicts:
    """Return (first, second, area) of the overlaps between footprints that count for the areas."""
    counts = np.zeros(count, dtype=bool)
    counts[matched] = counts[unmatched] = True
    both = counts[within.first] & counts[within.second]
    return within.first[both], within.second[both], within.area[both]


def _pair_conflicts(
    detected: Footprints,
    reference: Footprints,
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]],
    conflicts: tuple[_Conflicts, ...],
) -> _Conflicts:
    """Return TP pairs (first, second) whose true positive ground may overlap, and how much it does.

    Two pairs can share such ground only where both their detections and their references share area.
    """
    n = len(pairs[0])
    keys = []
    for members, footprints, (one, two, _) in zip(pairs, (detected, reference), conflicts, strict=True):
        number = np.full(len(footprints), -1, dtype=np.int64)
        number[members] = np.arange(n)
        first, second = np.sort([number[one], number[two]], axis=0)
        keys.append((first * n + second)[first >= 0])
    common = np.intersect1d(*keys)
    first, second = common // max(n, 1), common % max(n, 1)
    rows = [
        (footprints, members[side])
        for footprints, members in zip((detected, reference), pairs, strict=True)
        for side in (first, second)
    ]
    return first, second, _shared_by_four(rows)


def _shared_by_four(rows: list[tuple[Footprints, NDArray[np.int64]]]) -> NDArray[np.float64]:
    """Return the area common to four footprints, given as four (set, rows)."""
    corner_rows = [quadrilateral_rows(footprints)[index] for footprints, index in rows]
    quick = np.all([row >= 0 for row in corner_rows], axis=0)
    areas = np.empty(len(quick))
    corners = [footprints.quadrilaterals[1][row[quick]] for (footprints, _), row in zip(rows, corner_rows, strict=True)]
    areas[quick] = convex_intersection_areas(*corners)
    common = None
    for footprints, index in rows:
        polygons = footprints.polygons[index[~quick]]
        common = polygons if common is None else common_ground(common, polygons)
    areas[~quick] = shapely.area(common)
    return areas


def _union_area(
    areas: NDArray[np.float64],
    conflicts: _Conflicts,
    polygons_of: Callable[[list[int]], NDArray[np.object_]],
) -> float:
    """Return the area of a union of members with these areas, of which some pairs share area.

    `polygons_of` gives the polygons of a list of members; it is asked only where three or more of them meet.
    """
    first, second, shared = conflicts
    meeting = np.bincount(np.concatenate([first, second]), minlength=len(areas))
    simple = (meeting[first] == 1) & (meeting[second] == 1)
    total = float(areas.sum() - shared[simple].sum())
    for group in _groups(zip(first[~simple].tolist(), second[~simple].tolist(), strict=True)):
        total += shapely.area(shapely.union_all(polygons_of(group))) - areas[group].sum()
    return float(total)


def _groups(links: Iterable[tuple[int, int]]) -> list[list[int]]:
    """Return the connected components of a graph given by its links (union-find with path halving)."""
    parent: dict[int, int] = {}

    def root(node: int) -> int:
        while parent.setdefault(node, node) != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    for one, two in links:
        first, second = root(one), root(two)
        if first != second:
            parent[max(first, second)] = min(first, second)
    groups: dict[int, list[int]] = {}
    for node in sorted(parent):
        groups.setdefault(root(node), []).append(node)
    return list(groups.values())
