"""The evaluator ``shufelt``: detection against the required overlap, without choosing a threshold.

For a required overlap t from 0 to 100 %: the share of references of which the detections cover at least t, and the
share of detections of which the references cover at least t. The area under such a curve is the mean share covered.
Source: Shufelt 1999, doi:10.1109/34.761262.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from .coverage_evaluator import CoverageEvaluator
from .index import Curve, IndexGroup, index, ratio
from .overlay.coverage import CountedSets, Coverage
from .overlay.coverage_verdicts import SideVerdicts, coverage_kinds, coverage_verdicts
from .overlay.left_out import Counted, LeftOut
from .tally import Histogram, Tallies, histogram
from .verdict_table import Measure, Verdicts

__all__ = ["Shufelt", "ShufeltDetectionIndices", "ShufeltReferenceIndices"]

_SOURCE = "Shufelt 1999"
_SHARES = histogram(low=0.0, high=1.0, bins=100)
#: Shares from here on are whole coverage: the rest is the rounding of areas.
_WHOLE = 1 - 1e-9


@dataclass(frozen=True, kw_only=True)
class _Counts(Tallies):
    detected: int = 0
    reference: int = 0
    references_touched: int = 0
    references_whole: int = 0
    detections_touched: int = 0
    detections_whole: int = 0


@dataclass(frozen=True, kw_only=True)
class _Tallies(Tallies):
    counts: _Counts = field(default_factory=_Counts)
    left_out: LeftOut = field(default_factory=LeftOut)
    reference_shares: Histogram = field(default_factory=_SHARES)
    detection_shares: Histogram = field(default_factory=_SHARES)


def _at_least(shares: Histogram, percent: int) -> float | None:
    return ratio(float(shares.counts[percent:].sum()), shares.total)


@dataclass(frozen=True, kw_only=True)
class ShufeltReferenceIndices(IndexGroup):
    """How much of the references is covered; None where there is none."""

    key = "reference"
    title = "references covered"

    area_under_curve: float | None = index(
        "area under the reference curve",
        "higher",
        "fraction",
        lambda t: t.reference_shares.mean,
        symbol="A_r",
        meaning="mean share of a reference that the detections cover",
        source=_SOURCE,
    )
    at_half: float | None = index(
        "references half covered",
        "higher",
        "fraction",
        lambda t: _at_least(t.reference_shares, 50),
        symbol="R_50",
        meaning="references of which at least 50 % is covered, of all references",
        source=_SOURCE,
    )


@dataclass(frozen=True, kw_only=True)
class ShufeltDetectionIndices(IndexGroup):
    """How much of the detections is supported by references; None where there is none."""

    key = "detection"
    title = "detections supported"

    area_under_curve: float | None = index(
        "area under the detection curve",
        "higher",
        "fraction",
        lambda t: t.detection_shares.mean,
        symbol="A_d",
        meaning="mean share of a detection that the references cover",
        source=_SOURCE,
    )
    at_half: float | None = index(
        "detections half supported",
        "higher",
        "fraction",
        lambda t: _at_least(t.detection_shares, 50),
        symbol="D_50",
        meaning="detections of which at least 50 % is covered, of all detections",
        source=_SOURCE,
    )


def _curve(
    shares: Callable[[_Tallies], Histogram],
    touched: Callable[[_Tallies], int],
    whole: Callable[[_Tallies], int],
) -> Callable[[_Tallies], tuple[NDArray[np.float64], NDArray[np.float64]]]:
    def curve(t: _Tallies) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        counts, total = shares(t).counts, shares(t).total
        at_least = np.concatenate([[touched(t)], np.cumsum(counts[::-1])[::-1][1:], [whole(t)]])
        return np.linspace(0, 1, 101), at_least / total if total else np.full(101, np.nan)

    return curve


@dataclass(frozen=True, kw_only=True)
class Shufelt(CoverageEvaluator):
    """Curves over the required overlap and the area under them (Shufelt 1999)."""

    name: ClassVar[str] = "shufelt"
    paper = "Shufelt 1999, doi:10.1109/34.761262"
    groups = (ShufeltReferenceIndices, ShufeltDetectionIndices)
    tallies_type = _Tallies
    ranked_by: ClassVar[str] = "reference.area_under_curve"
    gated_by: ClassVar[tuple[str, ...]] = ("reference.area_under_curve", "detection.area_under_curve")
    swept_by: ClassVar[tuple[str, ...]] = ("reference.area_under_curve", "detection.area_under_curve")
    verdict_kinds = coverage_kinds(
        correct=("covered", "detection on a reference"),
        excess=("unsupported", "detection without reference"),
        missing=("uncovered", "reference without detection"),
    )
    measures = (Measure(key="covered", title="share covered", unit="fraction"),)
    curves = tuple(
        Curve(
            key=f"{side}s_covered",
            title=f"{side}s covered at least so much",
            x="required overlap",
            y=f"share of the {side}s",
            x_unit="fraction",
            y_unit="fraction",
            formula=formula,
            meaning=f"{side}s of which at least the required share is covered, at 0 by any overlap",
            source=_SOURCE,
        )
        for side, formula in (
            (
                "reference",
                _curve(
                    lambda t: t.reference_shares,
                    lambda t: t.counts.references_touched,
                    lambda t: t.counts.references_whole,
                ),
            ),
            (
                "detection",
                _curve(
                    lambda t: t.detection_shares,
                    lambda t: t.counts.detections_touched,
                    lambda t: t.counts.detections_whole,
                ),
            ),
        )
    )

    def measured(self, sets: CountedSets) -> tuple[Tallies, Callable[[], Verdicts]]:
        """Return the tallies of two sets, and how their verdicts are found."""
        of_d, of_r = (
            _shares(*pair) for pair in ((sets.of_detections, sets.detections), (sets.of_references, sets.references))
        )
        counts = _Counts(
            detected=len(of_d),
            reference=len(of_r),
            references_touched=int((of_r > 0).sum()),
            references_whole=int((of_r >= _WHOLE).sum()),
            detections_touched=int((of_d > 0).sum()),
            detections_whole=int((of_d >= _WHOLE).sum()),
        )
        tallies = _Tallies(
            counts=counts,
            left_out=sets.left_out,
            reference_shares=_SHARES().filled(of_r),
            detection_shares=_SHARES().filled(of_d),
        )
        return tallies, lambda: self._verdicts(sets)

    def _verdicts(self, sets: CountedSets) -> Verdicts:
        sides = [
            SideVerdicts(
                coverage.touched > 0,
                [f"{100 * share:.0f} % covered" for share in coverage.share.tolist()],
                {"covered": coverage.share},
            )
            for coverage in (sets.of_detections, sets.of_references)
        ]
        return coverage_verdicts(sets, self.verdict_kinds, self.measures, detections=sides[0], references=sides[1])


def _shares(coverage: Coverage, counted: Counted) -> NDArray[np.float64]:
    return coverage.share[counted.mask]
