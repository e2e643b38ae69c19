"""Average precision: precision over recall of detections by falling confidence (Lin et al. 2014, COCO).

Detections of equal confidence count together, so that their order changes nothing; with distinct confidences the value
is COCO's. There is no cap on the number of objects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

__all__ = ["AP_THRESHOLDS", "Ranking", "average_precision"]

#: IoU thresholds over which COCO averages, and its recall points.
AP_THRESHOLDS = np.round(np.arange(0.50, 0.951, 0.05), 2)
_RECALLS = np.linspace(0.0, 1.0, 101)


@dataclass(frozen=True, eq=False)
class Ranking:
    """Detections with their confidence and the thresholds at which they are true positives.

    Attributes
    ----------
    scores : ndarray of float64, shape (n,)
    hits : ndarray of int64, shape (n,)
        Bit k is set where the detection is a true positive at the k-th threshold.
    """

    scores: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    hits: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def __add__(self, other: Ranking) -> Self:
        return type(self)(np.concatenate([self.scores, other.scores]), np.concatenate([self.hits, other.hits]))

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Ranking)
            and np.array_equal(self.scores, other.scores)
            and np.array_equal(self.hits, other.hits)
        )

    __hash__ = None  # type: ignore[assignment]

    def to_json(self) -> dict[str, Any]:
        """Return both columns as lists."""
        return {"score": self.scores.tolist(), "hit": self.hits.tolist()}

    def from_json(self, stored: Any) -> Self:
        """Read what `to_json` wrote."""
        scores, hits = np.array(stored["score"], dtype=np.float64), np.array(stored["hit"], dtype=np.int64)
        if scores.shape != hits.shape or scores.ndim != 1:
            raise ValueError("a ranking needs one hit for each score")
        return type(self)(scores, hits)

    def weighted_sum(self, values: Sequence[Ranking], weights: NDArray[np.int64]) -> Self:
        """Return the rankings joined, each taken as many times as its weight says."""
        chosen = [value for value, times in zip(values, weights.tolist(), strict=True) for _ in range(times)]
        return type(self)(
            np.concatenate([np.empty(0), *(value.scores for value in chosen)]),
            np.concatenate([np.empty(0, dtype=np.int64), *(value.hits for value in chosen)]),
        )


def average_precision(scores: NDArray[np.float64], true: NDArray[np.bool_], references: int) -> float | None:
    """Return the mean precision at 101 recall points; None without references.

    Parameters
    ----------
    scores : ndarray, shape (n,)
        Confidence of each detection.
    true : ndarray of bool, shape (n,)
        Whether it is a true positive.
    references : int

    Examples
    --------
    >>> average_precision(np.array([0.9, 0.8]), np.array([True, False]), 1)
    1.0
    >>> round(average_precision(np.array([0.9, 0.8]), np.array([False, True]), 1), 3)
    0.5
    """
    if not references:
        return None
    if not len(scores):
        return 0.0
    order = np.argsort(-scores, kind="stable")
    # Detections of equal confidence are one step of the curve.
    last = np.append(np.diff(scores[order]) != 0, True)
    found = np.cumsum(true[order])[last]
    recall, precision = found / references, found / (np.flatnonzero(last) + 1)
    precision = np.maximum.accumulate(precision[::-1])[::-1]
    place = np.searchsorted(recall, _RECALLS, side="left")
    return float(np.append(precision, 0.0)[place].mean())
