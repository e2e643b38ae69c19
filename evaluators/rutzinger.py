"""The evaluator ``rutzinger``: object completeness and correctness by an overlap threshold.

A reference is a true positive when the detections together cover at least the threshold share of it, a detection when
the references cover that share of it: two numbers of true positives. Sources: Rottensteiner, Trinder, Clode & Kubik
2005; Rutzinger, Rottensteiner & Pfeifer 2009, doi:10.1109/JSTARS.2009.2012488; Rottensteiner et al. 2014 (the ISPRS
benchmark), doi:10.1016/j.isprsjprs.2013.10.004.

Overlap classes by share covered: none (below 10 %), weak (to 50 %), partial (to 80 %), strong.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..core.parameters import parameter
from .coverage_evaluator import CoverageEvaluator
from .index import Curve, IndexGroup, index, ratio
from .overlay.coverage import CountedSets, Coverage
from .overlay.coverage_verdicts import SideVerdicts, coverage_kinds, coverage_verdicts
from .overlay.left_out import LeftOut
from .tally import Histogram, Tallies, histogram
from .verdict_table import Measure, Verdicts

__all__ = ["Rutzinger", "RutzingerAreaIndices", "RutzingerObjectIndices"]

_SOURCE = "Rutzinger, Rottensteiner & Pfeifer 2009"
_LIMITS = np.array([0.1, 0.5, 0.8])
_CLASSES = ("none", "weak", "partial", "strong")
#: Bins of object area: 25 m2 up to 1000 m2; larger objects count in the last one.
_SIZES = histogram(low=0.0, high=1000.0, bins=40)


@dataclass(frozen=True, kw_only=True)
class _Counts(Tallies):
    detected: int = 0
    reference: int = 0
    reference_true_positives: int = 0
    detection_true_positives: int = 0
    false_negatives: int = 0
    false_positives: int = 0


@dataclass(frozen=True, kw_only=True)
class _Classes(Tallies):
    none: int = 0
    weak: int = 0
    partial: int = 0
    strong: int = 0

    @classmethod
    def of(cls, shares: NDArray[np.float64]) -> _Classes:
        numbers = np.bincount(np.searchsorted(_LIMITS, shares, side="right"), minlength=4).tolist()
        return cls(**dict(zip(_CLASSES, numbers, strict=True)))


@dataclass(frozen=True, kw_only=True)
class _Topology(Tallies):
    one_to_one: int = 0
    splits: int = 0
    merges: int = 0
    many_to_many: int = 0


@dataclass(frozen=True, kw_only=True)
class _Areas(Tallies):
    detected: float = 0.0
    detected_covered: float = 0.0
    reference: float = 0.0
    reference_covered: float = 0.0


@dataclass(frozen=True, kw_only=True)
class _Tallies(Tallies):
    counts: _Counts = field(default_factory=_Counts)
    reference_classes: _Classes = field(default_factory=_Classes)
    detection_classes: _Classes = field(default_factory=_Classes)
    topology: _Topology = field(default_factory=_Topology)
    areas: _Areas = field(default_factory=_Areas)
    left_out: LeftOut = field(default_factory=LeftOut)
    reference_sizes: Histogram = field(default_factory=_SIZES)
    reference_sizes_found: Histogram = field(default_factory=_SIZES)
    detection_sizes: Histogram = field(default_factory=_SIZES)
    detection_sizes_correct: Histogram = field(default_factory=_SIZES)


def _quality(completeness: float | None, correctness: float | None) -> float | None:
    """Return 1/(1/completeness + 1/correctness - 1), 0 where either is 0, None where either is undefined."""
    if completeness is None or correctness is None:
        return None
    if not completeness or not correctness:
        return 0.0
    return 1 / (1 / completeness + 1 / correctness - 1)


def _completeness(t: _Tallies) -> float | None:
    return ratio(t.counts.reference_true_positives, t.counts.reference)


def _correctness(t: _Tallies) -> float | None:
    return ratio(t.counts.detection_true_positives, t.counts.detected)


@dataclass(frozen=True, kw_only=True)
class RutzingerObjectIndices(IndexGroup):
    """Rates of objects; None where undefined."""

    key = "object"
    title = "objects"

    completeness: float | None = index(
        "completeness", "higher", "fraction", _completeness, symbol="Comp", meaning="TP_ref/|R|", source=_SOURCE
    )
    correctness: float | None = index(
        "correctness", "higher", "fraction", _correctness, symbol="Corr", meaning="TP_det/|D|", source=_SOURCE
    )
    quality: float | None = index(
        "quality",
        "higher",
        "fraction",
        lambda t: _quality(_completeness(t), _correctness(t)),
        symbol="Qual",
        meaning="1/(1/Comp + 1/Corr - 1)",
        source=_SOURCE,
    )
    splits: float | None = index(
        "splits",
        "lower",
        "count",
        lambda t: float(t.topology.splits),
        symbol="1:M",
        meaning="groups of one reference and several detections that overlap it",
        source=_SOURCE,
    )
    merges: float | None = index(
        "merges",
        "lower",
        "count",
        lambda t: float(t.topology.merges),
        symbol="N:1",
        meaning="groups of several references and one detection",
        source=_SOURCE,
    )
    many_to_many: float | None = index(
        "many to many",
        "lower",
        "count",
        lambda t: float(t.topology.many_to_many),
        symbol="N:M",
        meaning="groups of several references and several detections",
        source=_SOURCE,
    )


def _area_completeness(t: _Tallies) -> float | None:
    return ratio(t.areas.reference_covered, t.areas.reference)


def _area_correctness(t: _Tallies) -> float | None:
    return ratio(t.areas.detected_covered, t.areas.detected)


@dataclass(frozen=True, kw_only=True)
class RutzingerAreaIndices(IndexGroup):
    """Rates of area, summed over objects; None where undefined."""

    key = "area"
    title = "area"

    completeness: float | None = index(
        "area completeness",
        "higher",
        "fraction",
        _area_completeness,
        symbol="Comp_a",
        meaning="covered area of the references, of their area",
        source=_SOURCE,
    )
    correctness: float | None = index(
        "area correctness",
        "higher",
        "fraction",
        _area_correctness,
        symbol="Corr_a",
        meaning="covered area of the detections, of their area",
        source=_SOURCE,
    )
    quality: float | None = index(
        "area quality",
        "higher",
        "fraction",
        lambda t: _quality(_area_completeness(t), _area_correctness(t)),
        symbol="Qual_a",
        meaning="1/(1/Comp_a + 1/Corr_a - 1)",
        source=_SOURCE,
    )


def _by_size(
    part: Callable[[_Tallies], Histogram], whole: Callable[[_Tallies], Histogram]
) -> Callable[[_Tallies], tuple[NDArray[np.float64], NDArray[np.float64]]]:
    def curve(t: _Tallies) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        edges, counts = whole(t).edges, whole(t).counts
        shares = np.where(counts > 0, part(t).counts / np.maximum(counts, 1), np.nan)
        return (edges[:-1] + edges[1:]) / 2, shares

    return curve


@dataclass(frozen=True, kw_only=True)
class Rutzinger(CoverageEvaluator):
    """Threshold-based object evaluation (Rottensteiner et al. 2005, 2014; Rutzinger et al. 2009)."""

    name: ClassVar[str] = "rutzinger"
    paper = "Rutzinger, Rottensteiner & Pfeifer 2009, doi:10.1109/JSTARS.2009.2012488"
    groups = (RutzingerObjectIndices, RutzingerAreaIndices)
    tallies_type = _Tallies
    ranked_by: ClassVar[str] = "object.quality"
    gated_by: ClassVar[tuple[str, ...]] = (
        "object.completeness",
        "object.correctness",
        "area.completeness",
        "area.correctness",
    )
    verdict_kinds = coverage_kinds(
        correct=("TP", "correct detection"), excess=("FP", "false detection"), missing=("FN", "missed reference")
    )
    measures = (
        Measure(key="covered", title="share covered", unit="fraction"),
        Measure(key="touched", title="footprints on the other side", unit="count"),
    )
    curves = (
        Curve(
            key="completeness_by_area",
            title="completeness by building area",
            x="area of the reference",
            y="completeness",
            x_unit="m2",
            y_unit="fraction",
            formula=_by_size(lambda t: t.reference_sizes_found, lambda t: t.reference_sizes),
            meaning="TP_ref/|R| of references in bins of 25 m2; from 975 m2 on in the last bin",
            source=_SOURCE,
        ),
        Curve(
            key="correctness_by_area",
            title="correctness by building area",
            x="area of the detection",
            y="correctness",
            x_unit="m2",
            y_unit="fraction",
            formula=_by_size(lambda t: t.detection_sizes_correct, lambda t: t.detection_sizes),
            meaning="TP_det/|D| of detections in bins of 25 m2; from 975 m2 on in the last bin",
            source=_SOURCE,
        ),
    )

    threshold: float = parameter(
        0.5, minimum=0.0, maximum=1.0, doc="share of an object's area that must be covered", source="2009 paper"
    )

    def measured(self, sets: CountedSets) -> tuple[Tallies, Callable[[], Verdicts]]:
        """Return the tallies of two sets, and how their verdicts are found."""
        d, r = sets.detections.mask, sets.references.mask
        correct, found = (self._true(coverage) for coverage in (sets.of_detections, sets.of_references))
        no_sizes = _SIZES()
        tallies = _Tallies(
            counts=_Counts(
                detected=int(d.sum()),
                reference=int(r.sum()),
                reference_true_positives=int((found & r).sum()),
                detection_true_positives=int((correct & d).sum()),
                false_negatives=int((~found & r).sum()),
                false_positives=int((~correct & d).sum()),
            ),
            reference_classes=_Classes.of(sets.of_references.share[r]),
            detection_classes=_Classes.of(sets.of_detections.share[d]),
            topology=_topology(sets),
            areas=_Areas(
                detected=float(sets.detected.areas[d].sum()),
                detected_covered=float((sets.detected.areas * sets.of_detections.share)[d].sum()),
                reference=float(sets.reference.areas[r].sum()),
                reference_covered=float((sets.reference.areas * sets.of_references.share)[r].sum()),
            ),
            left_out=sets.left_out,
            reference_sizes=no_sizes.filled(sets.reference.areas[r]),
            reference_sizes_found=no_sizes.filled(sets.reference.areas[r & found]),
            detection_sizes=no_sizes.filled(sets.detected.areas[d]),
            detection_sizes_correct=no_sizes.filled(sets.detected.areas[d & correct]),
        )
        return tallies, lambda: self._verdicts(sets)

    def _true(self, coverage: Coverage) -> NDArray[np.bool_]:
        # An object that nothing overlaps is no true positive, even at a threshold of 0.
        true: NDArray[np.bool_] = (coverage.share >= self.threshold) & (coverage.touched > 0)
        return true

    def _verdicts(self, sets: CountedSets) -> Verdicts:
        sides = [self._side(coverage) for coverage in (sets.of_detections, sets.of_references)]
        return coverage_verdicts(sets, self.verdict_kinds, self.measures, detections=sides[0], references=sides[1])

    def _side(self, coverage: Coverage) -> SideVerdicts:
        classes = np.searchsorted(_LIMITS, coverage.share, side="right").tolist()
        rows = zip(coverage.share.tolist(), coverage.touched.tolist(), classes, strict=True)
        return SideVerdicts(
            self._true(coverage),
            [
                f"{100 * share:.0f} % covered by {touched} on the other side: overlap {_CLASSES[place]}"
                for share, touched, place in rows
            ],
            {"covered": coverage.share, "touched": coverage.touched.astype(np.float64)},
        )


def _topology(sets: CountedSets) -> _Topology:
    """Count connected groups of the overlap graph by their numbers of references and detections."""
    n_detected, count = len(sets.detected), len(sets.detected) + len(sets.reference)
    rows, columns = sets.overlaps.first, sets.overlaps.second + n_detected
    graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(count, count))
    groups, label = connected_components(graph, directed=False)
    of_d = np.bincount(label[:n_detected], minlength=groups)
    of_r = np.bincount(label[n_detected:], minlength=groups)
    return _Topology(
        one_to_one=int(((of_d == 1) & (of_r == 1)).sum()),
        splits=int(((of_d > 1) & (of_r == 1)).sum()),
        merges=int(((of_d == 1) & (of_r > 1)).sum()),
        many_to_many=int(((of_d > 1) & (of_r > 1)).sum()),
    )
