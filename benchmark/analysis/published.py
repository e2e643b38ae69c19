"""Published tables, and whether they agree with their own definitions.

The published values are of other data (real scenes that are not completely public); they allow a comparison, not a
test. Values are kept as printed, in percent, because the number of printed decimals limits what can be checked.

Sources
-------
2010
    Awrangjeb, Ravanbakhsh & Fraser, "Automatic Detection of Residential Buildings Using LIDAR Data and Multispectral
    Imagery", tables 1 and 2, section 4.4.2.
2011
    Awrangjeb et al., the improved detector for scenes with trees and slopes, tables 1 and 2 and the text on results.
2013
    Yu, Li, Guan & Wang, "A marked point process for automated building detection from lidar point-clouds", Remote
    Sensing Letters 4(11), 1127-1136, doi:10.1080/2150704X.2013.846487, table 1.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from ...evaluators.base import Index

__all__ = ["PUBLISHED", "Check", "Comparison", "OursRow", "PublishedRow", "checks"]


@dataclass(frozen=True, kw_only=True)
class PublishedRow:
    """One row of a printed table.

    Attributes
    ----------
    detector : str
        Name of the detector in roofbench.
    scene : str
        Name in the paper.
    presets : tuple of str
        Presets of the generator that follow its description.
    source : str
        Paper and table.
    printed : mapping of str to str
        Symbol to the printed text; percent, RMSE with its unit.
    average : bool
        Whether the row is the table's own average.
    """

    detector: str
    scene: str
    presets: tuple[str, ...]
    source: str
    printed: Mapping[str, str]
    average: bool = False

    @property
    def entries(self) -> tuple[str, ...]:
        """Labels of the detector entries that stand beside the row, the first one first."""
        return _ENTRIES.get(self.detector, (self.detector,))

    def text(self, index: Index) -> str:
        """Return what is printed for an index, which has the papers' symbol; empty where a paper gives no value."""
        return self.printed.get(index.symbol, "")


def _row(
    detector: str, scene: str, presets: str, source: str, symbols: str, values: str, *, average: bool = False
) -> PublishedRow:
    printed = dict(zip(symbols.split(), (value.replace("_", " ") for value in values.split()), strict=True))
    return PublishedRow(
        detector=detector,
        scene=scene,
        presets=tuple(presets.split()),
        source=source,
        printed=printed,
        average=average,
    )


#: Entries other than the default one. The references of 2013 are rectangles, one for each part of a building, so the
#: default level of `mpp`, one footprint for each building, does not stand beside them. The first is that of the suite.
_ENTRIES = {
    "original": ("original", "original[mode=paper]", "original[mode=program]"),
    "improved": ("improved", "improved[mode=paper]", "improved[mode=program]"),
    "mpp": ("mpp[least_height=2.5,level=part]", "mpp[level=part]", "mpp-printed"),
}

_OBJECT = "C_m C_r Q_l M_d D_o C_rd C_rr"
_AREA = "C_mp C_rp Q_lp A_oe A_ce B_f M_f"
_ALL = f"{_OBJECT} {_AREA}"
_1, _2, _3 = "2010, tables 1 and 2", "2011, tables 1 and 2", "2013, table 1"
#: The figures of the Dempster-Shafer detector are by another system, which is more lenient for areas.
_THRESHOLDS = "quoted from Rutzinger et al. 2009: by overlap thresholds, not by this evaluation"
_FAIRFIELDS = "fairfield-1 fairfield-2 fairfield-3"

