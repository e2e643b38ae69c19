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

__all__ = ["AP_THRESHOLDS", "Ranking"]

#: IoU thresholds over which COCO averages, and its recall points.
AP_THRESHOLDS = np.round(np.arange(0.50, 0.951, 0.05), 2)
_RECALLS = np.linspace(0.0, 1.0, 101)


class _Step(NamedTuple):
    """The true positives of one threshold by falling confidence.

    Attributes
    ----------
    rows : ndarray of int64, shape (n,)
        Detections.
    step : ndarray of int64, shape (n,)
        Step of each.
    """

    rows: NDArray[np.int64]
    step: NDArray[np.int64]


class _Order(NamedTuple):
    """What the curves of a ranking need of its order, which is the same for every resample.

    Attributes
    ----------
    rows : ndarray of int64, shape (n,)
        Detections by falling confidence.
    ends : ndarray of int64, shape (steps,)
        Place of the last detection of each step among `rows`.
    found : tuple of _Step
        One for each threshold.
    """

    rows: NDArray[np.int64]
    ends: NDArray[np.int64]
    found: tuple[_Step, ...]

    @classmethod
    def of(cls, scores: NDArray[np.float64], hits: NDArray[np.int64]) -> _Order:
        rows = np.argsort(-scores, kind="stable")
        last = _lasts(scores[rows])
        step = np.cumsum(last).astype(np.int64) - last
        found = []
        for place in range(len(AP_THRESHOLDS)):
            true = np.flatnonzero((hits[rows] >> place) & 1)
            found.append(_Step(rows[true], step[true]))
        return cls(rows, np.flatnonzero(last), tuple(found))


def _lasts(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Return whether each value is the last one of a run of equal values, shape (n,)."""
    return np.append(values[1:] != values[:-1], np.ones(min(len(values), 1), dtype=bool))


@dataclass(frozen=True, eq=False)
class Ranking:
    """Detections with their confidence and the thresholds at which they are true positives.

    Attributes
    ----------
    scores : ndarray of float64, shape (n,)
    hits : ndarray of int64, shape (n,)
        Bit k is set where the detection is a true positive at the k-th threshold.
    skips : ndarray of int64, shape (n,)
        Bit k is set where the detection does not count at the k-th threshold.
    times : ndarray of int64, shape (n,), optional
        How often each detection counts; None where each counts once.

    Examples
    --------
    >>> ranking = Ranking(np.array([0.9, 0.8]), np.array([0, 1]), np.array([0, 0]))
    >>> round(ranking.average_precision(0, references=1), 3), ranking.average_precision(1, references=1)
    (0.5, 0.0)
    """

    scores: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    hits: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    skips: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    times: NDArray[np.int64] | None = None
    _shared: _Order | None = field(default=None, repr=False)

    def __add__(self, other: Ranking) -> Self:
        return self._joined([self, other])

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Ranking):
            return False
        return all(np.array_equal(one, two) for one, two in zip(self._repeated(), other._repeated(), strict=True))

    __hash__ = None  # type: ignore[assignment]

    def _repeated(self) -> tuple[NDArray[Any], ...]:
        """Return scores, hits and skips with each detection as often as it counts."""
        columns = self.scores, self.hits, self.skips
        return columns if self.times is None else tuple(np.repeat(column, self.times) for column in columns)

    @classmethod
    def _joined(cls, values: Sequence[Ranking]) -> Self:
        every: list[Ranking] = [cls(), *values]
        scores, hits, skips = (
            np.concatenate(column) for column in zip(*(value._repeated() for value in every), strict=True)
        )
        return cls(scores, hits, skips)

    def to_json(self) -> dict[str, Any]:
        """Return the columns as lists; skips only where there are any."""
        scores, hits, skips = self._repeated()
        more = {"skip": skips.tolist()} if skips.any() else {}
        return {"score": scores.tolist(), "hit": hits.tolist(), **more}

    def from_json(self, stored: Any) -> Self:
        """Read what `to_json` wrote."""
        scores, hits = np.array(stored["score"], dtype=np.float64), np.array(stored["hit"], dtype=np.int64)
        skips = np.array(stored["skip"], dtype=np.int64) if "skip" in stored else np.zeros_like(hits)
        if scores.shape != hits.shape or hits.shape != skips.shape or scores.ndim != 1:
            raise ValueError("a ranking needs one hit for each score")
        return type(self)(scores, hits, skips)

    def weighted_sums(self, values: Sequence[Ranking], weights: NDArray[np.int64]) -> Iterator[Self]:
        """Yield the rankings joined, each taken as many times as its weight says; see `Additive`."""
        joined = self._joined(values)
        of_value = np.repeat(np.arange(len(values)), [len(value._repeated()[0]) for value in values])
        for row in weights:
            yield replace(joined, times=row[of_value], _shared=joined._order)

    @cached_property
    def _order(self) -> _Order:
        return _Order.of(self.scores, self.hits) if self._shared is None else self._shared

    def _counts(self, place: int) -> NDArray[np.int64]:
        """Return the number of detections up to the end of each step that count at the threshold of that place."""
        order = self._order
        if self.times is None and not self._skipping:
            return order.ends + 1
        times = np.ones(len(self.scores), dtype=np.int64) if self.times is None else self.times
        if self._skipping:
            times = np.where((self.skips >> place) & 1, 0, times)
        counts: NDArray[np.int64] = np.cumsum(times[order.rows])[order.ends]
        return counts

    @cached_property
    def _skipping(self) -> bool:
        return bool(self.skips.any())

    @cached_property
    def counted(self) -> NDArray[np.int64]:
        """Number of detections that count at each threshold."""
        every = range(len(AP_THRESHOLDS))
        return np.array([self._counts(place)[-1] if len(self.scores) else 0 for place in every], dtype=np.int64)

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
        every = None if self._skipping else self._counts(0)
        for place, (rows, step) in enumerate(self._order.found):
            last = _lasts(step)
            counts = self._counts(place) if every is None else every
            found = np.cumsum(np.ones(len(rows), dtype=np.int64) if self.times is None else self.times[rows])[last]
            # Where a resample has no detection yet, nothing is found: 0 of 1.
            precision = found / np.maximum(counts[step[last]], 1)
            curves.append((found, np.maximum.accumulate(precision[::-1])[::-1]))
        return tuple(curves)

    def average_precision(self, place: int, references: int) -> float | None:
        """Return the mean precision at 101 recall points, at the threshold of that place; None without references."""
        return float(self.curve(place, references)[1].mean()) if references else None

    def curve(self, place: int, references: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the 101 recall points and the precision at each, NaN without references."""
        if not references:
            return _RECALLS, np.full(len(_RECALLS), np.nan)
        found, precision = self._envelopes[place]
        points = np.searchsorted(found / references, _RECALLS, side="left")
        return _RECALLS, np.append(precision, 0.0)[points]
