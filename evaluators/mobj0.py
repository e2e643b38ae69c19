"""The evaluator ``mobj0``: how many footprints have any counterpart at all (IGN, CoClico).

A reference is *paired* when any detection overlaps it. Objects without a counterpart count on both sides:
``metric = paired / (paired + references without + detections without)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from .coverage_evaluator import CoverageEvaluator
from .index import IndexGroup, index, ratio
from .overlay.coverage import CountedSets
from .overlay.coverage_verdicts import SideVerdicts, coverage_kinds, coverage_verdicts
from .overlay.left_out import LeftOut
from .tally import Tallies
from .verdict_table import Measure, Verdicts

__all__ = ["Mobj0", "Mobj0Indices"]

_SOURCE = "IGN CoClico, metric mobj0"


@dataclass(frozen=True, kw_only=True)
class _Counts(Tallies):
    detected: int = 0
    reference: int = 0
    paired: int = 0
    false_negatives: int = 0
    false_positives: int = 0


@dataclass(frozen=True, kw_only=True)
class _Tallies(Tallies):
    counts: _Counts = field(default_factory=_Counts)
    left_out: LeftOut = field(default_factory=LeftOut)


@dataclass(frozen=True, kw_only=True)
class Mobj0Indices(IndexGroup):
    """The metric and the shares of objects with a counterpart."""

    key = "mobj0"
    title = "counterparts"

    metric: float | None = index(
        "mobj0",
        "higher",
        "fraction",
        lambda t: ratio(t.counts.paired, t.counts.paired + t.counts.false_negatives + t.counts.false_positives),
        symbol="mobj0",
        meaning="paired references, of these and all objects without a counterpart",
        source=_SOURCE,
    )
    paired: float | None = index(
        "references paired",
        "higher",
        "fraction",
        lambda t: ratio(t.counts.paired, t.counts.reference),
        symbol="P_r",
        meaning="references that a detection overlaps, of all references",
        source=_SOURCE,
    )
    supported: float | None = index(
        "detections paired",
        "higher",
        "fraction",
        lambda t: ratio(t.counts.detected - t.counts.false_positives, t.counts.detected),
        symbol="P_d",
        meaning="detections that a reference overlaps, of all detections",
        source=_SOURCE,
    )


@dataclass(frozen=True, kw_only=True)
class Mobj0(CoverageEvaluator):
    """Objects with and without a counterpart (IGN, CoClico)."""

    name: ClassVar[str] = "mobj0"
    groups = (Mobj0Indices,)
    tallies_type = _Tallies
    ranked_by: ClassVar[str] = "mobj0.metric"
    verdict_kinds = coverage_kinds(
        correct=("paired", "detection on a reference"),
        excess=("FP", "detection alone"),
        missing=("FN", "reference alone"),
    )
    measures = (Measure(key="touched", title="footprints on the other side", unit="count"),)

    def measured(self, sets: CountedSets) -> tuple[Tallies, Callable[[], Verdicts]]:
        """Return the tallies of two sets, and how their verdicts are found."""
        paired = sets.references.mask & (sets.of_references.touched > 0)
        supported = sets.detections.mask & (sets.of_detections.touched > 0)
        counts = _Counts(
            detected=int(sets.detections.mask.sum()),
            reference=int(sets.references.mask.sum()),
            paired=int(paired.sum()),
            false_negatives=int((sets.references.mask & ~paired).sum()),
            false_positives=int((sets.detections.mask & ~supported).sum()),
        )
        return _Tallies(counts=counts, left_out=sets.left_out), lambda: self._verdicts(sets)

    def _verdicts(self, sets: CountedSets) -> Verdicts:
        sides = [
            SideVerdicts(
                coverage.touched > 0,
                [f"overlaps {number} on the other side" for number in coverage.touched.tolist()],
                {"touched": coverage.touched.astype(np.float64)},
            )
            for coverage in (sets.of_detections, sets.of_references)
        ]
        return coverage_verdicts(sets, self.verdict_kinds, self.measures, detections=sides[0], references=sides[1])