#: Every row that is printed, table by table.
PUBLISHED: tuple[PublishedRow, ...] = (
    _row(
        *("original", "Fairfield, scene 1", "fairfield-1", _1, f"{_ALL} RMSE"),
        "97.14 97.14 95.31 2.60 6.85 2.74 7.14 77.32 89.29 70.07 22.68 10.35 12.00 29.33 1.98_m",
    ),
    _row(
        *("original", "Fairfield, scene 2", "fairfield-2", _1, f"{_ALL} RMSE"),
        "95.94 96.55 92.08 4.62 5.00 1.67 4.84 77.97 87.05 67.40 22.03 12.67 14.87 28.26 1.91_m",
    ),
    _row(
        *("original", "Fairfield, scene 3", "fairfield-3", _1, f"{_ALL} RMSE"),
        "98.33 99.25 90.94 11.60 28.57 14.29 33.33 79.51 90.35 72.11 20.49 7.54 10.68 25.77 1.86_m",
    ),
    _row(
        *("original", "Fairfield, average", _FAIRFIELDS, _1, f"{_ALL} RMSE"),
        "97.14 97.9 92.78 6.27 13.47 6.23 15.11 78.27 88.90 69.86 21.74 10.19 12.52 27.79 1.92_m",
        average=True,
    ),
    _row(
        *(
            "original",
            "Knox",
            "knox",
            "2011, text of the results section",
            "C_m C_r Q_l D_o C_rr C_mp C_rp Q_lp A_oe B_f M_f RMSE",
        ),
        "77 67 56 39 >_85 44 42 27 >_50 >_120 >_120 ≥_33_px",
    ),
    _row(
        *("dempster-shafer", "Fairfield", "fairfield", f"2010, 4.4.2, {_THRESHOLDS}", "C_m Q_l C_mp Q_lp"),
        "44.2 43.1 92.1 81.8",
    ),
    _row(
        *("improved", "Fairfield", "fairfield", _2, _ALL),
        "95.1 95.4 92.2 2.7 8.6 3.5 9.7 83.2 84.5 72.4 15.3 12.5 13.5 20.3",
    ),
    _row(
        *("improved", "Moonee Ponds", "moonee-ponds", _2, _ALL),
        "94.5 95.3 89.2 6.2 13.1 7.3 17.5 87.2 85.4 75.3 12.7 13.2 16.7 17.3",
    ),
    _row(
        *("improved", "Knox", "knox", _2, f"{_ALL} RMSE"),
        "93.2 87.2 82.0 9.3 12.8 23.3 61.6 49.0 65.9 39.1 51.0 30.9 51.8 104.0 20_px",
    ),
    _row(
        *("improved", "average", "fairfield moonee-ponds knox", _2, _ALL),
        "94.0 91.3 86.4 6.9 11.9 14.4 37.6 73.1 78.6 62.3 26.3 18.9 27.3 47.2",
        average=True,
    ),
    _row(*("mpp", "Toronto (a)", "toronto-a", _3, _OBJECT), "96.97 98.46 95.52 3.08 3.08 2.31 6.92"),
    _row(*("mpp", "Toronto (b)", "toronto-b", _3, _OBJECT), "96.77 98.04 94.94 5.23 11.76 5.88 5.23"),
    _row(*("mpp", "Vaihingen (a)", "vaihingen-a", _3, _OBJECT), "96.23 96.96 93.41 2.28 3.42 1.90 5.70"),
    _row(*("mpp", "Vaihingen (b)", "vaihingen-b", _3, _OBJECT), "94.50 94.83 89.87 3.45 6.55 3.10 6.21"),
    _row(
        *("mpp", "average", "toronto-a toronto-b vaihingen-a vaihingen-b", _3, _OBJECT),
        "96.12 97.07 93.44 3.51 6.20 3.30 6.02",
        average=True,
    ),
)


@dataclass(frozen=True, kw_only=True)
class OursRow:
    """The values of one detector entry on the presets of a published row: means over scenes by index key.

    Attributes
    ----------
    label : str
        Of the detector entry.
    scenes : int
    values : mapping of str to float
    one_pass : mapping of str to float
        Values by ``matching="one-pass"``, the paper's text on correspondence taken literally; empty where `values` are
        by it.
    """

    label: str
    scenes: int
    values: Mapping[str, float | None]
    one_pass: Mapping[str, float | None] = field(default_factory=dict)


@dataclass(frozen=True)
class Comparison:
    """Published rows, each with our rows where a detector entry ran on all presets that follow its description.

    Attributes
    ----------
    indices : tuple of Index
        Those that a paper prints.
    rows : tuple of (PublishedRow, tuple of OursRow)
    """

    indices: tuple[Index, ...]
    rows: tuple[tuple[PublishedRow, tuple[OursRow, ...]], ...]


