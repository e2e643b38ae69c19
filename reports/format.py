"""Values as text: the only place that turns a number and its unit into what people read.

A *unit* is one of those that indices declare (``"fraction"``, ``"ratio"``, ``"m"``, ``"px"``, ``"count"``), or ``"s"``
or ``"bytes"`` for costs. Fractions are printed in percent, bytes in megabytes.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # a listing of runs must not wait for numeric libraries
    from ..evaluators.base import Index

__all__ = [
    "cell_width",
    "column_head",
    "column_title",
    "index_name",
    "interval_text",
    "listed",
    "number_text",
    "one_line",
    "shortened",
    "unit_text",
    "value_text",
]

_SCALES = {"fraction": 100.0, "bytes": 1e-6}
_SYMBOLS = {"fraction": "%", "bytes": "MB", "ratio": "", "count": ""}
#: Long words of titles, hyphenated for narrow columns.
_HYPHENATED = {word: (word.removesuffix("ness") + "-", "ness") for word in ("completeness", "correctness")}
#: Decimals of tables with many columns, and of tables where differences between values matter.
_COARSE = {"fraction": 1, "ratio": 3, "m": 2, "px": 1, "count": 0, "s": 2, "bytes": 0}
_FINE = {"fraction": 2, "count": 0, "s": 2, "bytes": 1}


def number_text(value: float | None, unit: str, *, fine: bool = False, signed: bool = False) -> str:
    """Return a value without its unit; empty where it is undefined.

    Parameters
    ----------
    value : float, optional
    unit : str
    fine : bool
        More decimals: percent with two, lengths and ratios with three.
    signed : bool
        Write the sign of positive numbers, too.

    Examples
    --------
    >>> number_text(0.9283, "fraction"), number_text(1.234, "m"), number_text(None, "m")
    ('92.8', '1.23', '')
    >>> number_text(-0.00001, "fraction", fine=True)  # no negative zero
    '0.00'
    """
    if value is None:
        return ""
    decimals = _FINE.get(unit, 3) if fine else _COARSE.get(unit, 3)
    scaled = value * _SCALES.get(unit, 1.0)
    text = f"{scaled:,.0f}" if unit == "count" else f"{scaled:.{decimals}f}"
    if text[0] == "-" and not text.strip("-0."):
        text = text[1:]  # what is rounded to zero has no sign
    return f"+{text}" if signed and text[0] != "-" else text


def unit_text(unit: str) -> str:
    """Return the sign of a unit: ``"%"`` for fractions, empty for ratios and counts, else the unit itself."""
    return _SYMBOLS.get(unit, unit)


def value_text(value: float | None, unit: str, *, fine: bool = False, undefined: str = "–") -> str:
    """Return a value with its unit.

    >>> value_text(0.931, "fraction", fine=True), value_text(1.92, "m"), value_text(None, "m")
    ('93.10 %', '1.92 m', '–')
    """
    if value is None:
        return undefined
    return f"{number_text(value, unit, fine=fine)} {unit_text(unit)}".strip()


def interval_text(
    low: float | None, high: float | None, unit: str, *, signed: bool = False, fine: bool = False, coarse: bool = False
) -> str:
    """Return both ends of an interval; empty where there is none. `coarse`: fractions in whole percent.

    >>> interval_text(0.58, 0.995, "fraction"), interval_text(-0.1, 0.2, "m", signed=True)
    ('58.0–99.5', '-0.10 to +0.20')
    """
    if low is None or high is None:
        return ""
    if coarse and unit == "fraction":
        return f"{100 * low:.0f}–{100 * high:.0f}"
    ends = (number_text(end, unit, signed=signed, fine=fine) for end in (low, high))
    return (" to " if signed else "–").join(ends)


def column_title(index: Index, *, words: bool = False) -> str:
    """Return symbol (or title) and unit of an index: ``Q_l %``, ``quality %``."""
    name = index.title if words else index.symbol or index.title
    return f"{name} {unit_text(index.unit)}".strip()


def column_head(index: Index) -> tuple[str, ...]:
    """Return title and unit of an index on several short lines: ``("pixel", "correct-", "ness", "%")``."""
    words = index.title.split()
    parts = [part for word in words for part in _HYPHENATED.get(word, (word,))]
    return (*parts, unit_text(index.unit))


def index_name(index: Index) -> str:
    """Return an index in words with its symbol: ``quality (Q_l)``."""
    return f"{index.title} ({index.symbol})" if index.symbol else index.title


def listed(parts: Sequence[str]) -> str:
    """Return ``a, b and c``; empty for nothing."""
    return " and ".join(filter(None, [", ".join(parts[:-1]), *parts[-1:]]))


def one_line(text: str) -> str:
    """Return text on one line without control characters, which could change the state of a terminal."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def shortened(text: str, width: int = 42) -> str:
    """Return text on one line of at most `width` characters, the middle left out.

    >>> shortened("a detector with a very long name indeed", 20)
    'a detector … indeed'
    """
    text = " ".join(text.split())
    if len(text) <= width:
        return text
    head = width // 2
    return f"{text[:head].rstrip()} … {text[-(width - head - 3) :].lstrip()}"


def cell_width(text: str) -> int:
    """Return how many columns of a terminal a text takes: two for wide characters, none for combining ones."""
    if text.isascii():
        return len(text)
    return sum(
        0 if unicodedata.combining(c) else 2 if unicodedata.east_asian_width(c) in ("W", "F") else 1 for c in text
    )
