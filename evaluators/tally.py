"""Tallies: what adds up over scenes.

Nouns
-----
tallies
    Counts, areas (m2) and sums of one evaluation, as a frozen dataclass. Two of them add up field by field, so several
    scenes together have exactly the indices of one scene that holds them all.
histogram
    Values counted in fixed bins. A median cannot be added up, the histogram that it follows from can.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import InputError

__all__ = ["ADDED", "Additive", "Histogram", "Tallies", "histogram"]

#: Metadata of a field of tallies that older stores lack; it is read as nothing counted, so its indices are undefined.
ADDED = {"added": True}


class Additive(Protocol):
    """What a tally may be besides a number: something that adds up and that JSON can hold."""

    def __add__(self, other: Any) -> Any: ...

    def to_json(self) -> Any:
        """Return plain lists, numbers and text."""

    def from_json(self, stored: Any) -> Any:
        """Return one of the same layout with the content that `to_json` gave."""

    def weighted_sums(self, values: Sequence[Any], weights: NDArray[np.int64]) -> Iterator[Any]:
        """Yield sums of `values`, each taken as many times as its weight says: one sum for each row of `weights`."""


@dataclass(frozen=True, eq=False)
class Histogram:
    """Values counted in bins of equal width.

    Besides its count each bin keeps the sum of its values, so that a quantile is exact where a bin holds one value.

    Attributes
    ----------
    low, high : float
        Range of the bins; values beyond it count in the first or last one.
    counts : ndarray of int64, shape (bins,)
    sums : ndarray of float64, shape (bins,)

    Examples
    --------
    >>> values = Histogram.of([0.2, 0.7, 0.9], low=0, high=1, bins=10)
    >>> values.median, (values + values).total, Histogram.of([], low=0, high=1, bins=10).median
    (0.7, 6, None)
    """

    low: float
    high: float
    counts: NDArray[np.int64]
    sums: NDArray[np.float64]

    @classmethod
    def of(cls, values: ArrayLike, *, low: float, high: float, bins: int) -> Self:
        """Count values; NaN is not counted."""
        array = np.asarray(values, dtype=np.float64).ravel()
        # Sorted, so that the last bits of the sums do not depend on the order of the values.
        array = np.sort(array[~np.isnan(array)])
        place = np.clip(np.floor(np.round((array - low) / (high - low) * bins, 9)), 0, bins - 1).astype(np.int64)
        sums: NDArray[np.float64] = np.bincount(place, weights=array, minlength=bins).astype(np.float64)
        return cls(low, high, np.bincount(place, minlength=bins), sums)

    def filled(self, values: ArrayLike) -> Self:
        """Return a histogram of the same bins that counts these values."""
        return self.of(values, low=self.low, high=self.high, bins=len(self.counts))

    def __add__(self, other: Histogram) -> Self:
        return dataclasses.replace(self, counts=self.counts + other.counts, sums=self.sums + other.sums)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Histogram)
            and (self.low, self.high) == (other.low, other.high)
            and np.array_equal(self.counts, other.counts)
            and np.array_equal(self.sums, other.sums)
        )

    __hash__ = None  # type: ignore[assignment]

    @property
    def edges(self) -> NDArray[np.float64]:
        """Bounds of the bins, shape (bins + 1,)."""
        return np.linspace(self.low, self.high, len(self.counts) + 1)

    @property
    def total(self) -> int:
        """Number of values."""
        return int(self.counts.sum())

    @property
    def mean(self) -> float | None:
        """Mean of the values; None without any."""
        return float(self.sums.sum()) / self.total if self.total else None

    @property
    def median(self) -> float | None:
        """Median, off by less than the width of a bin; None without values.

        It is the mean of the values in the bin of the middle value, or of the two middle values.
        """
        if not self.total:
            return None
        middle = [(self.total - 1) // 2, self.total // 2]
        place = np.searchsorted(np.cumsum(self.counts), middle, side="right")
        low, high = (self.sums[place] / self.counts[place]).tolist()
        return float((low + high) / 2)

    def to_json(self) -> dict[str, Any]:
        """Return the bins that are not empty."""
        place = np.flatnonzero(self.counts)
        return {
            "bins": len(self.counts),
            "bin": place.tolist(),
            "count": self.counts[place].tolist(),
            "sum": self.sums[place].tolist(),
        }

    def from_json(self, stored: Any) -> Self:
        """Read what `to_json` wrote, or a list of single values as version 0.1 stored them."""
        if isinstance(stored, list):
            return self.filled(stored)
        counts, sums = np.zeros_like(self.counts), np.zeros_like(self.sums)
        if stored["bins"] != len(counts):
            raise ValueError(f"{stored['bins']} bins instead of {len(counts)}")
        counts[stored["bin"]], sums[stored["bin"]] = stored["count"], stored["sum"]
        return dataclasses.replace(self, counts=counts, sums=sums)

    def weighted_sums(self, values: Sequence[Histogram], weights: NDArray[np.int64]) -> Iterator[Self]:
        """Yield sums of histograms, each taken as many times as its weight says; see `Additive`."""
        # Whole numbers are exact as floats, whose products are a hundred times as fast.
        counts, sums = (
            np.stack([getattr(value, name) for value in values], dtype=float) for name in ("counts", "sums")
        )
        for row in weights.astype(np.float64):
            yield dataclasses.replace(self, counts=(row @ counts).astype(np.int64), sums=row @ sums)


def histogram(*, low: float, high: float, bins: int) -> Callable[[], Histogram]:
    """Return what makes the empty histogram: the default factory of a tally that counts values in bins."""
    return lambda: Histogram.of([], low=low, high=high, bins=bins)


@dataclass(frozen=True, kw_only=True)
class Tallies:
    """Base of tallies: a frozen dataclass each of whose fields is an int, a float, an `Additive` or tallies again.

    Every field needs a default: what it is when nothing was counted.

    Examples
    --------
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Counts(Tallies):
    ...     found: int = 0
    ...     area: float = 0.0
    >>> total = Counts(found=2, area=10.5) + Counts(found=1)
    >>> total.found, total.to_dict()
    (3, {'found': 3, 'area': 10.5})
    """

    def __add__(self, other: Self) -> Self:
        return type(self)(**{name: getattr(self, name) + getattr(other, name) for name in _defaults(type(self))})

    def to_dict(self) -> dict[str, Any]:
        """Return all tallies by dotted name, as JSON can hold them: ``{"counts.detected": 12}``."""
        flat: dict[str, Any] = {}
        for name in _defaults(type(self)):
            value = getattr(self, name)
            if isinstance(value, Tallies):
                flat |= {f"{name}.{key}": inner for key, inner in value.to_dict().items()}
            else:
                flat[name] = value if isinstance(value, int | float) else value.to_json()
        return flat

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """Read what `to_dict` wrote.

        Raises
        ------
        InputError
            A tally is missing, unknown, or of another kind: it was stored by another version of the evaluator.
        """
        rest = dict(stored)
        try:
            found = cls._read(rest, "")
        except (KeyError, TypeError, ValueError, IndexError) as error:
            what = f"it has no {error}" if isinstance(error, KeyError) else str(error)
            raise InputError(
                f"stored tallies cannot be read ({what}): run 'roofbench score' to evaluate again"
            ) from error
        if rest:
            raise InputError(
                f"stored tallies have the unknown entry {next(iter(rest))!r}: run 'roofbench score' to evaluate again"
            )
        return found

    @classmethod
    def _read(cls, rest: dict[str, Any], prefix: str) -> Self:
        values: dict[str, Any] = {}
        added = {each.name for each in dataclasses.fields(cls) if each.metadata.get("added")}
        for name, default in _defaults(cls).items():
            key = prefix + name
            if name in added and not any(one.startswith(f"{key}.") for one in rest):
                values[name] = default
                continue
            if isinstance(default, Tallies):
                values[name] = default._read(rest, key + ".")
                continue
            stored = rest.pop(key)
            if isinstance(default, int | float):
                number = float(stored)
                if isinstance(default, int) and not number.is_integer():
                    raise ValueError(f"{key} is {stored!r}, not a count")
                values[name] = type(default)(stored)
            else:
                values[name] = default.from_json(stored)
        return cls(**values)

    @classmethod
    def resampled(cls, every: Sequence[Self], weights: NDArray[np.int64]) -> Iterator[Self]:
        """Yield weighted sums of tallies, one for each row of `weights`.

        Parameters
        ----------
        every : sequence of Tallies, n of them
        weights : ndarray of int64, shape (resamples, n)
            How many times each is taken.
        """
        columns = {name: cls._sums(name, default, every, weights) for name, default in _defaults(cls).items()}
        for row in zip(*columns.values(), strict=True):
            yield cls(**dict(zip(columns, row, strict=True)))

    @classmethod
    def _sums(cls, name: str, default: Any, every: Sequence[Self], weights: NDArray[np.int64]) -> Iterator[Any]:
        values = [getattr(tallies, name) for tallies in every]
        if isinstance(default, Tallies):
            return default.resampled(values, weights)
        if isinstance(default, int | float):
            numbers = np.array(values, dtype=np.int64 if isinstance(default, int) else np.float64)
            return iter((weights @ numbers).tolist())
        found: Iterator[Any] = default.weighted_sums(values, weights)
        return found


def _defaults(kind: type[Tallies]) -> dict[str, Any]:
    """Return the default of every field: what it is when nothing was counted."""
    return {
        each.name: each.default if each.default_factory is dataclasses.MISSING else each.default_factory()
        for each in dataclasses.fields(kind)
    }
