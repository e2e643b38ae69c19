"""Indices: the numbers that an evaluator reports, each declared once with its formula.

Nouns
-----
index
    One reported number. Its formula is a function of the tallies.
index group
    Indices that belong together, such as those of objects or of areas. A group is a frozen dataclass whose fields are
    its indices, so that ``evaluation.object.quality`` is known to editors and type checkers.
curve
    A line or a row of bars that an evaluator reports, such as completeness against building area.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Better", "Curve", "Formula", "Index", "IndexGroup", "index", "ratio"]

#: Which way an index improves.
Better: TypeAlias = Literal["higher", "lower", "neither"]

#: Tallies to the value of an index; None where it is undefined (0/0).
Formula: TypeAlias = Callable[[Any], float | None]


def ratio(part: float, whole: float) -> float | None:
    """Return part / whole; None where the whole is 0.

    >>> ratio(3, 4), ratio(0, 0)
    (0.75, None)
    """
    return part / whole if whole > 0 else None


def _undefined(_: Any) -> float | None:
    return None


@dataclass(frozen=True, kw_only=True)
class Index:
    """One reported number.

    Attributes
    ----------
    key : str
        Dotted name in JSON, tables and the store: ``"object.quality"``.
    title, symbol : str
        Name in words and the paper's symbol: ``"quality"``, ``"Q_l"``.
    better : {"higher", "lower", "neither"}
    unit : str
        ``"fraction"`` (printed as percent), ``"ratio"``, ``"m"``, ``"px"`` or ``"count"``.
    meaning, source : str
        What it is in words, and where it is defined.
    range : tuple of float
        Lowest and highest value it can take.
    formula : callable
        Tallies to value, None where undefined. The default is for indices that follow from no tallies, such as the
        ratio of two run times.
    main : bool
        Whether it is one of the evaluator's principal indices, shown in every table; the others are variants.
    group : str
        Heading in tables that it stands under: ``"objects"``; empty for none.
    """

    key: str
    title: str
    symbol: str = ""
    better: Better
    unit: str
    meaning: str
    source: str
    range: tuple[float, float] = (0.0, float("inf"))
    formula: Formula = field(default=_undefined, repr=False, compare=False)
    main: bool = True
    group: str = ""


def index(
    title: str,
    better: Better,
    unit: str,
    formula: Formula,
    *,
    meaning: str,
    source: str = "roofbench",
    symbol: str = "",
    main: bool = True,
) -> Any:
    """Declare an index: a field of an `IndexGroup`; the arguments are those of `Index`.

    The range follows from the unit: 0 to 1 for fractions, 0 upwards for the others.
    """
    facts = {
        "title": title,
        "better": better,
        "unit": unit,
        "formula": formula,
        "meaning": meaning,
        "source": source,
        "symbol": symbol,
        "main": main,
        "range": (0.0, 1.0 if unit == "fraction" else float("inf")),
    }
    return field(metadata={"index": facts})


@dataclass(frozen=True, kw_only=True)
class IndexGroup:
    """Base of index groups: the values of some indices, None where undefined.

    Attributes
    ----------
    key : str
        First part of the keys of its indices: ``"object"``.
    title : str
        Heading in tables: ``"objects"``.

    Examples
    --------
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Shares(IndexGroup):
    ...     key = "share"
    ...     title = "shares"
    ...     found: float | None = index(
    ...         "found", "higher", "fraction", lambda t: ratio(t["found"], t["all"]), meaning="found/all"
    ...     )
    >>> [each.key for each in Shares.indices()], Shares.of({"found": 3, "all": 4})
    (['share.found'], Shares(found=0.75))
    """

    key: ClassVar[str]
    title: ClassVar[str]

    @classmethod
    @cache
    def indices(cls) -> tuple[Index, ...]:
        """Return the indices of the group, in order of declaration."""
        return tuple(
            Index(key=f"{cls.key}.{each.name}", group=cls.title, **each.metadata["index"])
            for each in dataclasses.fields(cls)
        )

    @classmethod
    def of(cls, tallies: Any) -> Self:
        """Return the values that follow from tallies."""
        return cls(**{each.name: each.metadata["index"]["formula"](tallies) for each in dataclasses.fields(cls)})


@dataclass(frozen=True, kw_only=True)
class Curve:
    """A curve or histogram that follows from the tallies.

    Attributes
    ----------
    key, title : str
    x, y : str
        What the axes show, in words.
    x_unit, y_unit : str
        As of `Index`; ``"m2"`` besides.
    formula : callable
        Tallies to two arrays of one length; NaN where y is undefined. Of bars x has one value more: their bounds.
    bars : bool
        Whether it is drawn as a histogram.
    meaning, source : str
    panel : str
        Lines of equal units are drawn together unless their panels differ.
    """

    key: str
    title: str
    x: str
    y: str
    x_unit: str
    y_unit: str
    formula: Callable[[Any], tuple[NDArray[np.float64], NDArray[np.float64]]] = field(repr=False, compare=False)
    meaning: str
    source: str
    bars: bool = False
    panel: str = ""
