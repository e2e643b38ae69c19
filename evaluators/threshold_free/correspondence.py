"""Correspondence: which detection is matched with which reference.

A *pseudo one-to-one correspondence* gives each footprint of one set at most one partner in the other, without any
threshold (Awrangjeb et al. 2010, section 4.1). Then

- TP: matched pairs;
- FP: detections that overlap no reference;
- MD (multiple detection): unmatched detections that overlap a reference, assigned to the nearest one;
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
    assigned_to : ndarray of int64, shape (number of detections,)
        Row of the nearest overlapped reference (for multiple detections), or -1 where there is none.
    """

    of_detection: NDArray[np.int64]
    of_reference: NDArray[np.int64]
    assigned_to: NDArray[np.int64]

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
    # The order decides only where an object takes part in several pairs: the others are matched at once.
    several = (np.bincount(overlaps.first, minlength=counts[0])[overlaps.first] > 1) | (
        np.bincount(overlaps.second, minlength=counts[1])[overlaps.second] > 1
    )
    of_detection, of_reference = (np.full(count, -1, dtype=np.int64) for count in counts)
    of_detection[overlaps.first[~several]] = overlaps.second[~several]
    of_reference[overlaps.second[~several]] = overlaps.first[~several]
    nearest = of_detection.copy()

    contested = np.flatnonzero(several)
    del several
    first, second = overlaps.first[contested], overlaps.second[contested]
    rounded, area = np.round(distances[contested], DECIMALS), np.round(overlaps.area[contested], DECIMALS)
    order = np.lexsort((first, second, -area, rounded))
    _put_first(nearest, first[order], second[order])
    if matching == "one-pass":
        order = order[nearest[first[order]] == second[order]]
        _put_first(of_reference, second[order], first[order])
        claimed = np.unique(second[order])
        of_detection[of_reference[claimed]] = claimed
        return Correspondence(of_detection, of_reference, nearest)
    if matching == "overlap":
        order = np.lexsort((first, second, rounded, -area))
    detections, one = np.unique(first[order], return_inverse=True)
    references, two = np.unique(second[order], return_inverse=True)
    partner, holder = accept_in_order(one, two, (len(detections), len(references)))
    of_detection[detections[partner >= 0]] = references[partner[partner >= 0]]
    of_reference[references[holder >= 0]] = detections[holder[holder >= 0]]
    return Correspondence(of_detection, of_reference, nearest)


def _put_first(column: NDArray[np.int64], rows: NDArray[np.int64], values: NDArray[np.int64]) -> None:
    """Set `column` at each of `rows` to the first value that stands beside it."""
    # Later assignments win, so the reversed order leaves the first.
    column[rows[::-1]] = values[::-1]