@dataclass(frozen=True, kw_only=True)
class Check:
    """Result of one rule on a printed table.

    Attributes
    ----------
    source, rule : str
    tested : int
        Rows or columns that could be tested.
    failed : tuple of str
        Where the rule fails, with the expected value.
    """

    source: str
    rule: str
    tested: int
    failed: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether the rule holds everywhere it was tested."""
        return not self.failed


#: Symbol, rule in words, symbols it follows from, formula on fractions.
_IDENTITIES: tuple[tuple[str, str, tuple[str, ...], Callable[..., float]], ...] = (
    ("Q_l", "1/Q_l = 1/C_m + 1/C_r − 1", ("C_m", "C_r"), lambda m, r: 1 / (1 / m + 1 / r - 1)),
    ("Q_lp", "1/Q_lp = 1/C_mp + 1/C_rp − 1", ("C_mp", "C_rp"), lambda m, r: 1 / (1 / m + 1 / r - 1)),
    ("A_oe", "A_oe = 1 − C_mp", ("C_mp",), lambda m: 1 - m),
    ("A_ce", "A_ce = 1 − C_rp", ("C_rp",), lambda r: 1 - r),
    ("B_f", "B_f = 1/C_rp − 1", ("C_rp",), lambda r: 1 / r - 1),
    ("M_f", "M_f = 1/C_mp − 1", ("C_mp",), lambda m: 1 / m - 1),
)

#: Counts from which the table of 2013 follows: |D|, TP, FP, FN, MD, O_d, C_ld, C_lr.
_COUNTS_2013 = {
    "Toronto (a)": (130, 128, 2, 4, 4, 4, 3, 9),
    "Toronto (b)": (153, 150, 3, 5, 8, 18, 9, 8),
    "Vaihingen (a)": (263, 255, 8, 10, 6, 9, 5, 15),
    "Vaihingen (b)": (290, 275, 15, 16, 10, 19, 9, 18),
}


def checks(rows: Iterable[PublishedRow] = PUBLISHED) -> tuple[Check, ...]:
    """Return what can be tested of printed tables: identities of the definitions, averages, and counts behind them.

    A printed number represents an interval of half its last digit on either side; a rule fails where the intervals are
    disjoint.
    """
    tables: dict[str, list[PublishedRow]] = {}
    for row in rows:
        tables.setdefault(row.source, []).append(row)
    found: list[Check] = []
    for source, table in tables.items():
        single = [row for row in table if not row.average]
        for symbol, rule, given, formula in _IDENTITIES:
            found += _identity(source, single, symbol, rule, given, formula)
        rule = "the average row is the mean of the rows"
        found += _averages(source, table, f"object-based indices: {rule}", _OBJECT.split())
        found += _averages(source, table, f"area-based indices and RMSE: {rule}", [*_AREA.split(), "RMSE"])
        if source == _2:
            found += _averages(
                source, table, f"object-based indices: {rule}, Knox counted twice", _OBJECT.split(), "Knox"
            )
        if source == _3:
            found.append(_counts(single))
    return tuple(found)


def _interval(text: str) -> tuple[float, float] | None:
    """Return the interval of fractions that a printed percentage (or length) represents; None for ``> 85``."""
    text = text.removesuffix(" m")  # only compared with lengths, so the division by 100 does not matter
    try:
        value = float(text)
    except ValueError:
        return None
    half = 0.5 * 10.0 ** -len(text.partition(".")[2]) + 1e-9
    return (value - half) / 100, (value + half) / 100


def _identity(
    source: str,
    rows: Iterable[PublishedRow],
    symbol: str,
    rule: str,
    given: tuple[str, ...],
    formula: Callable[..., float],
) -> list[Check]:
    tested, failed = 0, []
    for row in rows:
        parts = [_interval(row.printed.get(name, "")) for name in given]
        printed = _interval(row.printed.get(symbol, ""))
        known = [part for part in parts if part is not None]
        if printed is None or len(known) < len(parts):
            continue
        tested += 1
        # The formulas are monotonic in each argument, so that the corners are the extremes.
        corners = [formula(*corner) for corner in itertools.product(*known)]
        if max(corners) < printed[0] or min(corners) > printed[1]:
            expected = 50 * (min(corners) + max(corners))
            failed.append(f"{row.scene}: printed {row.printed[symbol]}, follows {expected:.2f}")
    return [Check(source=source, rule=rule, tested=tested, failed=tuple(failed))] if tested else []


def _averages(
    source: str, table: list[PublishedRow], rule: str, symbols: Iterable[str], twice: str = ""
) -> list[Check]:
    """Compare a table's average row with the mean of its rows, one of which may count twice."""
    average = next((row for row in table if row.average), None)
    if average is None:
        return []
    table = [*table, *(row for row in table if row.scene == twice)]
    tested, failed = 0, []
    for symbol in symbols:
        text = average.printed.get(symbol, "")
        parts = [_interval(row.printed.get(symbol, "")) for row in table if not row.average]
        printed, known = _interval(text), [part for part in parts if part is not None]
        if printed is None or len(known) < len(parts):
            continue
        tested += 1
        low, high = (sum(part[side] for part in known) / len(known) for side in (0, 1))
        if high < printed[0] or low > printed[1]:
            failed.append(f"{symbol}: printed {text}, mean of the rows {50 * (low + high):.2f}")
    return [Check(source=source, rule=rule, tested=tested, failed=tuple(failed))] if tested else []


def _counts(rows: Iterable[PublishedRow]) -> Check:
    tested, failed = 0, []
    for row in rows:
        detected, tp, fp, fn, md, overlapping, cross, crossed = _COUNTS_2013[row.scene]
        follows = [tp / (tp + fn), tp / (tp + fp), tp / (tp + fp + fn)]
        follows += [number / detected for number in (md, overlapping, cross, crossed)]
        for symbol, value in zip(_OBJECT.split(), follows, strict=True):
            tested += 1
            if f"{100 * value:.2f}" != row.printed[symbol]:
                failed.append(f"{row.scene}, {symbol}: printed {row.printed[symbol]}, follows {100 * value:.2f}")
    return Check(
        source=_3,
        rule="whole-number counts give every figure (multiple detections counted as correct, C_rr divided by |D|)",
        tested=tested,
        failed=tuple(failed),
    )
