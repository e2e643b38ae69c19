"""Overlaps of two stores, part by part.

A pair of footprints is found in every part that holds both of them, and is owned by one: the part of the tile in which
the lower left corner of the common bounds lies. So each pair is measured once, by the same code and from the same
numbers as in memory, and the graph of all pairs is whole, however the plane is divided.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.tasks import run_tasks
from .bounds_index import BoundsTree, meeting_bounds, meeting_bounds_within
from .groups import Members
from .outline_arrays import Outlines, polygons_of
from .outline_overlaps import shared_by_outlines, shared_within
from .outline_store import Division, OutlineStore, StoredPart, part_of_points
from .overlaps import NUMERICAL_ZERO, Overlaps
from .polygon_overlay import common_ground, united_area
from .united import united_areas
from .vertex_distances import ring_distances

__all__ = ["PairTable", "PartGraph", "find_pairs", "united_from_stores"]

#: Most pairs of one part whose bounds meet.
_MOST_PAIRS = 5e7
#: Members whose outlines are in memory at a time.
_MOST_MEMBERS = 1 << 20
#: Columns of the pairs of two sides, and of one.
_BETWEEN, _WITHIN = ("first", "second", "area", "outline", "polis"), ("first", "second", "area")


@dataclass(frozen=True, eq=False)
class PairTable:
    """Pairs of two sides that share area, with their distances, sorted by (first, second).

    Attributes
    ----------
    overlaps : Overlaps
    outline, polis : ndarray, shape (n,)
        As of `PairDistances`, m; NaN where the pair shares no more than rounding.
    """

    overlaps: Overlaps
    outline: NDArray[np.float64]
    polis: NDArray[np.float64]

    def only_significant(self) -> PairTable:
        """Return the pairs that overlap in the sense of the evaluation."""
        kept = self.overlaps.significant
        if kept.all():
            return self
        return PairTable(self.overlaps.where(kept), self.outline[kept], self.polis[kept])

    def places(self, first: NDArray[np.int64], second: NDArray[np.int64], width: int) -> NDArray[np.int64]:
        """Return where these pairs stand; `width` is the number of footprints of the second side."""
        keys = self.overlaps.first * width + self.overlaps.second
        places: NDArray[np.int64] = np.searchsorted(keys, first * width + second)
        return places


class _Task(NamedTuple):
    """One part to be measured, in a form that another process can take."""

    folders: tuple[Path, ...]
    division: Division
    couples: tuple[tuple[int, int], ...]
    file: Path
    number: int


@dataclass(frozen=True, eq=False)
class PartGraph:
    """The pairs of some stores, found part by part and kept in a folder.

    Attributes
    ----------
    stores : tuple of OutlineStore
        Complete, of one division.
    folder : Path
    """

    stores: tuple[OutlineStore, ...]
    folder: Path

    def within(self, place: int) -> Overlaps:
        """Return the pairs within the store at `place`."""
        first, second, area = self._columns(f"{place}", _WITHIN, place)
        sizes = self.stores[place].objects.areas
        return Overlaps.of(first, second, area, (sizes, sizes))

    def between(self, one: int, two: int) -> PairTable:
        """Return the pairs of two stores with their distances."""
        first, second, area, outline, polis = self._columns(f"{one}-{two}", _BETWEEN, two)
        sizes = self.stores[one].objects.areas, self.stores[two].objects.areas
        return PairTable(Overlaps.of(first, second, area, sizes), outline, polis)

    def _columns(self, name: str, columns: Sequence[str], second: int) -> tuple[NDArray[Any], ...]:
        """Return columns of all parts, sorted by (first, second)."""
        width = len(self.stores[second].objects)
        keys = self._joined(f"{name}.first") * width + self._joined(f"{name}.second")
        order = np.argsort(keys)
        del keys
        return tuple(self._joined(f"{name}.{column}")[order] for column in columns)

    def _joined(self, name: str) -> NDArray[Any]:
        columns = []
        for number in range(self.stores[0].division.parts):
            with np.load(_file(self.folder, number), allow_pickle=False) as found:
                columns.append(found[name])
        return np.concatenate(columns)


def find_pairs(
    stores: Sequence[OutlineStore],
    couples: Sequence[tuple[int, int]],
    folder: Path,
    *,
    progress: Callable[[int, int], None],
    executor: Executor | None = None,
) -> PartGraph:
    """Find the pairs of some couples of stores, and those within each store.

    What is found in a part is kept in `folder`; parts that are there already are not computed again.

    Parameters
    ----------
    stores : sequence of OutlineStore
        Complete, of one division.
    couples : sequence of tuple of int
        Places in `stores`.
    folder : Path
    progress : callable
        Takes the number of finished parts and of all.
    executor : Executor, optional
        Where the parts are measured; its processes must see the folders. By default the threads of this process.

    Raises
    ------
    InputError
        So many footprints lie on each other that their pairs would fill the memory.
    """
    folder = folder.absolute()  # the processes of an executor may have another working folder
    folder.mkdir(exist_ok=True)
    division = stores[0].division
    tasks = [
        _Task(tuple(store.folder for store in stores), division, tuple(couples), _file(folder, number), number)
        for number in range(division.parts)
    ]
    missing = [task for task in tasks if not task.file.is_file()]
    if len(missing) < len(tasks):
        progress(len(tasks) - len(missing), len(tasks))
    for done in run_tasks(_measure_part, missing, executor):
        progress(done + len(tasks) - len(missing), len(tasks))
    return PartGraph(tuple(stores), folder)


def _file(folder: Path, number: int) -> Path:
    return folder / f"{number}.npz"


def _measure_part(task: _Task) -> None:
    """Find the pairs of one part and write them; the file appears whole or not at all."""
    found = _pairs_of_part([OutlineStore(folder, task.division) for folder in task.folders], task.couples, task.number)
    temporary = task.file.with_name(f"unfinished-{task.number}.npz")
    np.savez(temporary, allow_pickle=False, **found)
    temporary.replace(task.file)


def _pairs_of_part(
    stores: Sequence[OutlineStore], couples: Sequence[tuple[int, int]], number: int
) -> dict[str, NDArray[Any]]:
    parts = [store.part(number) for store in stores]
    trees = [BoundsTree.of(part.outlines.bounds) for part in parts]
    found: dict[str, NDArray[Any]] = {}
    for place, (store, part) in enumerate(zip(stores, parts, strict=True)):
        rows, outlines = part.rows, part.outlines
        first, second = _few(meeting_bounds_within(trees[place], most=_MOST_PAIRS), store)
        owned = _owned(store, outlines, outlines, first, second, number)
        first, second = first[owned], second[owned]
        area = shared_within(outlines, first, second)
        shares = area > 0
        inside = rows[first[shares]], rows[second[shares]], area[shares]
        found |= {f"{place}.{name}": column for name, column in zip(_WITHIN, inside, strict=True)}
    for couple in couples:
        one, two = couple
        pairs = _few(meeting_bounds(trees[one], trees[two], most=_MOST_PAIRS), stores[one])
        columns = _between(stores[one], parts[one], parts[two], pairs, number)
        name = f"{couple[0]}-{couple[1]}"
        found |= {f"{name}.{column}": values for column, values in zip(_BETWEEN, columns, strict=True)}
    return found


def _between(
    store: OutlineStore,
    part: StoredPart,
    other: StoredPart,
    meeting: tuple[NDArray[np.int64], NDArray[np.int64]],
    number: int,
) -> tuple[NDArray[Any], ...]:
    """Return the columns of the pairs of one part of two sides; `meeting` are those whose bounds meet."""
    one, two = part.outlines, other.outlines
    first, second = meeting
    owned = _owned(store, one, two, first, second, number)
    first, second = first[owned], second[owned]
    area = shared_by_outlines(one, two, first, second)
    shares = area > 0
    first, second, area = first[shares], second[shares], area[shares]
    distances = np.full((2, len(first)), np.nan)
    overlap = np.flatnonzero(area > NUMERICAL_ZERO * np.minimum(one.area[first], two.area[second]))
    corners = part.quadrilateral[first[overlap]] & other.quadrilateral[second[overlap]]
    outline, _, polis = ring_distances(one[:2], two[:2], first[overlap], second[overlap], corners)
    distances[0, overlap], distances[1, overlap] = outline, polis
    return part.rows[first], other.rows[second], area, *distances


def _few(
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]] | None, store: OutlineStore
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    if pairs is None:
        raise InputError(
            f"{store.facts.get('source', 'footprints')}: footprints of one part of the plane lie on each other or on "
            f"others in more than {_MOST_PAIRS:,.0f} pairs: is it a stack of duplicates, or of candidates before their "
            "selection?"
        )
    return pairs


def _owned(
    store: OutlineStore,
    one: Outlines,
    two: Outlines,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    number: int,
) -> NDArray[np.bool_]:
    corner = np.maximum(one.bounds[first, :2], two.bounds[second, :2])
    owned: NDArray[np.bool_] = part_of_points(corner, store.division) == number
    return owned


def united_from_stores(
    detected: OutlineStore, reference: OutlineStore, kind: str, members: Members
) -> NDArray[np.float64]:
    """Return the area of the union of each group, from outlines on disk; see `tally_areas`."""
    sides = (reference, reference) if kind == "reference" else (detected, reference)
    areas = np.empty(len(members.start) - 1)
    begin = 0
    while begin < len(areas):
        # As many whole groups as fit, at least one.
        end = int(np.searchsorted(members.start, members.start[begin] + _MOST_MEMBERS, side="right")) - 1
        end = min(max(end, begin + 1), len(areas))
        part = slice(members.start[begin], members.start[end])
        rows_one, one = np.unique(members.one[part], return_inverse=True)
        has = members.two[part] >= 0
        rows_two, two_of = np.unique(members.two[part][has], return_inverse=True)
        two = np.full(len(has), -1, dtype=np.int64)
        two[has] = two_of
        outlines = sides[0].outlines(rows_one), sides[1].outlines(rows_two)
        few = Members(members.start[begin : end + 1] - members.start[begin], one.astype(np.int64), two)
        areas[begin:end] = united_areas(*outlines, few)
        for group in np.flatnonzero(np.isnan(areas[begin:end])).tolist():
            inside = slice(few.start[group], few.start[group + 1])
            ground = polygons_of(outlines[0], few.one[inside])
            if kind == "pairs":
                ground = common_ground(ground, polygons_of(outlines[1], few.two[inside]))
            areas[begin + group] = united_area(ground)
        begin = end
    return areas
