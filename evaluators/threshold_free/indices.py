"""The 15 indices of the threshold-free evaluation and their named variants, each with its formula.

Source: Awrangjeb, Ravanbakhsh & Fraser 2010, section 4.2. Every index is a function of `ThresholdFreeTallies`, which
add up over scenes; 0/0 is undefined and given as None.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..index import Better, Formula, IndexGroup, index, ratio
from . import area_formulas
from .tallies import ThresholdFreeTallies

__all__ = [
    "GROUPS",
    "BuildingIndices",
    "GeometricIndices",
    "MultipleAsCorrectIndices",
    "ObjectIndices",
    "PixelIndices",
    "PixelLiteralIndices",
]

_PAPER = "Awrangjeb, Ravanbakhsh & Fraser 2010"
_YU = "Yu et al. 2013, table 1 (reading)"


def _main(title: str, symbol: str, better: Better, unit: str, formula: Formula, *, meaning: str, place: str) -> Any:
    return index(title, better, unit, formula, symbol=symbol, meaning=meaning, source=f"{_PAPER}, {place}")


def _variant(
    title: str, better: Better, unit: str, formula: Formula, *, meaning: str, source: str = "roofbench"
) -> Any:
    return index(title, better, unit, formula, meaning=meaning, source=source, main=False)


def _root(value: float | None) -> float | None:
    return None if value is None else math.sqrt(value)


def _not_false(tallies: ThresholdFreeTallies) -> int:
    """Return |D| - FP, the detections that count as correct where multiple detections do."""
    return tallies.counts.detected - tallies.counts.false_positives


@dataclass(frozen=True, kw_only=True)
class ObjectIndices(IndexGroup):
    """The seven object indices, as fractions; None where undefined."""

    key = "object"
    title = "objects"

    completeness: float | None = _main(
        "completeness",
        "C_m",
        "higher",
        "fraction",
        lambda t: ratio(t.counts.true_positives, t.counts.true_positives + t.counts.false_negatives),
        meaning="TP/(TP+FN)",
        place="4.2.1",
    )
    correctness: float | None = _main(
        "correctness",
        "C_r",
        "higher",
        "fraction",
        lambda t: ratio(t.counts.true_positives, t.counts.true_positives + t.counts.false_positives),
        meaning="TP/(TP+FP)",
        place="4.2.1",
    )
    quality: float | None = _main(
        "quality",
        "Q_l",
        "higher",
        "fraction",
        lambda t: ratio(
            t.counts.true_positives,
            t.counts.true_positives + t.counts.false_positives + t.counts.false_negatives,
        ),
        meaning="TP/(TP+FP+FN)",
        place="4.2.1",
    )
    multiple_detection_rate: float | None = _main(
        "multiple detection rate",
        "M_d",
        "lower",
        "fraction",
        lambda t: ratio(t.counts.multiple_detections, t.counts.detected),
        meaning="unmatched detections that overlap a reference, of all detections",
        place="4.2.1, equation 1",
    )
    detection_overlap_rate: float | None = _main(
        "detection overlap rate",
        "D_o",
        "lower",
        "fraction",
        lambda t: ratio(t.counts.overlapping_detections, t.counts.detected),
        meaning="detections that overlap another one, natural overlap excluded, of all detections",
        place="4.2.1, equation 2",
    )
    detection_cross_lap_rate: float | None = _main(
        "detection cross-lap rate",
        "C_rd",
        "lower",
        "fraction",
        lambda t: ratio(t.counts.cross_lapping_detections, t.counts.detected),
        meaning="detections that overlap references of more than one building, of all detections",
        place="4.2.1, equation 3",
    )
    reference_cross_lap_rate: float | None = _main(
        "reference cross-lap rate",
        "C_rr",
        "lower",
        "fraction",
        lambda t: ratio(t.counts.cross_lapped_references, t.counts.reference),
        meaning="references overlapped by more than one detection, natural overlap excluded, of all references",
        place="4.2.1, equation 4",
    )


@dataclass(frozen=True, kw_only=True)
class PixelIndices(IndexGroup):
    """The seven pixel (area) indices and two variants; None where undefined.

    T, F and M are the areas of true positives, false positives and false negatives; see `overlay.areas`.
    """

    key = "pixel"
    title = "area"

    completeness: float | None = _main(
        "pixel completeness",
        "C_mp",
        "higher",
        "fraction",
        lambda t: area_formulas.area_completeness(t.areas),
        meaning="T/(T+M)",
        place="4.2.2",
    )
    correctness: float | None = _main(
        "pixel correctness",
        "C_rp",
        "higher",
        "fraction",
        lambda t: area_formulas.area_correctness(t.areas),
        meaning="T/(T+F)",
        place="4.2.2",
    )
    quality: float | None = _main(
        "pixel quality",
        "Q_lp",
        "higher",
        "fraction",
        lambda t: area_formulas.area_quality(t.areas),
        meaning="T/(T+F+M)",
        place="4.2.2",
    )
    area_omission_error: float | None = _main(
        "area omission error",
        "A_oe",
        "lower",
        "fraction",
        lambda t: area_formulas.area_omission(t.areas),
        meaning="M/(T+M)",
        place="4.2.2",
    )
    area_commission_error: float | None = _main(
        "area commission error",
        "A_ce",
        "lower",
        "fraction",
        lambda t: area_formulas.area_commission(t.areas),
        meaning="F/(T+F)",
        place="4.2.2",
    )
    branching_factor: float | None = _main(
        "branching factor",
        "B_f",
        "lower",
        "ratio",
        lambda t: area_formulas.branching(t.areas),
        meaning="F/T",
        place="4.2.2",
    )
    miss_factor: float | None = _main(
        "miss factor",
        "M_f",
        "lower",
        "ratio",
        lambda t: area_formulas.miss(t.areas),
        meaning="M/T",
        place="4.2.2",
    )
    area_omission_error_matched: float | None = _variant(
        "area omission error of pairs",
        "lower",
        "fraction",
        lambda t: ratio(t.areas.pair_reference - t.areas.pair_shared, t.areas.pair_reference),
        meaning="part of the references of TP pairs that their detections leave uncovered",
    )
    area_commission_error_matched: float | None = _variant(
        "area commission error of pairs",
        "lower",
        "fraction",
        lambda t: ratio(t.areas.pair_detected - t.areas.pair_shared, t.areas.pair_detected),
        meaning="part of the detections of TP pairs that lies beyond their references",
    )


_LITERAL = f"{_PAPER}, 4.2.2 (literal text)"


@dataclass(frozen=True, kw_only=True)
class PixelLiteralIndices(IndexGroup):
    """The seven pixel (area) indices by the literal text: T, F and M summed entity by entity; None where undefined.

    "The rest" of each true positive counts as false although another entity covers it correctly; only what parts of
    one building share counts once.
    """

    key = "pixel_literal"
    title = "area, literal"

    completeness: float | None = _variant(
        "pixel completeness, literal",
        "higher",
        "fraction",
        lambda t: area_formulas.area_completeness(t.literal_areas),
        meaning="T/(T+M), entity by entity",
        source=_LITERAL,
    )
    correctness: float | None = _variant(
        "pixel correctness, literal",
        "higher",
        "fraction",
        lambda t: area_formulas.area_correctness(t.literal_areas),
        meaning="T/(T+F), entity by entity",
        source=_LITERAL,
    )
    quality: float | None = _variant(
        "pixel quality, literal",
        "higher",
        "fraction",
        lambda t: area_formulas.area_quality(t.literal_areas),
        meaning="T/(T+F+M), entity by entity",
        source=_LITERAL,
    )
    area_omission_error: float | None = _variant(
        "area omission error, literal",
        "lower",
        "fraction",
        lambda t: area_formulas.area_omission(t.literal_areas),
        meaning="M/(T+M), entity by entity",
        source=_LITERAL,
    )
    area_commission_error: float | None = _variant(
        "area commission error, literal",
        "lower",
        "fraction",
        lambda t: area_formulas.area_commission(t.literal_areas),
        meaning="F/(T+F), entity by entity",
        source=_LITERAL,
    )
    branching_factor: float | None = _variant(
        "branching factor, literal",
        "lower",
        "ratio",
        lambda t: area_formulas.branching(t.literal_areas),
        meaning="F/T, entity by entity",
        source=_LITERAL,
    )
    miss_factor: float | None = _variant(
        "miss factor, literal",
        "lower",
        "ratio",
        lambda t: area_formulas.miss(t.literal_areas),
        meaning="M/T, entity by entity",
        source=_LITERAL,
    )


@dataclass(frozen=True, kw_only=True)
class GeometricIndices(IndexGroup):
    """RMSE and its companions, over TP pairs; None where there is no pair."""

    key = "geometric"
    title = "geometry"

    rmse: float | None = _main(
        "RMSE",
        "RMSE",
        "lower",
        "m",
        lambda t: _root(ratio(t.geometric.sum_squared, t.geometric.pairs)),
        meaning="root mean square corner distance of TP pairs under the best cyclic alignment; PoLiS where a side has "
        "no four corners",
        place="4.2.3",
    )
    rmse_pixels: float | None = _variant(
        "RMSE in pixels",
        "lower",
        "px",
        lambda t: _root(ratio(t.geometric.sum_squared_pixels, t.geometric.pairs_with_gsd)),
        meaning="RMSE divided by the GSD",
        source=f"{_PAPER}, 4.4.2",
    )
    centre_rmse: float | None = _variant(
        "centre RMSE",
        "lower",
        "m",
        lambda t: _root(ratio(t.geometric.sum_squared_centre, t.geometric.pairs)),
        meaning="root mean square centre distance of TP pairs",
    )
    centre_mean: float | None = _variant(
        "mean centre distance",
        "lower",
        "m",
        lambda t: ratio(t.geometric.sum_centre, t.geometric.pairs),
        meaning="mean centre distance of TP pairs",
    )
    polis_mean: float | None = _variant(
        "mean PoLiS",
        "lower",
        "m",
        lambda t: ratio(t.geometric.sum_polis, t.geometric.pairs),
        meaning="mean vertex-to-outline distance of TP pairs, both ways",
        source="Avbelj, Müller & Bamler 2015",
    )
    median_iou: float | None = _variant(
        "median IoU",
        "higher",
        "fraction",
        lambda t: t.iou.median,
        meaning="median intersection over union of TP pairs, from bins of 0.001",
    )


@dataclass(frozen=True, kw_only=True)
class MultipleAsCorrectIndices(IndexGroup):
    """The object indices with multiple detections counted as correct."""

    key = "multiple_as_correct"
    title = "objects, multiples correct"

    completeness: float | None = _variant(
        "completeness, multiples correct",
        "higher",
        "fraction",
        lambda t: ratio(_not_false(t), _not_false(t) + t.counts.false_negatives),
        meaning="(|D|-FP)/(|D|-FP+FN)",
        source=_YU,
    )
    correctness: float | None = _variant(
        "correctness, multiples correct",
        "higher",
        "fraction",
        lambda t: ratio(_not_false(t), t.counts.detected),
        meaning="(|D|-FP)/|D|",
        source=_YU,
    )
    quality: float | None = _variant(
        "quality, multiples correct",
        "higher",
        "fraction",
        lambda t: ratio(_not_false(t), t.counts.detected + t.counts.false_negatives),
        meaning="(|D|-FP)/(|D|+FN)",
        source=_YU,
    )
    reference_cross_lap_rate: float | None = _variant(
        "reference cross-lap rate per detection",
        "lower",
        "fraction",
        lambda t: ratio(t.counts.cross_lapped_references, t.counts.detected),
        meaning="cross-lapped references, of all detections",
        source=_YU,
    )


@dataclass(frozen=True, kw_only=True)
class BuildingIndices(IndexGroup):
    """Completeness of buildings that have several parts."""

    key = "building"
    title = "buildings"

    complete_all: float | None = _variant(
        "buildings complete, all parts",
        "higher",
        "fraction",
        lambda t: ratio(t.buildings.complete_all, t.buildings.reference),
        meaning="buildings all of whose parts are TP, of all reference buildings",
    )
    complete_any: float | None = _variant(
        "buildings complete, any part",
        "higher",
        "fraction",
        lambda t: ratio(t.buildings.complete_any, t.buildings.reference),
        meaning="buildings any of whose parts is TP, of all reference buildings",
    )


#: In the order of tables.
GROUPS = (
    ObjectIndices,
    PixelIndices,
    GeometricIndices,
    PixelLiteralIndices,
    MultipleAsCorrectIndices,
    BuildingIndices,
)
