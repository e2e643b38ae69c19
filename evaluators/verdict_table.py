"""Verdicts: what each object counts as, and why.

Nouns
-----
side
    The detections or the references.
verdict kind
    What an object may count as, declared by the evaluator with a label, a colour role and its effect on the rates.
measure
    A number of each object beside its verdict, such as the shared area with its partner.
verdict table
    The verdicts of one side as typed columns. It is the one form of verdicts: the evaluator makes it, the store keeps
    its bytes, and maps, reports, GIS layers and data frames are made from it.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, Self, TypeAlias, overload

import numpy as np
from numpy.typing import NDArray

from ..core.display import Displayed
from ..core.errors import InputError
from ..core.wording import counted
from ..scenes.geodata.footprints import Footprints

if TYPE_CHECKING:
    import geopandas as gpd

__all__ = [
    "SIDES",
    "ColourRole",
    "CountsAs",
    "LazyReasons",
    "Measure",
    "Side",
    "VerdictKind",
    "VerdictTable",
    "Verdicts",
    "rows_of_kinds",
]

Side: TypeAlias = Literal["detection", "reference"]
SIDES: tuple[Side, Side] = ("detection", "reference")
#: How objects of a kind are drawn: ``outline`` as a line only, because the object on the other side is filled.
ColourRole: TypeAlias = Literal["correct", "partial", "excess", "missing", "left out", "outline"]
#: Effect on rates: ``duplicate`` is shown among the errors and enters no rate, ``neutral`` is in neither.
CountsAs: TypeAlias = Literal["correct", "wrong", "duplicate", "neutral"]

#: Rows whose reasons are written at a time.
_STRETCH = 1 << 16
_MAGIC = b"roofbench-verdicts-1\n"
_LONGEST_HEADER = 1 << 16
_MOST_BYTES = 1 << 34
#: Decimals that are worth printing, by unit.
_DECIMALS = {"m": 2, "m2": 1, "fraction": 3, "count": 0}


@dataclass(frozen=True, kw_only=True)
class VerdictKind:
    """What an object may count as.

    Attributes
    ----------
    key : str
        Short name in tables and files: ``"TP"``.
    label : str
        What it means, for legends: ``"detected building"``.
    side : {"detection", "reference"}
    role : {"correct", "partial", "excess", "missing", "left out", "outline"}
        How it is drawn.
    counts_as : {"correct", "wrong", "duplicate", "neutral"}
    """

    key: str
    label: str
    side: Side
    role: ColourRole
    counts_as: CountsAs

    @property
    def legend(self) -> str:
        """Key and label: ``TP: detected building``."""
        return self.label if self.key in self.label else f"{self.key}: {self.label}"

    @property
    def is_error(self) -> bool:
        """Whether objects of this kind are shown among the errors."""
        return self.counts_as in ("wrong", "duplicate")


@dataclass(frozen=True, kw_only=True)
class Measure:
    """A number of each object: key (the column's name), title in words, and unit as of `Index` or ``"m2"``."""

    key: str
    title: str
    unit: str

    @property
    def decimals(self) -> int:
        """Number of decimals worth printing."""
        return _DECIMALS.get(self.unit, 3)


class LazyReasons(Sequence[str]):
    """Reasons in words that are written only when they are asked for, a stretch of rows at a time.

    A city has a million of them, and most evaluations are never asked.

    Parameters
    ----------
    count : int
        Number of rows.
    words : callable
        Takes a slice of rows with start and stop, and returns their reasons.
    """

    def __init__(self, count: int, words: Callable[[slice], NDArray[np.object_]]) -> None:
        self._count, self._words = count, words

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> str: ...

    @overload
    def __getitem__(self, index: slice) -> list[str]: ...

    def __getitem__(self, index: int | slice) -> str | list[str]:
        if isinstance(index, slice):
            start, stop, step = index.indices(self._count)
            if step == 1:
                texts: list[str] = self._words(slice(start, max(start, stop))).tolist()
                return texts
            return [self[row] for row in range(start, stop, step)]
        row = range(self._count)[index]
        return str(self._words(slice(row, row + 1))[0])

    def __iter__(self) -> Iterator[str]:
        for start in range(0, self._count, _STRETCH):
            yield from self[start : start + _STRETCH]


def rows_of_kinds(kinds: Sequence[str], kind: NDArray[np.uint8], keys: Sequence[str]) -> NDArray[np.bool_]:
    """Return where `kind`, places in `kinds`, is one of some keys, shape (n,)."""
    return np.isin(kind, [number for number, key in enumerate(kinds) if key in keys])


@dataclass(frozen=True, eq=False, kw_only=True)
class VerdictTable:
    """The verdicts of one side, one row per object in the order of the footprints.

    Attributes
    ----------
    ids : ndarray of int64, shape (n,)
        Row of each object in its source.
    kinds : tuple of str
        Keys of the verdict kinds that `kind` refers to.
    kind : ndarray of uint8, shape (n,)
        Place in `kinds`.
    partner : ndarray of int64, shape (n,)
        Id of the partner on the other side, or of the object that comes closest to one; -1 without any.
    measures : mapping of str to ndarray of float64, shape (n,)
        NaN where undefined.
    reasons : sequence of str
        Why, in words: a tuple, or `LazyReasons` that are written when they are asked for.

    Examples
    --------
    >>> table = VerdictTable.of(["TP", "FP"], kinds=("TP", "FP"), partner=[7, -1], reasons=["found", "false alarm"])
    >>> copy = VerdictTable.from_bytes(table.to_bytes())
    >>> copy.verdicts.tolist(), copy.partner.tolist(), copy.count("FP")
    (['TP', 'FP'], [7, -1], 1)
    """

    ids: NDArray[np.int64]
    kinds: tuple[str, ...]
    kind: NDArray[np.uint8]
    partner: NDArray[np.int64]
    measures: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    reasons: Sequence[str]

    def __post_init__(self) -> None:
        lengths = {len(self.ids), len(self.kind), len(self.partner), len(self.reasons)}
        lengths |= {len(column) for column in self.measures.values()}
        if len(lengths) > 1:
            raise ValueError(f"the columns of a verdict table have different lengths: {sorted(lengths)}")
        if len(self.kinds) > 256 or (len(self.kind) and int(self.kind.max()) >= len(self.kinds)):
            raise ValueError("a verdict table refers to kinds that it does not name")

    @classmethod
    def of(
        cls,
        verdicts: Sequence[str] | NDArray[Any],
        *,
        kinds: Sequence[str],
        reasons: Sequence[str],
        ids: Sequence[int] | NDArray[np.int64] | None = None,
        partner: Sequence[int] | NDArray[np.int64] | None = None,
        measures: Mapping[str, Any] | None = None,
    ) -> Self:
        """Build a table from the key of each verdict; ids count from 0 and there are no partners by default."""
        count = len(verdicts)
        place = {key: number for number, key in enumerate(kinds)}
        return cls(
            ids=np.arange(count, dtype=np.int64) if ids is None else np.asarray(ids, dtype=np.int64),
            kinds=tuple(kinds),
            kind=np.array([place[str(key)] for key in verdicts], dtype=np.uint8),
            partner=np.full(count, -1, dtype=np.int64) if partner is None else np.asarray(partner, dtype=np.int64),
            measures={name: np.asarray(column, dtype=np.float64) for name, column in (measures or {}).items()},
            reasons=tuple(reasons),
        )

    def __len__(self) -> int:
        return len(self.ids)

    @cached_property
    def verdicts(self) -> NDArray[np.object_]:
        """Key of each object's verdict, shape (n,)."""
        return np.array([*self.kinds, ""], dtype=object)[self.kind]

    def where(self, *keys: str) -> NDArray[np.bool_]:
        """Return which objects have one of these verdicts, shape (n,)."""
        return rows_of_kinds(self.kinds, self.kind, keys)

    def count(self, *keys: str) -> int:
        """Return how many objects have one of these verdicts."""
        return int(self.where(*keys).sum())

    def measure(self, key: str) -> NDArray[np.float64]:
        """Return a measure; all NaN where the table does not have it."""
        found = self.measures.get(key)
        return np.full(len(self), np.nan) if found is None else found

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns by name, as files and data frames have them; a missing partner is masked."""
        return {
            "id": self.ids,
            "verdict": self.verdicts,
            "partner": np.ma.masked_array(self.partner, self.partner < 0),
            **self.measures,
            "reason": np.array([*self.reasons, ""], dtype=object)[:-1],
        }

    def to_bytes(self) -> bytes:
        """Return the table as bytes that `from_bytes` reads: a JSON header, then compressed columns."""
        texts = [reason.encode("utf-8", "surrogatepass") for reason in self.reasons]
        header = json.dumps(
            {
                "rows": len(self),
                "kinds": list(self.kinds),
                "measures": list(self.measures),
                "text": sum(map(len, texts)),
            }
        ).encode()
        columns = [
            self.ids.astype("<i8").tobytes(),
            self.kind.astype("u1").tobytes(),
            self.partner.astype("<i8").tobytes(),
            *(column.astype("<f8").tobytes() for column in self.measures.values()),
            np.cumsum([len(text) for text in texts], dtype="<i8").tobytes(),
            *texts,
        ]
        return b"".join([_MAGIC, struct.pack("<I", len(header)), header, zlib.compress(b"".join(columns), 1)])

    @classmethod
    def from_bytes(cls, content: bytes) -> Self:
        """Read what `to_bytes` wrote.

        Raises
        ------
        InputError
            The bytes are no verdict table: truncated, changed, or of another format.
        """
        try:
            return cls._read(content)
        except (ValueError, KeyError, TypeError, IndexError, struct.error, zlib.error, RecursionError) as error:
            raise InputError(
                f"stored verdicts are damaged ({error}): delete the run and run it again, or evaluate with "
                "'roofbench score'"
            ) from error

    @classmethod
    def _read(cls, content: bytes) -> Self:
        if not content.startswith(_MAGIC):
            raise ValueError("they do not begin as a verdict table does")
        start = len(_MAGIC) + 4
        (length,) = struct.unpack_from("<I", content, len(_MAGIC))
        if length > _LONGEST_HEADER:
            raise ValueError("the header is too long")
        header = json.loads(content[start : start + length].decode())
        rows, text = header["rows"], header["text"]
        kinds, names = (_texts(header[key]) for key in ("kinds", "measures"))
        if not all(isinstance(number, int) and number >= 0 for number in (rows, text)):
            raise ValueError("the header holds no valid numbers")
        size = rows * (8 + 1 + 8 + 8 * len(names) + 8) + text
        if size > _MOST_BYTES:
            raise ValueError("the header states too many rows")
        decompressor = zlib.decompressobj()
        # Never more than the header states, whatever the compressed part would expand to.
        data = decompressor.decompress(content[start + length :], size + 1)
        if len(data) != size or not decompressor.eof or decompressor.unused_data:
            raise ValueError("the columns do not have the stated size")
        place = 0

        def column(kind: str) -> NDArray[Any]:
            nonlocal place
            found = np.frombuffer(data, kind, rows, place)
            place += found.nbytes
            return found

        ids, kind, partner = column("<i8"), column("u1"), column("<i8")
        measures = {name: column("<f8").astype(np.float64) for name in names}
        ends = column("<i8").tolist()
        if ends != sorted(ends) or (ends and (ends[0] < 0 or ends[-1] != text)) or (text and not ends):
            raise ValueError("the texts do not have the stated size")
        begins = [0, *ends[:-1]]
        return cls(
            ids=ids.astype(np.int64),
            kinds=kinds,
            kind=kind.astype(np.uint8),
            partner=partner.astype(np.int64),
            measures=measures,
            reasons=tuple(
                data[place + begin : place + end].decode("utf-8", "surrogatepass")
                for begin, end in zip(begins, ends, strict=False)
            ),
        )


def _texts(values: Any) -> tuple[str, ...]:
    if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
        raise ValueError("the header holds no list of names")
    if len(set(values)) < len(values):
        raise ValueError("the header names a column twice")
    return tuple(values)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Verdicts(Displayed):
    """The verdicts of both sides with their footprints.

    Attributes
    ----------
    kinds : tuple of VerdictKind
        Every kind that the evaluator declares.
    measures : tuple of Measure
    detection_table, reference_table : VerdictTable
    detected, reference : Footprints
        What the rows of the tables are about.
    """

    shown_by = "reports.notebook_view:verdicts_view"

    kinds: tuple[VerdictKind, ...]
    measures: tuple[Measure, ...]
    detection_table: VerdictTable
    reference_table: VerdictTable
    detected: Footprints
    reference: Footprints

    def __post_init__(self) -> None:
        for side, table, footprints in self.sides:
            if len(table) != len(footprints):
                numbers = f"{counted(len(table), 'verdict')} for {counted(len(footprints), side)}"
                raise InputError(f"{numbers}: they are of another set of footprints")
            unknown = set(table.kinds) - {kind.key for kind in self.kinds_of(side)}
            if unknown:
                raise InputError(
                    f"the evaluator does not declare the verdict {min(unknown)!r} of {side}s: evaluate again with "
                    "'roofbench score'"
                )

    def __repr__(self) -> str:
        sides = []
        for side, table, _ in self.sides:
            numbers = [f"{table.count(kind.key)} {kind.key}" for kind in self.kinds_of(side) if table.count(kind.key)]
            sides.append(f"{len(table)} {side}s" + (f" ({', '.join(numbers)})" if numbers else ""))
        return f"<Verdicts {', '.join(sides)}>"

    @property
    def sides(self) -> tuple[tuple[Side, VerdictTable, Footprints], ...]:
        """Side, table and footprints of the detections, then of the references."""
        return (
            ("detection", self.detection_table, self.detected),
            ("reference", self.reference_table, self.reference),
        )

    def table(self, side: Side) -> VerdictTable:
        """Return the table of a side."""
        return self.detection_table if side == "detection" else self.reference_table

    def footprints(self, side: Side) -> Footprints:
        """Return the footprints of a side."""
        return self.detected if side == "detection" else self.reference

    def kinds_of(self, side: Side) -> tuple[VerdictKind, ...]:
        """Return the verdict kinds of a side, in the order of legends."""
        return tuple(kind for kind in self.kinds if kind.side == side)

    def mask(self, kind: VerdictKind) -> NDArray[np.bool_]:
        """Return which objects of the kind's side are of it."""
        return self.table(kind.side).where(kind.key)

    @property
    def crs(self) -> str | None:
        """CRS of the footprints; None where neither side has one."""
        return self.reference.crs or self.detected.crs

    def columns(self, side: Side) -> dict[str, NDArray[Any]]:
        """Return the columns of a side without geometry: those of its table, then the footprints' own attributes."""
        own = self.table(side).columns()
        return own | {name: column for name, column in self.footprints(side).attributes.items() if name not in own}

    @cached_property
    def detections(self) -> gpd.GeoDataFrame:
        """One row per detection with its geometry and CRS; a missing partner is <NA>."""
        return self._frame("detection")

    @cached_property
    def references(self) -> gpd.GeoDataFrame:
        """One row per reference; see `detections`."""
        return self._frame("reference")

    def _frame(self, side: Side) -> gpd.GeoDataFrame:
        from ..scenes.geodata.frames import geo_frame

        return geo_frame(self.columns(side), self.footprints(side).polygons, self.crs)
