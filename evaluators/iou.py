"""The evaluator ``iou``: precision, recall and F1 at an IoU threshold, average precision, panoptic quality.

Matching is greedy: detections by falling confidence (without confidences by falling best IoU), each takes the remaining
reference with the largest IoU of at least the threshold. This is the rule of SpaceNet (Van Etten, Lindenbaum & Bacastow
2018) and of COCO (Lin et al. 2014, doi:10.1007/978-3-319-10602-1_48). With ``matching=coco`` references that are left
out are ignore regions: a detection that matches nothing else and has the threshold's IoU with one of them is left out.

Average precision follows COCO: IoU thresholds 0.50 to 0.95 in steps of 0.05, precision at 101 recall points, made
monotonic; no cap on the number of objects. Detections of equal confidence count together, so that their order in the
file changes nothing; with distinct confidences the value is COCO's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..core.parameters import parameter
from .average_precision import AP_THRESHOLDS, Ranking
from .coverage_evaluator import CoverageEvaluator
from .index import Curve, IndexGroup, index, ratio
from .overlay.coverage import CountedSets
from .overlay.coverage_verdicts import SideVerdicts, coverage_kinds, coverage_verdicts
from .overlay.greedy import accept_in_order
from .overlay.left_out import Counted, LeftOut
from .overlay.overlaps import Overlaps, overlaps_between
from .tally import Tallies
from .verdict_table import Measure, Verdicts

__all__ = ["APIndices", "IoU", "IoUIndices", "PanopticIndices"]

_COCO = "Lin et al. 2014 (COCO)"
_SPACENET = "Van Etten, Lindenbaum & Bacastow 2018 (SpaceNet)"
_Numbers: TypeAlias = NDArray[np.int64] | int
_PANOPTIC = "Kirillov et al. 2019"
#: How far the threshold is moved to find the objects that its choice decides.
_SHIFT = 0.05


@dataclass(frozen=True, kw_only=True)
class _Counts(Tallies):
    detected: int = 0
    reference: int = 0
    true_positives: int = 0
    false_positives: int = 0
    false_negatives: int = 0
    flipped: int = 0


@dataclass(frozen=True, kw_only=True)
class _Panoptic(Tallies):
    pairs: int = 0
    sum_iou: float = 0.0


@dataclass(frozen=True, kw_only=True)
class _Tallies(Tallies):
    counts: _Counts = field(default_factory=_Counts)
    panoptic: _Panoptic = field(default_factory=_Panoptic)
    left_out: LeftOut = field(default_factory=LeftOut)
    ranking: Ranking = field(default_factory=Ranking)


def _f1(t: _Tallies) -> float | None:
    counts = t.counts
    return ratio(2 * counts.true_positives, 2 * counts.true_positives + counts.false_positives + counts.false_negatives)


@dataclass(frozen=True, kw_only=True)
class IoUIndices(IndexGroup):
    """Rates at the threshold; None where undefined."""

    key = "iou"
    title = "at the threshold"

    precision: float | None = index(
        "precision",
        "higher",
        "fraction",
        lambda t: ratio(t.counts.true_positives, t.counts.detected),
        symbol="P",
        meaning="TP/(TP+FP)",
        source=_SPACENET,
    )
    recall: float | None = index(
        "recall",
        "higher",
        "fraction",
        lambda t: ratio(t.counts.true_positives, t.counts.reference),
        symbol="R",
        meaning="TP/(TP+FN)",
        source=_SPACENET,
    )
    f1: float | None = index(
        "F1", "higher", "fraction", _f1, symbol="F1", meaning="2 TP/(2 TP+FP+FN)", source=_SPACENET
    )
    flipped: float | None = index(
        "objects that the threshold decides",
        "lower",
        "fraction",
        lambda t: ratio(t.counts.flipped, t.counts.detected + t.counts.reference),
        symbol="Flip",
        meaning="objects whose verdict changes when the threshold moves by 0.05 up or down, of all objects",
    )


def _precision_at(t: _Tallies, place: int) -> float | None:
    return t.ranking.average_precision(place, t.counts.reference)


def _mean_precision(t: _Tallies) -> float | None:
    values = [_precision_at(t, place) for place in range(len(AP_THRESHOLDS))]
    return None if None in values else float(np.mean([value for value in values if value is not None]))


def _mean_recall(t: _Tallies) -> float | None:
    return ratio(float(t.ranking.found.mean()), t.counts.reference)


@dataclass(frozen=True, kw_only=True)
class APIndices(IndexGroup):
    """Average precision and recall over IoU thresholds; None without references."""

    key = "ap"
    title = "over thresholds"

    ap: float | None = index(
        "average precision",
        "higher",
        "fraction",
        _mean_precision,
        symbol="AP",
        meaning="mean of AP over IoU thresholds 0.50 to 0.95",
        source=_COCO,
    )
    ap_50: float | None = index(
        "average precision at 0.5",
        "higher",
        "fraction",
        lambda t: _precision_at(t, 0),
        symbol="AP_50",
        meaning="mean precision at 101 recall points, IoU threshold 0.5",
        source=_COCO,
    )
    ap_75: float | None = index(
        "average precision at 0.75",
        "higher",
        "fraction",
        lambda t: _precision_at(t, 5),
        symbol="AP_75",
        meaning="mean precision at 101 recall points, IoU threshold 0.75",
        source=_COCO,
    )
    ar: float | None = index(
        "average recall",
        "higher",
        "fraction",
        _mean_recall,
        symbol="AR",
        meaning="mean recall over IoU thresholds 0.50 to 0.95",
        source=_COCO,
    )


@dataclass(frozen=True, kw_only=True)
class PanopticIndices(IndexGroup):
    """Panoptic quality; None where there is no object."""

    key = "panoptic"
    title = "panoptic"

    quality: float | None = index(
        "panoptic quality",
        "higher",
        "fraction",
        lambda t: ratio(t.panoptic.sum_iou, (t.counts.detected + t.counts.reference) / 2),
        symbol="PQ",
        meaning="sum of IoU over pairs above 0.5 / (TP + FP/2 + FN/2)",
        source=_PANOPTIC,
    )


def _by_threshold(numerator: Callable[[_Tallies], _Numbers], denominator: Callable[[_Tallies], _Numbers]) -> Any:
    """Return the formula of a curve over the IoU thresholds of AP; NaN where the denominator is 0."""

    def curve(t: _Tallies) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        whole = np.broadcast_to(denominator(t), AP_THRESHOLDS.shape)
        with np.errstate(divide="ignore", invalid="ignore"):
            return AP_THRESHOLDS, np.where(whole > 0, numerator(t) / whole, np.nan)

    return curve


def _threshold_curve(key: str, title: str, meaning: str, formula: Any) -> Curve:
    return Curve(
        key=key,
        title=title,
        x="IoU threshold",
        y="share",
        x_unit="fraction",
        y_unit="fraction",
        formula=formula,
        meaning=meaning,
        source=_COCO,
        panel="threshold",
    )


def _precision_curve(key: str, threshold: str, place: int) -> Curve:
    return Curve(
        key=key,
        title=f"precision over recall, IoU {threshold}",
        x="recall",
        y="precision",
        x_unit="fraction",
        y_unit="fraction",
        formula=lambda t: t.ranking.curve(place, t.counts.reference),
        meaning="largest precision at this recall or a higher one; its mean is AP",
        source=_COCO,
        panel="recall",
    )


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Overlapping pairs in the order in which they are accepted.

    Attributes
    ----------
    detection, reference : ndarray of int64, shape (n,)
    iou : ndarray, shape (n,)
    counts : tuple of int
        Number of detections and of references.
    scores : ndarray, shape (number of detections,)
        Confidence, or best IoU.
    region : ndarray, shape (number of detections,)
        Largest IoU with an ignore region, 0 without any.
    """

    detection: NDArray[np.int64]
    reference: NDArray[np.int64]
    iou: NDArray[np.float64]
    counts: tuple[int, int]
    scores: NDArray[np.float64]
    region: NDArray[np.float64]

    def ignored(self, threshold: float, partner: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which detections match an ignore region and nothing else."""
        return (partner < 0) & (self.region >= threshold)

    def match(self, threshold: float, *, above: bool = False) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the partners at a threshold: pairs of at least (or only above) that IoU."""
        kept = self.iou > threshold if above else self.iou >= threshold
        return accept_in_order(self.detection[kept], self.reference[kept], self.counts)


@dataclass(frozen=True, kw_only=True)
class IoU(CoverageEvaluator):
    """Greedy matching by IoU: precision, recall, F1, AP, AR and panoptic quality (SpaceNet, COCO)."""

    name: ClassVar[str] = "iou"
    paper = "Van Etten, Lindenbaum & Bacastow 2018; Lin et al. 2014, doi:10.1007/978-3-319-10602-1_48"
    groups = (IoUIndices, APIndices, PanopticIndices)
    tallies_type = _Tallies
    ranked_by: ClassVar[str] = "iou.f1"
    gated_by: ClassVar[tuple[str, ...]] = ("iou.precision", "iou.recall", "ap.ap", "panoptic.quality")
    swept_by: ClassVar[tuple[str, ...]] = ("iou.f1", "ap.ap")
    verdict_kinds = coverage_kinds(
        correct=("TP", "matched detection"), excess=("FP", "unmatched detection"), missing=("FN", "unmatched reference")
    )
    measures = (
        Measure(key="iou", title="IoU", unit="fraction"),
        Measure(key="confidence", title="confidence", unit="ratio"),
    )

    curves = (
        _threshold_curve(
            "precision_by_threshold",
            "precision",
            "TP/(TP+FP) at each IoU threshold of AP",
            _by_threshold(lambda t: t.ranking.found, lambda t: t.ranking.counted),
        ),
        _threshold_curve(
            "recall_by_threshold",
            "recall",
            "TP/(TP+FN) at each IoU threshold of AP",
            _by_threshold(lambda t: t.ranking.found, lambda t: t.counts.reference),
        ),
        _threshold_curve(
            "f1_by_threshold",
            "F1",
            "2 TP/(2 TP+FP+FN) at each IoU threshold of AP",
            _by_threshold(lambda t: 2 * t.ranking.found, lambda t: t.ranking.counted + t.counts.reference),
        ),
        _precision_curve("precision_over_recall_50", "0.5", 0),
        _precision_curve("precision_over_recall_75", "0.75", 5),
    )

    threshold: float = parameter(0.5, minimum=0.01, maximum=1.0, doc="least IoU of a match", source="SpaceNet, COCO")
    matching: Literal["spacenet", "coco"] = parameter(
        "spacenet",
        choices=("spacenet", "coco"),
        doc="coco: left-out references are ignore regions at the threshold; spacenet: by any overlap",
    )
    confidence: str = parameter("confidence", doc="attribute of the detections that ranks them, where they have it")

    def measured(self, sets: CountedSets) -> tuple[Tallies, Callable[[], Verdicts]]:
        """Return the tallies of two sets, and how their verdicts are found."""
        candidates = self._candidates(sets)
        ranked = sets.detections.mask if self.matching == "spacenet" else sets.detections.code != 1
        of_detection, of_reference = candidates.match(self.threshold)
        sets = self._with_ignored(sets, candidates, of_detection)
        d, r = sets.detections.mask, sets.references.mask
        flipped = np.zeros(2, dtype=np.int64)
        moved = [candidates.match(self.threshold + shift) for shift in (-_SHIFT, _SHIFT)]
        for side, (mask, now) in enumerate(((d, of_detection), (r, of_reference))):
            changed = [(partners[side] >= 0) != (now >= 0) for partners in moved]
            flipped[side] = (np.logical_or(*changed) & mask).sum()
        hits, skips = np.zeros((2, len(sets.detected)), dtype=np.int64)
        for place, threshold in enumerate(AP_THRESHOLDS.tolist()):
            partner = candidates.match(threshold)[0]
            hits |= (partner >= 0).astype(np.int64) << place
            skips |= candidates.ignored(threshold, partner).astype(np.int64) << place
        matched = int((of_detection >= 0).sum())
        panoptic = candidates.match(0.5, above=True)[0]
        pair_iou = candidates.iou[(candidates.iou > 0.5) & (panoptic[candidates.detection] == candidates.reference)]
        tallies = _Tallies(
            counts=_Counts(
                detected=int(d.sum()),
                reference=int(r.sum()),
                true_positives=matched,
                false_positives=int(d.sum()) - matched,
                false_negatives=int(r.sum()) - matched,
                flipped=int(flipped.sum()),
            ),
            panoptic=_Panoptic(pairs=len(pair_iou), sum_iou=float(pair_iou.sum())),
            left_out=sets.left_out,
            ranking=Ranking(candidates.scores[ranked], hits[ranked], skips[ranked]),
        )
        return tallies, lambda: self._verdicts(sets, candidates, of_detection, of_reference)

    def _with_ignored(self, sets: CountedSets, candidates: _Candidates, of_detection: NDArray[np.int64]) -> CountedSets:
        """Leave out detections by their IoU with left-out references, instead of by any overlap with them."""
        if self.matching == "spacenet":
            return sets
        ignored = candidates.ignored(self.threshold, of_detection)
        code = np.where(sets.detections.code == 1, 1, np.where(ignored, 3, 0)).astype(np.int8)
        return replace(sets, detections=Counted(code))

    def _region_iou(self, sets: CountedSets) -> NDArray[np.float64]:
        """Return the largest IoU of each detection with a left-out reference; 0 unless these are ignore regions."""
        region = np.zeros(len(sets.detected))
        if self.matching == "coco" and not sets.references.mask.all():
            pairs = overlaps_between(sets.detected, sets.reference).only_significant
            pairs = pairs.where(~sets.references.mask[pairs.second])
            np.maximum.at(region, pairs.first, _iou(sets, pairs))
        return region

    def _candidates(self, sets: CountedSets) -> _Candidates:
        detected, reference, overlaps = sets.detected, sets.reference, sets.overlaps
        iou = _iou(sets, overlaps)
        best: NDArray[np.float64] = np.zeros(len(detected))
        np.maximum.at(best, overlaps.first, iou)
        given = detected.attributes.get(self.confidence)
        scores: NDArray[np.float64] = best if given is None else _numbers(given)
        x, y = np.round(detected.centres, 3).T
        rank = np.empty(len(detected), dtype=np.int64)
        rank[np.lexsort((y, x, -best, -scores))] = np.arange(len(detected))
        # Of references with equal IoU COCO takes the last one, SpaceNet the first one.
        ties = overlaps.second if self.matching == "spacenet" else -overlaps.second
        order = np.lexsort((ties, -iou, rank[overlaps.first]))
        return _Candidates(
            overlaps.first[order],
            overlaps.second[order],
            iou[order],
            (len(detected), len(reference)),
            scores,
            self._region_iou(sets),
        )

    def _verdicts(
        self,
        sets: CountedSets,
        candidates: _Candidates,
        of_detection: NDArray[np.int64],
        of_reference: NDArray[np.int64],
    ) -> Verdicts:
        sides = []
        for own, partner, rows in (
            (sets.detected, of_detection, candidates.detection),
            (sets.reference, of_reference, candidates.reference),
        ):
            best = np.zeros(len(own))
            np.maximum.at(best, rows, candidates.iou)
            words = "matched" if own is sets.detected else "found"
            sides.append(
                SideVerdicts(
                    partner >= 0,
                    [
                        f"{words}: best IoU {value:.2f}" if row >= 0 else f"not {words}: best IoU {value:.2f}"
                        for row, value in zip(partner.tolist(), best.tolist(), strict=True)
                    ],
                    {
                        "iou": best,
                        "confidence": candidates.scores if own is sets.detected else np.full(len(own), np.nan),
                    },
                    partner,
                )
            )
        return coverage_verdicts(sets, self.verdict_kinds, self.measures, detections=sides[0], references=sides[1])


def _iou(sets: CountedSets, pairs: Overlaps) -> NDArray[np.float64]:
    """Return the IoU of some pairs, rounded, so that coordinates of millions of metres decide nothing."""
    united = sets.detected.areas[pairs.first] + sets.reference.areas[pairs.second] - pairs.area
    return np.asarray(np.round(np.minimum(pairs.area / united, 1.0), 9), dtype=np.float64)


def _numbers(column: NDArray[Any]) -> NDArray[np.float64]:
    """Return an attribute as numbers; what is missing ranks last."""
    values: NDArray[np.float64] = np.ma.filled(np.ma.masked_invalid(np.ma.asarray(column, dtype=np.float64)), -1e308)
    return values
