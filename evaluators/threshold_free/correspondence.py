"""Correspondence: which detection is matched with which reference.

A *pseudo one-to-one correspondence* gives each footprint of one set at most one partner in the other, without any
threshold (Awrangjeb et al. 2010, section 4.1). Then

- TP: matched pairs;
- FP: detections that overlap no reference;
- MD (multiple detection): unmatched detections that overlap a reference, booked on the nearest one;
- FN: unmatched references;

so TP + FP + MD is the number of detections and TP + FN the number of references.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..overlay.greedy import accept_in_order
from ..overlay.overlaps import Overlaps

__all__ = ["DECIMALS", "MATCHINGS", "Correspondence", "match"]

#: Ways to choose partners; `match` says what each does.
MATCHINGS = ("nearest", "one-pass", "overlap")

#: Digits after the point to which distances (m) and areas (m2) are compared.
DECIMALS = 6


@dataclass(frozen=True, eq=False)
class Correspondence:
    """Partners of both sides.

    Attributes
    ----------
    of_detection : ndarray of int64, shape (number of detections,)
        Row of the matched reference, or -1.
    of_reference : ndarray of int64, shape (number of references,)
        Row of the matched detection, or -1.
    booked_on : ndarray of int64, shape (number of detections,)
        Row of the nearest overlapped reference (for multiple detections), or -1 where there is none.
    """

    of_detection: NDArray[np.int64]
    of_reference: NDArray[np.int64]
    booked_on: NDArray[np.int64]

    @property
    def pairs(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows (detections, references) of the matched pairs, by detection."""
        detections = np.flatnonzero(self.of_detection >= 0)
        return detections, self.of_detection[detections]


def match(
    overlaps: Overlaps,
    distances: NDArray[np.float64],
    counts: tuple[int, int],
    *,
    matching: str = "nearest",
) -> Correspondence:
    """Match detections with references.

    Parameters
    ----------
    overlaps : Overlaps
        Overlapping (detection, reference) pairs.
    distances : ndarray, shape (len(overlaps),)
        Distance of the two centres, m.
    counts : tuple of int
        Number of detections and of references.
    matching : {"nearest", "one-pass", "overlap"}
        ``nearest``: pairs by centre distance; each is accepted when both sides are still free. This is the only stable
        matching, the same from either side and in any input order, and none can be added to it.
        ``one-pass``: the paper's text taken literally: each detection claims its nearest overlapped reference, each
        reference keeps its nearest claimant.
        ``overlap``: as ``nearest``, by largest shared area (Awrangjeb & Fraser 2014).

    Notes
    -----
    Distances and areas are compared after rounding to `DECIMALS` (micrometres, square millimetres), so that rounding
    in coordinates of millions of metres decides nothing. Ties go to the larger overlap, then to the lower reference
    row, then to the lower detection row.
    """
    # The order decides only where an object takes part in several pairs: the others come first, unsorted.
    several = (np.bincount(overlaps.first, minlength=counts[0])[overlaps.first] > 1) | (
        np.bincount(overlaps.second, minlength=counts[1])[overlaps.second] > 1
    )
    lonely, contested = np.flatnonzero(~several), np.flatnonzero(several)
    rounded, area = np.round(distances[contested], DECIMALS), np.round(overlaps.area[contested], DECIMALS)
    ties = (overlaps.first[contested], overlaps.second[contested])
    by_distance = np.concatenate([lonely, contested[np.lexsort((*ties, -area, rounded))]])
    nearest = _first_of_each(overlaps.first[by_distance], overlaps.second[by_distance], counts[0])
    if matching == "one-pass":
        claims = by_distance[nearest[overlaps.first[by_distance]] == overlaps.second[by_distance]]
        of_reference = _first_of_each(overlaps.second[claims], overlaps.first[claims], counts[1])
        of_detection = np.full(counts[0], -1, dtype=np.int64)
        claimed = np.flatnonzero(of_reference >= 0)
        of_detection[of_reference[claimed]] = claimed
        return Correspondence(of_detection, of_reference, nearest)
    order = by_distance
    if matching == "overlap":
        order = np.concatenate([lonely, contested[np.lexsort((*ties, rounded, -area))]])
    of_detection, of_reference = accept_in_order(overlaps.first[order], overlaps.second[order], counts)
    return Correspondence(of_detection, of_reference, nearest)


def _first_of_each(keys: NDArray[np.int64], values: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Return for each key 0..count-1 the first value that stands beside it, or -1."""
    first = np.full(count, -1, dtype=np.int64)
    # Later assignments win, so the reversed order leaves the first.
    first[keys[::-1]] = values[::-1]
    return first
