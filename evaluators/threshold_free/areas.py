"""Exact areas: true positive, false positive and false negative ground, by polygon overlay.

With d and r the two sides of a matched (TP) pair:

- ``T``: union of all (d and r);
- ``F``: union of all (d minus its own r) and of all FP detections, minus T;
- ``M``: union of all (r minus its own d) and of all FN references, minus T.

Multiple detections are ignored (Awrangjeb et al. 2010, section 4.2.2).

Nearly all footprints share no area with another one of their own set, and for these T, F and M follow from the areas
and from the pairs' shared areas by subtraction. Only groups that do share area are united as polygons, so the cost
grows with the number of overlaps.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

__all__ = ["AreaTally", "exact_areas"]


@dataclass(frozen=True)
class AreaTally:
    """Areas of one evaluation, m2.

    Attributes
    ----------
    true_positive, false_positive, false_negative : float
        T, F and M.
    pair_detected, pair_reference, pair_shared : float
        Sums over the TP pairs alone: area of d, of r, and of (d and r).
    """

    true_positive: float
    false_positive: float
    false_negative: float
    pair_detected: float
    pair_reference: float
    pair_shared: float


@dataclass(frozen=True, eq=False)
class _Side:
    """One set of footprints as the overlay needs it: those that count, and the pairs of them that share area."""

    polygons: NDArray[np.object_]
    counts: NDArray[np.bool_]
    partner_polygon: NDArray[np.object_]
    shared_with_partner: NDArray[np.float64]
    conflicts: tuple[NDArray[np.int64], NDArray[np.int64]]


def exact_areas(
    detected: NDArray[np.object_],
    reference: NDArray[np.object_],
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]],
    shared: NDArray[np.float64],
    *,
    false_positives: NDArray[np.int64],
    false_negatives: NDArray[np.int64],
    detected_conflicts: tuple[NDArray[np.int64], NDArray[np.int64]],
    reference_conflicts: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> AreaTally:
    """Return T, F and M.

    Parameters
    ----------
    detected, reference : ndarray of polygons
    pairs : tuple of ndarray of int64, shape (n,)
        Rows (detections, references) of the TP pairs.
    shared : ndarray, shape (n,)
        Area of (d and r) of each pair, m2.
    false_positives, false_negatives : ndarray of int64
        Rows of the FP detections and of the FN references.
    detected_conflicts, reference_conflicts : tuple of ndarray of int64
        Pairs of rows within one set that share any area.
    """
    detections, references = pairs
    one = _side(detected, reference, detections, references, shared, false_positives, detected_conflicts)
    two = _side(reference, detected, references, detections, shared, false_negatives, reference_conflicts)
    pair_detected, pair_reference = shapely.area(detected[detections]), shapely.area(reference[references])
    return AreaTally(
        true_positive=_united_pairs(detected, reference, pairs, shared, one, two),
        false_positive=_beyond_partner(one),
        false_negative=_beyond_partner(two),
        pair_detected=float(pair_detected.sum()),
        pair_reference=float(pair_reference.sum()),
        pair_shared=float(shared.sum()),
    )


def _side(
    polygons: NDArray[np.object_],
    others: NDArray[np.object_],
    own: NDArray[np.int64],
    partners: NDArray[np.int64],
    shared: NDArray[np.float64],
    unmatched: NDArray[np.int64],
    conflicts: tuple[NDArray[np.int64], NDArray[np.int64]],
) -> _Side:
    counts = np.zeros(len(polygons), dtype=bool)
    counts[own] = counts[unmatched] = True
    partner_polygon = np.full(len(polygons), None, dtype=object)
    partner_polygon[own] = others[partners]
    shared_with_partner = np.zeros(len(polygons))
    shared_with_partner[own] = shared
    both = counts[conflicts[0]] & counts[conflicts[1]]
    return _Side(polygons, counts, partner_polygon, shared_with_partner, (conflicts[0][both], conflicts[1][both]))


def _united_pairs(
    detected: NDArray[np.object_],
    reference: NDArray[np.object_],
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]],
    shared: NDArray[np.float64],
    one: _Side,
    two: _Side,
) -> float:
    """T: two pairs can share ground only where both their detections and their references do."""
    of_detection = dict(zip(pairs[0].tolist(), range(len(pairs[0])), strict=True)) if len(one.conflicts[0]) else {}
    of_reference = dict(zip(pairs[1].tolist(), range(len(pairs[1])), strict=True)) if len(two.conflicts[0]) else {}
    among_detections = _named_pairs(one.conflicts, of_detection)
    links = among_detections & _named_pairs(two.conflicts, of_reference)
    alone = np.ones(len(shared), dtype=bool)
    total = 0.0
    for group in _groups(links):
        alone[group] = False
        total += shapely.area(
            shapely.union_all(shapely.intersection(detected[pairs[0][group]], reference[pairs[1][group]]))
        )
    return float(total + shared[alone].sum())


def _beyond_partner(side: _Side) -> float:
    """F or M: what the counted footprints of one side cover beyond their partners, less what is true positive."""
    alone = side.counts.copy()
    total = 0.0
    for group in _groups(zip(side.conflicts[0].tolist(), side.conflicts[1].tolist(), strict=True)):
        alone[group] = False
        polygons, partners = side.polygons[group], side.partner_polygon[group]
        matched = np.array([partner is not None for partner in partners], dtype=bool)
        beyond = polygons.copy()
        beyond[matched] = shapely.difference(polygons[matched], partners[matched])
        true = shapely.union_all(shapely.intersection(polygons[matched], partners[matched]))
        total += shapely.area(shapely.difference(shapely.union_all(beyond), true))
    rows = np.flatnonzero(alone)
    areas = shapely.area(side.polygons[rows])
    rest = areas - side.shared_with_partner[rows]
    # A footprint equal to its partner leaves nothing, whatever the rounding of the two areas.
    rest[rest <= 1e-12 * areas] = 0.0
    return float(total + rest.sum())


def _named_pairs(
    conflicts: tuple[NDArray[np.int64], NDArray[np.int64]], number: dict[int, int]
) -> set[tuple[int, int]]:
    """Return the conflicts between matched footprints as (lower, higher) pair numbers."""
    named = set()
    for one, two in zip(conflicts[0].tolist(), conflicts[1].tolist(), strict=True):
        if one in number and two in number:
            first, second = number[one], number[two]
            named.add((first, second) if first < second else (second, first))
    return named


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
