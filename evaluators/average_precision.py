"""Average precision: precision over recall of detections by falling confidence (Lin et al. 2014, COCO).

Detections of equal confidence count together, so that their order changes nothing; with distinct confidences the value
is COCO's. There is no cap on the number of objects.

Nouns
-----
ranking
    Detections with their confidences, and the IoU thresholds at which they are true positives. Rankings add up over
    scenes.
step
    The detections of one confidence: a point of the curve of precision over recall.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

__all__ = ["AP_THRESHOLDS", "Ranking", "average_precision"]

#: IoU thresholds over which COCO averages, and its recall points.
AP_THRESHOLDS = np.round(np.arange(0.50, 0.951, 0.05), 2)
_RECALLS = np.linspace(0.0, 1.0, 101)


class _Order(NamedTuple):
    """What the curves of a ranking need of its order, which is the same for every resample.

    Attributes
    ----------
    rows : ndarray of int64, shape (n,)
        Detections by falling confidence.
    ends : ndarray of int64, shape (steps,)
        Place of the last detection of each step among `rows`.
    found : tuple of (ndarray of int64, ndarray of int64), one for each threshold
        True positives by falling confidence, and the step of each.
    """

    rows: NDArray[np.int64]
    ends: NDArray[np.int64]
    found: tuple[tuple[NDArray[np.int64], NDArray[np.int64]], ...]

    @classmethod
    def of(cls, scores: NDArray[np.float64], hits: NDArray[np.int64]) -> _Order:
        rows = np.argsort(-scores, kind="stable")
        last = np.append(np.diff(scores[rows]) != 0, True) if len(rows) else np.empty(0, dtype=bool)
        step = np.cumsum(last) - last
        found = []
        for place in range(len(AP_THRESHOLDS)):
            true = np.flatnonzero((hits[rows] >> place) & 1)
            found.append((rows[true], step[true]))
        return cls(rows, np.flatnonzero(last), tuple(found))


@dataclass(frozen=True, eq=False)
class Ranking:
    """Detections with their confidence and the thresholds at which they are true positives.

    Attributes
    ----------
    scores : ndarray of float64, shape (n,)
    hits : ndarray of int64, shape (n,)
        Bit k is set where the detection is a true positive at the k-th threshold.
    times : ndarray of int64, shape (n,), optional
        How often each detection counts; None where each counts once.
    """

    scores: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    hits: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    times: NDArray[np.int64] | None = None
    _shared: _Order | None = field(default=None, repr=False)

    def __add__(self, other: Ranking) -> Self:
        one, two = self._repeated(), other._repeated()
        return type(self)(np.concatenate([one.scores, two.scores]), np.concatenate([one.hits, two.hits]))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Ranking):
            return False
        one, two = self._repeated(), other._repeated()
        return np.array_equal(one.scores, two.scores) and np.array_equal(one.hits, two.hits)

    __hash__ = None  # type: ignore[assignment]

    def _repeated(self) -> Self:
        """Return the ranking with each detection as often as it counts."""
        if self.times is None:
            return self
        return type(self)(np.repeat(self.scores, self.times), np.repeat(self.hits, self.times))

    def to_json(self) -> dict[str, Any]:
        """Return both columns as lists."""
        every = self._repeated()
        return {"score": every.scores.tolist(), "hit": every.hits.tolist()}

    def from_json(self, stored: Any) -> Self:
        """Read what `to_json` wrote."""
        scores, hits = np.array(stored["score"], dtype=np.float64), np.array(stored["hit"], dtype=np.int64)
        if scores.shape != hits.shape or scores.ndim != 1:
            raise ValueError("a ranking needs one hit for each score")
        return type(self)(scores, hits)

    def weighted_sums(self, values: Sequence[Ranking], weights: NDArray[np.int64]) -> Iterator[Self]:
        """Yield the rankings joined, each taken as many times as its weight says; see `Additive`."""
        every = [value._repeated() for value in values]
        joined = type(self)(
            np.concatenate([np.empty(0), *(value.scores for value in every)]),
            np.concatenate([np.empty(0, dtype=np.int64), *(value.hits for value in every)]),
        )
        of_value = np.repeat(np.arange(len(every)), [len(value.scores) for value in every])
        for row in weights:
            yield replace(joined, times=row[of_value], _shared=joined._order)

    @cached_property
    def _order(self) -> _Order:
        return _Order.of(self.scores, self.hits) if self._shared is None else self._shared

    @cached_property
    def _counts(self) -> NDArray[np.int64]:
        """Number of detections up to the end of each step."""
        order = self._order
        return order.ends + 1 if self.times is None else np.cumsum(self.times[order.rows])[order.ends]

    @cached_property
    def found(self) -> NDArray[np.int64]:
        """Number of true positives at each threshold."""
        return np.array(
            [len(rows) if self.times is None else self.times[rows].sum() for rows, _ in self._order.found],
            dtype=np.int64,
        )

    @cached_property
    def _envelopes(self) -> tuple[tuple[NDArray[np.int64], NDArray[np.float64]], ...]:
        """True positives so far, and the highest precision from there on, at each threshold.

        Only steps with a true positive matter: at others precision falls and recall stays.
        """
        curves = []
        for rows, step in self._order.found:
            last = np.append(np.diff(step) != 0, True) if len(step) else np.empty(0, dtype=bool)
            found = np.cumsum(np.ones(len(rows), dtype=np.int64) if self.times is None else self.times[rows])[last]
            # Where a resample has no detection yet, nothing is found: 0 of 1.
            precision = found / np.maximum(self._counts[step[last]], 1)
            curves.append((found, np.maximum.accumulate(precision[::-1])[::-1]))
        return tuple(curves)

    def average_precision(self, place: int, references: int) -> float | None:
        """Return the mean precision at 101 recall points, at the threshold of that place; None without references."""
        if not references:
            return None
        found, precision = self._envelopes[place]
        points = np.searchsorted(found / references, _RECALLS, side="left")
        return float(np.append(precision, 0.0)[points].mean())

    def curve(self, place: int, references: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the 101 recall points and the precision at each, at the threshold of that place."""
        found, precision = self._envelopes[place]
        points = np.searchsorted(found / max(references, 1), _RECALLS, side="left")
        return _RECALLS, np.append(precision, 0.0)[points]


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
    return Ranking(scores, np.asarray(true, dtype=np.int64)).average_precision(0, references)
