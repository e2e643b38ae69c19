"""Greedy matching: pairs are accepted in a given order while both sides are free."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["accept_in_order"]


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
    # A pair whose two sides occur nowhere else is accepted in any order: only contested pairs need the loop.
    lonely = (np.bincount(detections, minlength=counts[0])[detections] == 1) & (
        np.bincount(references, minlength=counts[1])[references] == 1
    )
    of_detection[detections[lonely]] = references[lonely]
    of_reference[references[lonely]] = detections[lonely]
    taken_detections, taken_references = set(), set()
    accepted = []
    contested = zip(detections[~lonely].tolist(), references[~lonely].tolist(), strict=True)
    for detection, reference in contested:
        if detection not in taken_detections and reference not in taken_references:
            taken_detections.add(detection)
            taken_references.add(reference)
            accepted.append((detection, reference))
    if accepted:
        rows = np.array(accepted, dtype=np.int64)
        of_detection[rows[:, 0]] = rows[:, 1]
        of_reference[rows[:, 1]] = rows[:, 0]
    return of_detection, of_reference
