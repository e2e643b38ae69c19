"""The evaluator ``shan-lee``: overlap, fitness, underlap, extralap and crosslap of each building, as histograms.

With r a reference and d the detection that shares the most area with it, d and r their intersection:

- overlap ``|d and r| / |d|``, fitness ``|d and r| / |d or r|``;
- underlap ``|r - d| / |r|`` (1 without any detection: a missed building), extralap ``|d - r| / |r|``;
- crosslap: number of references that a detection touches (0: a false alarm).

Source: Shan & Lee 2005, doi:10.1061/(ASCE)0733-9453(2005)131:1(27).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from .coverage_evaluator import CoverageEvaluator
from .index import Curve, IndexGroup, index, ratio
from .overlay.coverage import CountedSets
from .overlay.coverage_verdicts import SideVerdicts, coverage_kinds, coverage_verdicts
from .overlay.left_out import LeftOut
from .tally import Histogram, Tallies, histogram
from .verdict_table import Measure, Verdicts

__all__ = ["ShanLee", "ShanLeeIndices", "building_values"]

_SOURCE = "Shan & Lee 2005"
_SHARES = histogram(low=0.0, high=1.0, bins=20)
#: Extralap has no upper limit: what is more than twice the reference counts in the last bin.
_EXTRA = histogram(low=0.0, high=2.0, bins=40)
_CROSSES = histogram(low=0.0, high=11.0, bins=11)


@dataclass(frozen=True, kw_only=True)
class _Counts(Tallies):
    detected: int = 0
    reference: int = 0
    pairs: int = 0
    false_negatives: int = 0
    false_positives: int = 0


@dataclass(frozen=True, kw_only=True)
class _Tallies(Tallies):
    counts: _Counts = field(default_factory=_Counts)
    left_out: LeftOut = field(default_factory=LeftOut)
    overlap: Histogram = field(default_factory=_SHARES)
    fitness: Histogram = field(default_factory=_SHARES)
    underlap: Histogram = field(default_factory=_SHARES)
    extralap: Histogram = field(default_factory=_EXTRA)
    crosslap: Histogram = field(default_factory=_CROSSES)


@dataclass(frozen=True, kw_only=True)
class ShanLeeIndices(IndexGroup):
    """Means of the histograms, and the shares of missed buildings and false alarms; None where undefined."""

    key = "building"
    title = "buildings"

    overlap: float | None = index(
        "mean overlap",
        "higher",
        "fraction",
        lambda t: t.overlap.mean,
        symbol="O_l",
        meaning="mean of |d and r|/|d| over pairs",
        source=_SOURCE,
    )
    fitness: float | None = index(
        "mean fitness",
        "higher",
        "fraction",
        lambda t: t.fitness.mean,
        symbol="F_i",
        meaning="mean of |d and r|/|d or r| over pairs",
        source=_SOURCE,
    )
    underlap: float | None = index(
        "mean underlap",
        "lower",
        "fraction",
        lambda t: t.underlap.mean,
        symbol="U_l",
        meaning="mean of |r - d|/|r| over references, 1 for missed ones",
        source=_SOURCE,
    )
    extralap: float | None = index(
        "mean extralap",
        "lower",
        "ratio",
        lambda t: t.extralap.mean,
        symbol="E_l",
        meaning="mean of |d - r|/|r| over pairs",
        source=_SOURCE,
    )
    crosslap: float | None = index(
        "mean crosslap",
        "neither",
        "ratio",
        lambda t: t.crosslap.mean,
        symbol="X_l",
        meaning="mean number of references that a detection touches; 1 is best",
        source=_SOURCE,
    )
    missed: float | None = index(
        "missed",
        "lower",
        "fraction",
        lambda t: ratio(t.counts.false_negatives, t.counts.reference),
        symbol="U_100",
        meaning="references with an underlap of 100 %",
        source=_SOURCE,
    )
    false_alarms: float | None = index(
        "false alarms",
        "lower",
        "fraction",
        lambda t: ratio(t.counts.false_positives, t.counts.detected),
        symbol="X_0",
        meaning="detections with a crosslap of 0",
        source=_SOURCE,
    )


def _bars(values: Callable[[_Tallies], Histogram]) -> Callable[[_Tallies], tuple[NDArray[np.float64], ...]]:
    def bars(t: _Tallies) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return values(t).edges, values(t).counts.astype(np.float64)

    return bars


def _histogram(key: str, unit: str, meaning: str) -> Curve:
    return Curve(
        key=key,
        title=key,
        x=key,
        y="number of buildings",
        x_unit=unit,
        y_unit="count",
        formula=_bars(lambda t: getattr(t, key)),  # type: ignore[arg-type]
        meaning=meaning,
        source=_SOURCE,
        bars=True,
    )


def building_values(sets: CountedSets) -> dict[str, NDArray[np.float64]]:
    """Return overlap, fitness, underlap and extralap of each reference, shape (number of references,).

    Underlap is 1 and the others are NaN where no detection overlaps the reference.
    """
    coverage, area = sets.of_references, sets.reference.areas
    has = coverage.partner >= 0
    shared, own = coverage.shared[has], area[has]
    detected = sets.detected.areas[coverage.partner[has]]
    values = {name: np.full(len(area), np.nan) for name in ("overlap", "fitness", "extralap")}
    values["underlap"] = np.ones(len(area))
    values["overlap"][has] = np.minimum(shared / detected, 1.0)
    values["fitness"][has] = np.minimum(shared / (detected + own - shared), 1.0)
    values["underlap"][has] = np.maximum(own - shared, 0.0) / own
    values["extralap"][has] = np.maximum(detected - shared, 0.0) / own
    return values


@dataclass(frozen=True, kw_only=True)
class ShanLee(CoverageEvaluator):
    """Histograms of how well each building is overlapped (Shan & Lee 2005)."""

    name: ClassVar[str] = "shan-lee"
    paper = "Shan & Lee 2005, doi:10.1061/(ASCE)0733-9453(2005)131:1(27)"
    groups = (ShanLeeIndices,)
    tallies_type = _Tallies
    ranked_by: ClassVar[str] = "building.fitness"
    gated_by: ClassVar[tuple[str, ...]] = ("building.fitness", "building.missed", "building.false_alarms")
    verdict_kinds = coverage_kinds(
        correct=("overlapped", "detection on a reference"),
        excess=("FP", "crosslap 0: false alarm"),
        missing=("FN", "underlap 100 %: missed reference"),
    )
    measures = (
        Measure(key="overlap", title="overlap", unit="fraction"),
        Measure(key="fitness", title="fitness", unit="fraction"),
        Measure(key="underlap", title="underlap", unit="fraction"),
        Measure(key="extralap", title="extralap", unit="ratio"),
        Measure(key="crosslap", title="crosslap", unit="count"),
    )
    curves = (
        _histogram("overlap", "fraction", "|d and r|/|d| of pairs"),
        _histogram("fitness", "fraction", "|d and r|/|d or r| of pairs"),
        _histogram("underlap", "fraction", "|r - d|/|r| of references"),
        _histogram("extralap", "ratio", "|d - r|/|r| of pairs; 2 and more in the last bin"),
        _histogram("crosslap", "count", "references that a detection touches; 10 and more in the last bin"),
    )

    def measured(self, sets: CountedSets) -> tuple[Tallies, Callable[[], Verdicts]]:
        """Return the tallies of two sets, and how their verdicts are found."""
        d, r = sets.detections.mask, sets.references.mask
        values = {name: column[r] for name, column in building_values(sets).items()}
        crosslap = sets.of_detections.touched[d]
        pairs = int((~np.isnan(values["fitness"])).sum())
        empty = _Tallies()
        tallies = _Tallies(
            counts=_Counts(
                detected=int(d.sum()),
                reference=int(r.sum()),
                pairs=pairs,
                false_negatives=int(r.sum()) - pairs,
                false_positives=int((crosslap == 0).sum()),
            ),
            left_out=sets.left_out,
            crosslap=empty.crosslap.filled(crosslap),
            **{name: getattr(empty, name).filled(column) for name, column in values.items()},
        )
        return tallies, lambda: self._verdicts(sets)

    def _verdicts(self, sets: CountedSets) -> Verdicts:
        values = building_values(sets)
        of_d, of_r = sets.of_detections, sets.of_references
        undefined = np.full(len(sets.detected), np.nan)
        return coverage_verdicts(
            sets,
            self.verdict_kinds,
            self.measures,
            detections=SideVerdicts(
                of_d.touched > 0,
                [f"crosslap {number}" for number in of_d.touched.tolist()],
                {**dict.fromkeys(values, undefined), "crosslap": of_d.touched.astype(np.float64)},
            ),
            references=SideVerdicts(
                of_r.touched > 0,
                [f"underlap {100 * share:.0f} %" for share in values["underlap"].tolist()],
                {**values, "crosslap": np.full(len(sets.reference), np.nan)},
            ),
        )
