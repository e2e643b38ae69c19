"""Greedy matching: pairs are accepted in a given order while both sides are free."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["accept_in_order"]

#: Fewer pairs are accepted one by one; so are those that are left after so many rounds.
_FEW, _ROUNDS = 500, 50


def accept_in_order(
    detections: NDArray[np.int64], references: NDArray[np.int64], counts: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Accept pairs in order while both sides are free.

    Parameters
    ----------
    detections, references : ndarray of int64, shape (n,)
        Rows of the two sides of each pair, in the order of acceptance; a pair occurs once.
    counts : tuple of int
        Number of detections and of references.

    Returns
    -------
    of_detection, of_reference : ndarray of int64
        Row of the partner of each detection and of each reference, or -1.

    Examples
    --------
    >>> of_detection, of_reference = accept_in_order(np.array([0, 1, 1]), np.array([0, 0, 1]), (2, 2))
    >>> of_detection.tolist(), of_reference.tolist()
    ([0, 1], [0, 1])
    """
    of_detection = np.full(counts[0], -1, dtype=np.int64)
    of_reference = np.full(counts[1], -1, dtype=np.int64)
    first = np.empty(counts[0], dtype=np.int64), np.empty(counts[1], dtype=np.int64)
    # A pair that comes first on both of its sides is accepted whatever follows, and many are so at once.
    for _ in range(_ROUNDS):
        if len(detections) < _FEW:
            break
        place = np.arange(len(detections))
        for side, rows in zip(first, (detections, references), strict=True):
            side[rows[::-1]] = place[::-1]  # later assignments win
        accepted = (first[0][detections] == place) & (first[1][references] == place)
        of_detection[detections[accepted]] = references[accepted]
        of_reference[references[accepted]] = detections[accepted]
        free = (of_detection[detections] < 0) & (of_reference[references] < 0)
        detections, references = detections[free], references[free]
    for detection, reference in zip(detections.tolist(), references.tolist(), strict=True):
        if of_detection[detection] < 0 and of_reference[reference] < 0:
            of_detection[detection], of_reference[reference] = reference, detection
    return of_detection, of_reference
