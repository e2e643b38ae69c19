"""The 15 indices of the threshold-free evaluation and their named variants.

Every index is a formula on *tallies*: counts, areas (m2) and sums of squares that add up over scenes. 0/0 is
undefined and given as None.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..base import Better, Index

__all__ = ["COUNTS", "INDICES", "index_values"]

_PAPER = "Awrangjeb, Ravanbakhsh & Fraser 2010"
_RATE = (0.0, 1.0)
_OPEN = (0.0, float("inf"))

#: Counts that the tallies hold under ``counts.``.
COUNTS = (
    "detected",
    "reference",
    "true_positives",
    "false_positives",
    "false_negatives",
    "multiple_detections",
    "overlapping_detections",
    "cross_lapping_detections",
    "cross_lapped_references",
)


def _main(key: str, title: str, symbol: str, better: Better, unit: str, meaning: str, place: str) -> Index:
    limits = _RATE if unit == "fraction" else _OPEN
    return Index(
        key=key,
        title=title,
        symbol=symbol,
        better=better,
        unit=unit,
        range=limits,
        meaning=meaning,
        source=f"{_PAPER}, {place}",
    )


def _variant(
    key: str, title: str, better: Better, unit: str, meaning: str, source: str = "roofbench", symbol: str = ""
) -> Index:
    return Index(
        key=key,
        title=title,
        symbol=symbol,
        better=better,
        unit=unit,
        range=_RATE if unit == "fraction" else _OPEN,
        meaning=meaning,
        source=source,
        main=False,
    )


INDICES: tuple[Index, ...] = (
    _main("object.completeness", "completeness", "C_m", "higher", "fraction", "TP/(TP+FN)", "4.2.1"),
    _main("object.correctness", "correctness", "C_r", "higher", "fraction", "TP/(TP+FP)", "4.2.1"),
    _main("object.quality", "quality", "Q_l", "higher", "fraction", "TP/(TP+FP+FN)", "4.2.1"),
    _main(
        "object.multiple_detection_rate",
        "multiple detection rate",
        "M_d",
        "lower",
        "fraction",
        "unmatched detections that overlap a reference, of all detections",
        "4.2.1, equation 1",
    ),
    _main(
        "object.detection_overlap_rate",
        "detection overlap rate",
        "D_o",
        "lower",
        "fraction",
        "detections that overlap another one, natural overlap excluded, of all detections",
        "4.2.1, equation 2",
    ),
    _main(
        "object.detection_cross_lap_rate",
        "detection cross-lap rate",
        "C_rd",
        "lower",
        "fraction",
        "detections that overlap references of more than one building, of all detections",
        "4.2.1, equation 3",
    ),
    _main(
        "object.reference_cross_lap_rate",
        "reference cross-lap rate",
        "C_rr",
        "lower",
        "fraction",
        "references overlapped by more than one detection, natural overlap excluded, of all references",
        "4.2.1, equation 4",
    ),
    _main("pixel.completeness", "pixel completeness", "C_mp", "higher", "fraction", "T/(T+M)", "4.2.2"),
    _main("pixel.correctness", "pixel correctness", "C_rp", "higher", "fraction", "T/(T+F)", "4.2.2"),
    _main("pixel.quality", "pixel quality", "Q_lp", "higher", "fraction", "T/(T+F+M)", "4.2.2"),
    _main("pixel.area_omission_error", "area omission error", "A_oe", "lower", "fraction", "M/(T+M)", "4.2.2"),
    _main("pixel.area_commission_error", "area commission error", "A_ce", "lower", "fraction", "F/(T+F)", "4.2.2"),
    _main("pixel.branching_factor", "branching factor", "B_f", "lower", "ratio", "F/T", "4.2.2"),
    _main("pixel.miss_factor", "miss factor", "M_f", "lower", "ratio", "M/T", "4.2.2"),
    _main(
        "geometric.rmse",
        "RMSE",
        "RMSE",
        "lower",
        "m",
        "root mean square corner distance of TP pairs under the best cyclic alignment; PoLiS where a side has no "
        "four corners",
        "4.2.3",
    ),
    _variant("geometric.rmse_pixels", "RMSE in pixels", "lower", "px", "RMSE divided by the GSD", _PAPER + ", 4.4.2"),
    _variant("geometric.centre_rmse", "centre RMSE", "lower", "m", "root mean square centre distance of TP pairs"),
    _variant("geometric.centre_mean", "mean centre distance", "lower", "m", "mean centre distance of TP pairs"),
    _variant(
        "geometric.polis_mean",
        "mean PoLiS",
        "lower",
        "m",
        "mean vertex-to-outline distance of TP pairs, both ways",
        "Avbelj, Müller & Bamler 2015",
    ),
    _variant("geometric.median_iou", "median IoU", "higher", "fraction", "median intersection over union of TP pairs"),
    _variant(
        "multiple_as_correct.completeness",
        "completeness, multiples correct",
        "higher",
        "fraction",
        "(|D|-FP)/(|D|-FP+FN)",
        "Yu et al. 2013, table 1 (reading)",
    ),
    _variant(
        "multiple_as_correct.correctness",
        "correctness, multiples correct",
        "higher",
        "fraction",
        "(|D|-FP)/|D|",
        "Yu et al. 2013, table 1 (reading)",
    ),
    _variant(
        "multiple_as_correct.quality",
        "quality, multiples correct",
        "higher",
        "fraction",
        "(|D|-FP)/(|D|+FN)",
        "Yu et al. 2013, table 1 (reading)",
    ),
    _variant(
        "multiple_as_correct.reference_cross_lap_rate",
        "reference cross-lap rate per detection",
        "lower",
        "fraction",
        "cross-lapped references, of all detections",
        "Yu et al. 2013, table 1 (reading)",
    ),
    _variant(
        "pixel.area_omission_error_matched",
        "area omission error of pairs",
        "lower",
        "fraction",
        "part of the references of TP pairs that their detections leave uncovered",
    ),
    _variant(
        "pixel.area_commission_error_matched",
        "area commission error of pairs",
        "lower",
        "fraction",
        "part of the detections of TP pairs that lies beyond their references",
    ),
    _variant(
        "building.complete_all",
        "buildings complete, all parts",
        "higher",
        "fraction",
        "buildings all of whose parts are TP, of all reference buildings",
    ),
    _variant(
        "building.complete_any",
        "buildings complete, any part",
        "higher",
        "fraction",
        "buildings any of whose parts is TP, of all reference buildings",
    ),
)


def _ratio(part: float, whole: float) -> float | None:
    return part / whole if whole > 0 else None


def index_values(
    tallies: Mapping[str, float], samples: Mapping[str, NDArray[np.float64]] | None = None
) -> dict[str, float | None]:
    """Return every index by its key.

    Parameters
    ----------
    tallies : mapping of str to float
        ``counts.*`` (see `COUNTS`), ``areas.true_positive`` and so on; what is missing counts as 0.
    samples : mapping of str to ndarray
        ``iou`` of each TP pair.

    Examples
    --------
    >>> values = index_values({"counts.true_positives": 3, "counts.false_positives": 1, "counts.detected": 4})
    >>> values["object.correctness"], values["pixel.quality"]
    (0.75, None)
    """

    def tally(key: str) -> float:
        return tallies.get(key, 0)

    detected, reference = tally("counts.detected"), tally("counts.reference")
    tp, fp, fn = (tally(f"counts.{name}") for name in ("true_positives", "false_positives", "false_negatives"))
    t, f, m = (tally(f"areas.{name}") for name in ("true_positive", "false_positive", "false_negative"))
    pairs = tally("geometric.pairs")
    mean_square = _ratio(tally("geometric.sum_squared"), pairs)
    mean_square_pixels = _ratio(tally("geometric.sum_squared_pixels"), tally("geometric.pairs_with_gsd"))
    mean_square_centre = _ratio(tally("geometric.sum_squared_centre"), pairs)
    iou = (samples or {}).get("iou")
    pair_detected, pair_reference = tally("areas.pair_detected"), tally("areas.pair_reference")
    pair_shared, buildings = tally("areas.pair_shared"), tally("buildings.reference")
    values = {
        "object.completeness": _ratio(tp, tp + fn),
        "object.correctness": _ratio(tp, tp + fp),
        "object.quality": _ratio(tp, tp + fp + fn),
        "object.multiple_detection_rate": _ratio(tally("counts.multiple_detections"), detected),
        "object.detection_overlap_rate": _ratio(tally("counts.overlapping_detections"), detected),
        "object.detection_cross_lap_rate": _ratio(tally("counts.cross_lapping_detections"), detected),
        "object.reference_cross_lap_rate": _ratio(tally("counts.cross_lapped_references"), reference),
        "pixel.completeness": _ratio(t, t + m),
        "pixel.correctness": _ratio(t, t + f),
        "pixel.quality": _ratio(t, t + f + m),
        "pixel.area_omission_error": _ratio(m, t + m),
        "pixel.area_commission_error": _ratio(f, t + f),
        "pixel.branching_factor": _ratio(f, t),
        "pixel.miss_factor": _ratio(m, t),
        "geometric.rmse": _root(mean_square),
        "geometric.rmse_pixels": _root(mean_square_pixels),
        "geometric.centre_rmse": _root(mean_square_centre),
        "geometric.centre_mean": _ratio(tally("geometric.sum_centre"), pairs),
        "geometric.polis_mean": _ratio(tally("geometric.sum_polis"), pairs),
        "geometric.median_iou": float(np.median(iou)) if iou is not None and len(iou) else None,
        "multiple_as_correct.completeness": _ratio(detected - fp, detected - fp + fn),
        "multiple_as_correct.correctness": _ratio(detected - fp, detected),
        "multiple_as_correct.quality": _ratio(detected - fp, detected + fn),
        "multiple_as_correct.reference_cross_lap_rate": _ratio(tally("counts.cross_lapped_references"), detected),
        "pixel.area_omission_error_matched": _ratio(pair_reference - pair_shared, pair_reference),
        "pixel.area_commission_error_matched": _ratio(pair_detected - pair_shared, pair_detected),
        "building.complete_all": _ratio(tally("buildings.complete_all"), buildings),
        "building.complete_any": _ratio(tally("buildings.complete_any"), buildings),
    }
    return {index.key: values[index.key] for index in INDICES}


def _root(value: float | None) -> float | None:
    return None if value is None else float(np.sqrt(value))
