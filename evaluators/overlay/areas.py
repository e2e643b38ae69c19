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

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from ..tally import Tallies
from .exact_sum import exact_sum
from .groups import Members, connected_groups
from .overlaps import Overlaps
from .polygon_overlay import common_ground, united_area

__all__ = ["AreaTally", "UnionAreas", "exact_areas", "mask_areas", "tally_areas"]

#: From so many members on, or in so large a group, union areas come from compiled code, which takes a moment to load.
_MANY_MEMBERS, _LARGE_GROUP = 5_000, 100

#: Union areas of groups, by kind and members: see `tally_areas`.
UnionAreas: TypeAlias = Callable[[str, Members], NDArray[np.float64]]
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
    """Return T, F and M of footprints; see `tally_areas`."""
    return tally_areas(
        (detected.areas, reference.areas),
        pairs,
        shared,
        false_positives=false_positives,
        false_negatives=false_negatives,
        within=within,
        united=partial(_united, detected, reference),
    )


def tally_areas(
    sizes: tuple[NDArray[np.float64], NDArray[np.float64]],
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]],
    shared: NDArray[np.float64],
    *,
    false_positives: NDArray[np.int64],
    false_negatives: NDArray[np.int64],
    within: tuple[Overlaps, Overlaps],
    united: UnionAreas,
) -> AreaTally:
    """Return T, F and M.

    Parameters
    ----------
    sizes : tuple of ndarray
        Area of each detection and of each reference, m2.
    pairs : tuple of ndarray of int64, shape (n,)
        Rows (detections, references) of the TP pairs.
    shared : ndarray, shape (n,)
        Area of (d and r) of each pair, m2.
    false_positives, false_negatives : ndarray of int64
        Rows of the FP detections and of the FN references.
    within : tuple of Overlaps
        Pairs of detections, and pairs of references, that share any area.
    united : callable
        Takes ``"pairs"``, ``"detected"`` or ``"reference"`` and `Members` of that kind, and returns the area of the
        union of each group. A member of kind ``"pairs"`` is what a detection and a reference share.

    Notes
    -----
    All sums are exact and rounded once, so the result does not depend on the order of the footprints.
    """
    # Rounding may make the shared area larger than the smaller outline, and errors of pairs negative.
    shared = np.minimum(shared, np.minimum(sizes[0][pairs[0]], sizes[1][pairs[1]]))
    conflicts = (
        _counted(within[0], pairs[0], false_positives, len(sizes[0])),
        _counted(within[1], pairs[1], false_negatives, len(sizes[1])),
    )
    links = _pair_links(pairs, (len(sizes[0]), len(sizes[1])), conflicts)
    start, nodes = connected_groups(*links)
    alone = np.ones(len(shared), dtype=bool)
    alone[nodes] = False
    ground = united("pairs", Members(start, pairs[0][nodes], pairs[1][nodes]))
    true_positive = exact_sum(shared[alone], ground)
    beyond = []
    for kind, areas, own, unmatched, conflict in (
        ("detected", sizes[0], pairs[0], false_positives, conflicts[0]),
        ("reference", sizes[1], pairs[1], false_negatives, conflicts[1]),
    ):
        whole = _union_area(areas, np.concatenate([own, unmatched]), conflict, partial(united, kind))
        # Equal sets leave nothing, whatever the rounding of the sums.
        rest = whole - true_positive
        beyond.append(rest if rest > 1e-13 * whole else 0.0)
    return AreaTally(
        true_positive=true_positive,
        false_positive=beyond[0],
        false_negative=beyond[1],
        pair_detected=exact_sum(sizes[0][pairs[0]]),
        pair_reference=exact_sum(sizes[1][pairs[1]]),
        pair_shared=exact_sum(shared),
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
    rows = [np.flatnonzero(mask) for mask in counted]
    one = _union_area(areas[0], rows[0], conflicts[0], partial(_united, detected, reference, "detected"))
    two = _union_area(areas[1], rows[1], conflicts[1], partial(_united, detected, reference, "reference"))
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
    every = Footprints(polygons=np.concatenate([detected.polygons, reference.polygons]))
    united = partial(_united, every, every, "detected")
    together = np.concatenate([rows[0], rows[1] + shift])
    return one, two, _union_area(np.concatenate(areas), together, (first, second, shared), united)


def _counted(within: Overlaps, matched: NDArray[np.int64], unmatched: NDArray[np.int64], count: int) -> _Conflicts:
    """Return (first, second, area) of the overlaps between footprints that count for the areas."""
    counts = np.zeros(count, dtype=bool)
    counts[matched] = counts[unmatched] = True
    both = counts[within.first] & counts[within.second] & (within.area > 0)
    return within.first[both], within.second[both], within.area[both]


def _pair_links(
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]], counts: tuple[int, int], conflicts: tuple[_Conflicts, ...]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the TP pairs (first, second) whose true positive ground may overlap.

    Two pairs can share such ground only where both their detections and their references share area.
    """
    n = len(pairs[0])
    keys = []
    for members, count, (one, two, _) in zip(pairs, counts, conflicts, strict=True):
        number = np.full(count, -1, dtype=np.int64)
        number[members] = np.arange(n)
        first, second = np.sort([number[one], number[two]], axis=0)
        keys.append((first * n + second)[first >= 0])
    common = np.intersect1d(*keys)
    return common // max(n, 1), common % max(n, 1)


def _union_area(
    areas: NDArray[np.float64],
    rows: NDArray[np.int64],
    conflicts: _Conflicts,
    united: Callable[[Members], NDArray[np.float64]],
) -> float:
    """Return the area of the union of the footprints at `rows`, of which some pairs share area.

    Polygons are united only where three or more of them meet.
    """
    first, second, shared = conflicts
    meeting = np.bincount(np.concatenate([first, second]), minlength=len(areas))
    simple = (meeting[first] == 1) & (meeting[second] == 1)
    start, nodes = connected_groups(first[~simple], second[~simple])
    ground = united(Members(start, nodes, np.full(len(nodes), -1, dtype=np.int64)))
    alone = np.ones(len(areas), dtype=bool)
    alone[nodes] = False
    return exact_sum(areas[rows[alone[rows]]], -shared[simple], ground)


def _united(detected: Footprints, reference: Footprints, kind: str, members: Members) -> NDArray[np.float64]:
    """Return the area of the union of each group: compiled where there are many, else by overlay."""
    sides = (reference, reference) if kind == "reference" else (detected, reference)
    if len(members.one) > _MANY_MEMBERS or (np.diff(members.start) > _LARGE_GROUP).any():
        from .outline_arrays import outlines_of  # compiled code: a comparison of small files does without
        from .united import united_areas

        areas = united_areas(outlines_of(sides[0]), outlines_of(sides[1]), members)
    else:
        areas = np.full(len(members.start) - 1, np.nan)
    for group in np.flatnonzero(np.isnan(areas)).tolist():
        part = slice(members.start[group], members.start[group + 1])
        ground = sides[0].polygons[members.one[part]]
        if kind == "pairs":
            ground = common_ground(ground, sides[1].polygons[members.two[part]])
        areas[group] = united_area(ground)
    return areas
