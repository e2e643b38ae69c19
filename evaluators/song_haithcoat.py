"""The evaluator ``song-haithcoat``: detection by any overlap, and differences of matched footprints.

Each reference is compared with the detection that shares the most area with it. Source: Song & Haithcoat 2005,
doi:10.1109/TGRS.2004.841627. The paper's formula of shape similarity is not implemented: the compactness ratio has its
own name.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import shapely
from numpy.typing import NDArray

from .coverage_evaluator import CoverageEvaluator
from .index import IndexGroup, index, ratio
from .overlay.coverage import CountedSets
from .overlay.coverage_verdicts import SideVerdicts, coverage_kinds, coverage_verdicts
from .overlay.left_out import LeftOut
from .overlay.pair_shapes import corner_counts
from .tally import Tallies
from .verdict_table import Measure, Verdicts

__all__ = ["DetectionIndices", "OverlayIndices", "ShapeIndices", "SongHaithcoat"]

_SOURCE = "Song & Haithcoat 2005"


@dataclass(frozen=True, kw_only=True)
class _Counts(Tallies):
    detected: int = 0
    reference: int = 0
    true_positives: int = 0
    false_negatives: int = 0
    false_positives: int = 0


@dataclass(frozen=True, kw_only=True)
class _Sums(Tallies):
    shared: float = 0.0
    reference_area: float = 0.0
    detected_area: float = 0.0
    corner_difference: int = 0
    area_difference: float = 0.0
    perimeter_difference: float = 0.0
    compactness_ratio: float = 0.0


@dataclass(frozen=True, kw_only=True)
class _Tallies(Tallies):
    counts: _Counts = field(default_factory=_Counts)
    sums: _Sums = field(default_factory=_Sums)
    left_out: LeftOut = field(default_factory=LeftOut)


@dataclass(frozen=True, kw_only=True)
class DetectionIndices(IndexGroup):
    """Objects with any overlap; None where undefined."""

    key = "detection"
    title = "objects"

    rate: float | None = index(
        "detection rate",
        "higher",
        "fraction",
        lambda t: ratio(t.counts.true_positives, t.counts.reference),
        symbol="D_r",
        meaning="references that a detection overlaps, of all references",
        source=_SOURCE,
    )
    correctness: float | None = index(
        "detection correctness",
        "higher",
        "fraction",
        lambda t: ratio(t.counts.detected - t.counts.false_positives, t.counts.detected),
        symbol="D_c",
        meaning="detections that a reference overlaps, of all detections",
        source=_SOURCE,
    )


@dataclass(frozen=True, kw_only=True)
class OverlayIndices(IndexGroup):
    """Areas of the pairs, summed before the ratio; None without a pair."""

    key = "overlay"
    title = "area of pairs"

    matched: float | None = index(
        "matched overlay",
        "higher",
        "fraction",
        lambda t: ratio(t.sums.shared, t.sums.reference_area),
        symbol="M_o",
        meaning="sum of |d and r| / sum of |r|",
        source=_SOURCE,
    )
    omission: float | None = index(
        "area omission error of pairs",
        "lower",
        "fraction",
        lambda t: ratio(max(t.sums.reference_area - t.sums.shared, 0.0), t.sums.reference_area),
        symbol="A_om",
        meaning="sum of |r - d| / sum of |r|",
        source=_SOURCE,
    )
    commission: float | None = index(
        "area commission error of pairs",
        "lower",
        "fraction",
        lambda t: ratio(max(t.sums.detected_area - t.sums.shared, 0.0), t.sums.detected_area),
        symbol="A_co",
        meaning="sum of |d - r| / sum of |d|",
        source=_SOURCE,
    )


@dataclass(frozen=True, kw_only=True)
class ShapeIndices(IndexGroup):
    """Mean differences of the pairs; None without a pair."""

    key = "shape"
    title = "shape of pairs"

    corner_difference: float | None = index(
        "corner difference",
        "lower",
        "ratio",
        lambda t: ratio(t.sums.corner_difference, t.counts.true_positives),
        symbol="dN",
        meaning="mean of the difference in the number of corners, without sign",
        source=_SOURCE,
    )
    area_difference: float | None = index(
        "area difference",
        "lower",
        "ratio",
        lambda t: ratio(t.sums.area_difference, t.counts.true_positives),
        symbol="dA",
        meaning="mean of the difference in area, without sign, relative to the reference",
        source=_SOURCE,
    )
    perimeter_difference: float | None = index(
        "perimeter difference",
        "lower",
        "ratio",
        lambda t: ratio(t.sums.perimeter_difference, t.counts.true_positives),
        symbol="dP",
        meaning="mean of the difference in perimeter, without sign, relative to the reference",
        source=_SOURCE,
    )
    compactness_ratio: float | None = index(
        "compactness ratio",
        "neither",
        "ratio",
        lambda t: ratio(t.sums.compactness_ratio, t.counts.true_positives),
        symbol="C_ratio",
        meaning="mean of compactness of the detection / of the reference, compactness = 4 pi area / perimeter^2",
    )


def _compactness(polygons: NDArray[np.object_]) -> NDArray[np.float64]:
    values: NDArray[np.float64] = 4 * math.pi * shapely.area(polygons) / shapely.length(polygons) ** 2
    return values


@dataclass(frozen=True, kw_only=True)
class SongHaithcoat(CoverageEvaluator):
    """Detection by any overlap, and area and shape of pairs (Song & Haithcoat 2005)."""

    name: ClassVar[str] = "song-haithcoat"
    paper = "Song & Haithcoat 2005, doi:10.1109/TGRS.2004.841627"
    groups = (DetectionIndices, OverlayIndices, ShapeIndices)
    tallies_type = _Tallies
    ranked_by: ClassVar[str] = "detection.rate"
    gated_by: ClassVar[tuple[str, ...]] = (
        "detection.rate",
        "detection.correctness",
        "overlay.matched",
        "overlay.commission",
    )
    verdict_kinds = coverage_kinds(
        correct=("TP", "detection on a reference"),
        excess=("FP", "detection without reference"),
        missing=("FN", "missed reference"),
    )
    measures = (
        Measure(key="overlap_area", title="shared area", unit="m2"),
        Measure(key="corners", title="corners", unit="count"),
        Measure(key="compactness", title="compactness", unit="ratio"),
    )

    def measured(self, sets: CountedSets) -> tuple[Tallies, Callable[[], Verdicts]]:
        """Return the tallies of two sets, and how their verdicts are found."""
        found = np.flatnonzero(sets.references.mask & (sets.of_references.partner >= 0))
        partner = sets.of_references.partner[found]
        r, d = sets.reference.polygons[found], sets.detected.polygons[partner]
        area_r, area_d = sets.reference.areas[found], sets.detected.areas[partner]
        length_r, length_d = shapely.length(r), shapely.length(d)
        d_count, r_count = int(sets.detections.mask.sum()), int(sets.references.mask.sum())
        tallies = _Tallies(
            counts=_Counts(
                detected=d_count,
                reference=r_count,
                true_positives=len(found),
                false_negatives=r_count - len(found),
                false_positives=int((sets.detections.mask & (sets.of_detections.touched == 0)).sum()),
            ),
            sums=_Sums(
                shared=float(sets.of_references.shared[found].sum()),
                reference_area=float(area_r.sum()),
                detected_area=float(area_d.sum()),
                corner_difference=int(np.abs(corner_counts(d) - corner_counts(r)).sum()),
                area_difference=float((np.abs(area_d - area_r) / area_r).sum()),
                perimeter_difference=float((np.abs(length_d - length_r) / length_r).sum()),
                compactness_ratio=float((_compactness(d) / _compactness(r)).sum()),
            ),
            left_out=sets.left_out,
        )
        return tallies, lambda: self._verdicts(sets)

    def _verdicts(self, sets: CountedSets) -> Verdicts:
        sides = [
            SideVerdicts(
                coverage.touched > 0,
                [
                    f"shares {area:.1f} m2 with its main partner" if number else "overlaps nothing"
                    for area, number in zip(coverage.shared.tolist(), coverage.touched.tolist(), strict=True)
                ],
                {
                    "overlap_area": np.where(coverage.touched > 0, coverage.shared, np.nan),
                    "corners": corner_counts(own.polygons).astype(np.float64),
                    "compactness": _compactness(own.polygons),
                },
            )
            for own, coverage in ((sets.detected, sets.of_detections), (sets.reference, sets.of_references))
        ]
        return coverage_verdicts(sets, self.verdict_kinds, self.measures, detections=sides[0], references=sides[1])
