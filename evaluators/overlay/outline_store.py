"""Outlines on disk: one side of a comparison that is too large for the memory, divided by place.

Nouns
-----
tile
    A square of `Division.tile` metres of the plane, aligned with the origin of the CRS.
part
    All tiles whose hash has one value. Every part holds tiles from everywhere, so parts are of nearly equal size, and
    neither their number nor their size depends on the extent of the data or on the order of the file.
home
    The part of the tile in which the lower left corner of a footprint's bounds lies. A footprint is written into every
    part that its bounds touch; what belongs to one footprint is read from its home.

A store is a folder. For each part: ``rows``, ``counts`` (vertices of each outline) and ``points``, as raw arrays. For
the whole side: what `StoredObjects` list, row by row in the order of the file.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.outline_batch import OutlineBatch
from .outline_arrays import Outlines

__all__ = ["Division", "OutlineStore", "StoredObjects", "StoredPart", "part_of_points"]

_DONE = "done.json"


@dataclass(frozen=True)
class Division:
    """How the plane is divided: number of parts, and size of a tile, m."""

    parts: int
    tile: float = 1000.0


@dataclass(frozen=True, eq=False)
class StoredObjects:
    """What is known of each footprint of a store without its outline; see `Footprints`.

    Attributes
    ----------
    ids, areas, building_codes : ndarray
    quadrilateral : ndarray of bool, shape (n,)
        Convex quadrilaterals without holes.
    read_centres : callable
        Returns the centres, which are needed rarely and stay on disk.
    """

    ids: NDArray[np.int64]
    areas: NDArray[np.float64]
    building_codes: NDArray[np.int64]
    quadrilateral: NDArray[np.bool_]
    read_centres: Callable[[], NDArray[np.float64]]

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def centres(self) -> NDArray[np.float64]:
        """Centre of each footprint, m, shape (n, 2)."""
        return self.read_centres()

    def take(self, rows: NDArray[np.int64]) -> StoredObjects:
        """Return the footprints of some rows."""
        centres = self.centres[rows]
        return StoredObjects(
            self.ids[rows], self.areas[rows], self.building_codes[rows], self.quadrilateral[rows], lambda: centres
        )


class StoredPart(NamedTuple):
    """The footprints of one part.

    Attributes
    ----------
    rows : ndarray of int64, shape (n,)
        In ascending order.
    outlines : Outlines
    quadrilateral : ndarray of bool, shape (n,)
        As of `StoredObjects`.
    """

    rows: NDArray[np.int64]
    outlines: Outlines
    quadrilateral: NDArray[np.bool_]


class OutlineStore:
    """One side of a comparison on disk.

    Parameters
    ----------
    folder : Path
        Made by `write`, which may have been interrupted.
    division : Division
    """

    def __init__(self, folder: Path, division: Division) -> None:
        self.folder, self.division = folder, division

    @property
    def complete(self) -> bool:
        """Whether `write` came to its end."""
        return (self.folder / _DONE).is_file()

    @cached_property
    def facts(self) -> dict[str, Any]:
        """What `finish` was given: facts of the side that JSON can hold."""
        content: dict[str, Any] = json.loads((self.folder / _DONE).read_text(encoding="utf-8"))
        return content

    def write(self, batches: Iterable[OutlineBatch]) -> None:
        """Write footprints, batch by batch; what an interrupted attempt left behind is removed first."""
        self.folder.mkdir(parents=True, exist_ok=True)
        for old in self.folder.iterdir():
            old.unlink()
        filled = np.zeros(self.division.parts, dtype=np.int64)
        row = 0
        for batch in batches:
            start, points, count = batch.start, batch.points, len(batch)
            outlines = Outlines.of(start, points, batch.areas)
            place, part = _touched(outlines.bounds, self.division.tile, self.division.parts)
            order = np.argsort(part, kind="stable")
            place, part = place[order], part[order]
            home = part_of_points(outlines.bounds[:, :2], self.division)
            offset = np.empty(count, dtype=np.int64)
            for begin, end in _runs(part):
                members, name = place[begin:end], int(part[begin])
                counts = np.diff(start)[members]
                into = np.concatenate([[0], np.cumsum(counts)])
                here = home[members] == name
                offset[members[here]] = filled[name] + into[:-1][here]
                filled[name] += into[-1]
                gathered = np.empty((into[-1], 2))
                _gather(points, start, members, into, gathered)
                self._append(f"{name}.rows", row + members)
                self._append(f"{name}.counts", counts)
                self._append(f"{name}.points", gathered)
            centres, quadrilateral = batch.shape()
            for column, values in (
                ("ids", batch.ids),
                ("areas", batch.areas),
                ("centres", centres),
                ("quadrilateral", quadrilateral),
                ("home", home.astype(np.int32)),
                ("offset", offset),
                ("count", np.diff(start).astype(np.int32)),
            ):
                self._append(column, values)
            row += count

    def finish(self, building_codes: NDArray[np.int64] | None, **facts: object) -> None:
        """Mark the store as complete; `building_codes` are those of all rows, None where each is its own building."""
        if building_codes is not None:
            self._append("building_codes", building_codes)
        temporary = self.folder / "unfinished.json"
        temporary.write_text(json.dumps(facts), encoding="utf-8")
        temporary.replace(self.folder / _DONE)

    @cached_property
    def objects(self) -> StoredObjects:
        """All footprints, without their outlines."""
        ids = self._read("ids", np.int64)
        codes = self.folder / "building_codes"
        return StoredObjects(
            ids=ids,
            areas=self._read("areas", np.float64),
            building_codes=self._read("building_codes", np.int64) if codes.is_file() else np.arange(len(ids)),
            quadrilateral=self._read("quadrilateral", np.bool_),
            read_centres=lambda: self._read("centres", np.float64).reshape(-1, 2),
        )

    def part(self, number: int) -> StoredPart:
        """Return the footprints of a part, in the order of the file."""
        rows = self._read(f"{number}.rows", np.int64)
        counts = self._read(f"{number}.counts", np.int64)
        start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        points = self._read(f"{number}.points", np.float64).reshape(-1, 2)
        outlines = Outlines.of(start, points, self._of_rows("areas", np.float64, rows))
        return StoredPart(rows, outlines, self._of_rows("quadrilateral", np.bool_, rows))

    def outlines(self, rows: NDArray[np.int64]) -> Outlines:
        """Return the outlines of some rows, in their order."""
        home, offset, count = (
            self._of_rows(name, kind, rows)
            for name, kind in (("home", np.int32), ("offset", np.int64), ("count", np.int32))
        )
        into = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
        points = np.empty((into[-1], 2))
        order = np.argsort(home, kind="stable")
        for begin, end in _runs(home[order]):
            members = order[begin:end]
            every = self._mapped(f"{home[members[0]]}.points", np.float64).reshape(-1, 2)
            _fetch(every, offset[members], members, into, points)
        return Outlines.of(into, points, self.objects.areas[rows])

    def _of_rows(self, name: str, kind: type[np.generic], rows: NDArray[np.int64]) -> NDArray[Any]:
        """Return the values of some rows without reading the others."""
        return np.asarray(self._mapped(name, kind)[rows])

    def _mapped(self, name: str, kind: type[np.generic]) -> NDArray[Any]:
        file = self.folder / name
        if not file.is_file() or not file.stat().st_size:
            return np.empty(0, dtype=kind)
        return np.asarray(np.memmap(file, dtype=kind, mode="r"))

    def _append(self, name: str, values: NDArray[Any]) -> None:
        with (self.folder / name).open("ab") as stream:
            np.ascontiguousarray(values).tofile(stream)

    def _read(self, name: str, kind: type[np.generic]) -> NDArray[Any]:
        file = self.folder / name
        return np.fromfile(file, dtype=kind) if file.is_file() else np.empty(0, dtype=kind)


def part_of_points(points: NDArray[np.float64], division: Division) -> NDArray[np.int64]:
    """Return the part of the tile in which each point lies, shape (n,)."""
    parts = np.empty(len(points), dtype=np.int64)
    _parts(np.ascontiguousarray(points), division.tile, division.parts, parts)
    return parts


def _runs(values: NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """Yield where each run of equal values begins and ends."""
    begins = np.flatnonzero(np.diff(values, prepend=-1)).tolist()
    yield from pairwise([*begins, len(values)])


@kernel
def _part(x: np.int64, y: np.int64, parts: int) -> np.int64:
    """Return the part of a tile: its two numbers, mixed (the finaliser of MurmurHash3)."""
    key = np.uint64(x) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(y)
    key ^= key >> np.uint64(33)
    key *= np.uint64(0xFF51AFD7ED558CCD)
    key ^= key >> np.uint64(33)
    key *= np.uint64(0xC4CEB9FE1A85EC53)
    key ^= key >> np.uint64(33)
    return np.int64(key % np.uint64(parts))


@kernel
def _parts(points: NDArray[np.float64], tile: float, parts: int, found: NDArray[np.int64]) -> None:
    """Fill the part in which each point lies."""
    for i in range(len(found)):
        x, y = np.int64(np.floor(points[i, 0] / tile)), np.int64(np.floor(points[i, 1] / tile))
        found[i] = _part(x, y, parts)


@kernel
def _touched(bounds: NDArray[np.float64], tile: float, parts: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return row and part of each footprint in each part that its bounds touch."""
    rows, found = np.empty(2 * len(bounds) + 16, dtype=np.int64), np.empty(2 * len(bounds) + 16, dtype=np.int64)
    last = np.full(parts, -1, dtype=np.int64)
    count = 0
    for i in range(len(bounds)):
        x0, x1 = np.int64(np.floor(bounds[i, 0] / tile)), np.int64(np.floor(bounds[i, 2] / tile))
        y0, y1 = np.int64(np.floor(bounds[i, 1] / tile)), np.int64(np.floor(bounds[i, 3] / tile))
        # An outline over more tiles than there are parts is in every part.
        everywhere = (x1 - x0 + 1) * (y1 - y0 + 1) > 8 * parts
        if everywhere:
            x0, x1 = np.int64(0), np.int64(parts - 1)
            y0, y1 = np.int64(0), np.int64(0)
        for x in range(x0, x1 + 1):
            for y in range(y0, y1 + 1):
                part = x if everywhere else _part(x, y, parts)
                if last[part] == i:
                    continue
                last[part] = i
                if count == len(rows):
                    more_rows, more_found = np.empty(2 * count, dtype=np.int64), np.empty(2 * count, dtype=np.int64)
                    more_rows[:count], more_found[:count] = rows, found
                    rows, found = more_rows, more_found
                rows[count], found[count] = i, part
                count += 1
    return rows[:count].copy(), found[:count].copy()


@kernel
def _gather(
    points: NDArray[np.float64],
    start: NDArray[np.int64],
    members: NDArray[np.int64],
    into: NDArray[np.int64],
    gathered: NDArray[np.float64],
) -> None:
    """Fill the vertices of members, in the order of the members."""
    for m in range(len(members)):
        begin = start[members[m]]
        for k in range(into[m + 1] - into[m]):
            gathered[into[m] + k, 0], gathered[into[m] + k, 1] = points[begin + k, 0], points[begin + k, 1]


@kernel
def _fetch(
    points: NDArray[np.float64],
    offset: NDArray[np.int64],
    members: NDArray[np.int64],
    into: NDArray[np.int64],
    fetched: NDArray[np.float64],
) -> None:
    """Fill the vertices of members at their places among all."""
    for m in range(len(members)):
        begin, place = offset[m], members[m]
        for k in range(into[place + 1] - into[place]):
            fetched[into[place] + k, 0], fetched[into[place] + k, 1] = points[begin + k, 0], points[begin + k, 1]
