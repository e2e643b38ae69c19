"""The seam pass: what the tiles of a city found becomes one set of footprints.

Of footprints that two tiles found (IoU above 0.5) one stays; a cut one is replaced by the whole one, or joined with the
cut parts of other tiles; a spare one is added where nothing else stands.

Footprints depend on each other only where they touch. So a strip, one row of tiles, is written as soon as nothing that
lies further north can touch it, and memory holds a few strips of a city, never the whole.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..scenes.geodata.footprints import Footprints, stacked
from .tiling import CUT, SPARE, Tile

__all__ = ["Seams", "TileFacts", "join_strips", "join_tiles", "tile_facts"]

#: Share of a spare footprint that others may cover where it is added.
_FREE = 0.25
#: Footprints of different tiles with more than this IoU are one; a cut one is replaced where another covers so much of
#: it.
_SAME, _COVERED = 0.5, 0.5


class Seams(NamedTuple):
    """What the seam pass did, numbers of footprints.

    Attributes
    ----------
    doubles : int
        Left out because another tile found the same.
    cut : int
        Left out because another tile sees the whole of it.
    joined : int
        Cut parts that were joined into fewer.
    added : int
        Spare ones that were added.
    """

    doubles: int
    cut: int
    joined: int
    added: int


class TileFacts(NamedTuple):
    """What must be known of all tiles before the first strip is joined.

    Attributes
    ----------
    columns : dict of str to dtype
        Attributes that the footprints of every tile have, with types that hold the values of all.
    labelled : bool
        Whether footprints have building ids.
    lowest : dict of int to float
        Least y of the footprints of each row of tiles, metres.
    kinds : frozenset of int
        Geometry types, as shapely numbers them.
    """

    columns: dict[str, np.dtype[Any]]
    labelled: bool
    lowest: dict[int, float]
    kinds: frozenset[int]


class _Rows(NamedTuple):
    """Footprints that are not written yet, in the order of the result."""

    found: Footprints
    tile: NDArray[np.intp]
    depth: NDArray[np.float64]
    cut: NDArray[np.bool_]
    spare: NDArray[np.bool_]
    settled: NDArray[np.bool_]

    def take(self, rows: NDArray[np.bool_]) -> _Rows:
        cut, spare = self.cut[rows], self.spare[rows]
        return _Rows(self.found.take(rows), self.tile[rows], self.depth[rows], cut, spare, self.settled[rows])


def tile_facts(parts: Iterable[tuple[Tile, Footprints]]) -> TileFacts:
    """Return what must be known of all tiles; one of them is held at a time."""
    columns: dict[str, np.dtype[Any]] | None = None
    lowest: dict[int, float] = {}
    kinds: set[int] = set()
    labelled = False
    for tile, part in parts:
        if not len(part):
            continue
        types = {name: column.dtype for name, column in part.attributes.items()}
        common = types if columns is None else {name: columns[name] for name in columns if name in types}
        columns = {name: np.result_type(kind, types[name]) for name, kind in common.items()}
        low = float(shapely.bounds(part.polygons)[:, 1].min())
        lowest[tile.row] = min(low, lowest.get(tile.row, math.inf))
        kinds.update(np.unique(shapely.get_type_id(part.polygons)).tolist())
        labelled = labelled or part.building_ids is not None
    return TileFacts(columns or {}, labelled, lowest, frozenset(kinds))


def join_tiles(
    parts: Mapping[Tile, Footprints], *, crs: str | None, numbers: Sequence[str] = (), source: str = "footprints"
) -> tuple[Footprints, Seams]:
    """Return the footprints of all tiles after the seam pass, by row and column of their tile, and what it did.

    Parameters
    ----------
    parts : mapping of Tile to Footprints
        As `owned` returns them.
    crs : str, optional
    numbers : sequence of str
        Attributes that number buildings within a tile; they and building ids become unique.
    source : str
    """
    strips = list(join_strips(sorted(parts.items()), tile_facts(parts.items()), numbers=numbers))
    seams = Seams(*np.sum([done for _, done in strips], axis=0).tolist()) if strips else Seams(0, 0, 0, 0)
    found = [strip for strip, _ in strips if len(strip)]
    if not found:
        return Footprints.empty(crs=crs, source=source), seams
    return dataclasses.replace(stacked(found), crs=crs, source=source), seams


def join_strips(
    parts: Iterable[tuple[Tile, Footprints]], facts: TileFacts, *, numbers: Sequence[str] = ()
) -> Iterator[tuple[Footprints, Seams]]:
    """Yield the footprints after the seam pass strip by strip, and what it did for each: `join_tiles` in little memory.

    Parameters
    ----------
    parts : iterable of (Tile, Footprints)
        As `owned` returns them, by row and column of their tile.
    facts : TileFacts
        Of the same tiles.
    numbers : sequence of str
        As for `join_tiles`.
    """
    numbering = _Numbering(facts, numbers)
    filled = ((tile, part) for tile, part in parts if len(part))
    waiting: _Rows | None = None
    ordinals, written = itertools.count(), 0
    for row, strip in itertools.groupby(filled, key=lambda item: item[0].row):
        rows = [_rows(tile, numbering.unique(part), next(ordinals)) for tile, part in strip]
        waiting = _stacked(rows if waiting is None else [waiting, *rows])
        edge = min((low for other, low in facts.lowest.items() if other > row), default=math.inf)
        waiting, seams = _settled(waiting, edge)
        open_rows = np.flatnonzero(~waiting.settled)
        ready = np.arange(len(waiting.found)) < (open_rows[0] if len(open_rows) else len(waiting.found))
        done = waiting.found.take(ready)
        yield dataclasses.replace(done, ids=np.arange(written, written + len(done), dtype=np.int64)), seams
        written += len(done)
        waiting = waiting.take(~ready)


def _rows(tile: Tile, part: Footprints, ordinal: int) -> _Rows:
    columns = dict(part.attributes)
    cut, spare = columns.pop(CUT).astype(np.bool_), columns.pop(SPARE).astype(np.bool_)
    found = dataclasses.replace(part, attributes=columns)
    settled = np.zeros(len(part), dtype=np.bool_)
    return _Rows(found, np.full(len(part), ordinal, dtype=np.intp), tile.depth(part.centres), cut, spare, settled)


def _stacked(rows: Sequence[_Rows]) -> _Rows:
    return _Rows(
        stacked([part.found for part in rows]),
        np.concatenate([part.tile for part in rows]),
        np.concatenate([part.depth for part in rows]),
        np.concatenate([part.cut for part in rows]),
        np.concatenate([part.spare for part in rows]),
        np.concatenate([part.settled for part in rows]),
    )


def _settled(rows: _Rows, edge: float) -> tuple[_Rows, Seams]:
    """Decide on the footprints that nothing north of a y coordinate can change, and leave out what does not stay."""
    undecided = np.flatnonzero(~rows.settled)
    polygons = rows.found.polygons[undecided]
    first, second = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    spare, tile = rows.spare[undecided], rows.tile[undecided]
    linked = (tile[first] != tile[second]) | spare[first] | spare[second]
    links = coo_array((np.ones(linked.sum()), (first[linked], second[linked])), shape=(len(undecided),) * 2)
    count, label = connected_components(links, directed=False)
    top = np.full(count, -math.inf)
    np.maximum.at(top, label, shapely.bounds(polygons).reshape(-1, 4)[:, 3])
    chosen = undecided[top[label] < edge]
    kept, replaced, seams = _decided(rows.take(_mask(chosen, len(rows.settled))))
    polygons = rows.found.polygons.copy()
    polygons[chosen] = replaced
    settled, stays = rows.settled.copy(), np.ones(len(rows.settled), dtype=np.bool_)
    settled[chosen], stays[chosen] = True, kept
    found = dataclasses.replace(rows.found, polygons=polygons)
    return rows._replace(found=found, settled=settled).take(stays), seams


def _mask(rows: NDArray[np.intp], size: int) -> NDArray[np.bool_]:
    mask = np.zeros(size, dtype=np.bool_)
    mask[rows] = True
    return mask


def _decided(rows: _Rows) -> tuple[NDArray[np.bool_], NDArray[np.object_], Seams]:
    """Return which footprints stay, their polygons, and what was done."""
    cut, spare = rows.cut, rows.spare
    owned_rows = np.flatnonzero(~spare)
    kept = np.zeros(len(cut), dtype=np.bool_)
    polygons = rows.found.polygons.copy()
    kept[owned_rows], groups = _seam_pass(
        polygons[owned_rows], rows.tile[owned_rows], rows.depth[owned_rows], cut[owned_rows]
    )
    in_groups = np.zeros(len(cut), dtype=np.bool_)
    for first, group in groups.items():
        members = owned_rows[group]
        polygons[owned_rows[first]] = shapely.union_all(polygons[members])
        in_groups[members] = True
        kept[members] = False
        kept[owned_rows[first]] = True
    added = _added(polygons, kept, np.flatnonzero(spare), rows.depth)
    seams = Seams(
        doubles=int((~kept & ~cut & ~spare).sum()),
        cut=int((~kept & cut & ~spare & ~in_groups).sum()),
        joined=int(in_groups.sum()),
        added=len(added),
    )
    kept[added] = True
    return kept, polygons, seams


def _seam_pass(
    polygons: NDArray[np.object_], tile_of: NDArray[np.intp], depth: NDArray[np.float64], cut: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], dict[int, list[int]]]:
    """Return which footprints stay, and groups of cut ones that are one, by their largest."""
    first, second, common = _overlaps(polygons, polygons, tile_of)
    area = shapely.area(polygons)
    kept = np.ones(len(polygons), dtype=np.bool_)
    same = (common > _SAME * (area[first] + area[second] - common)) & ~(cut[first] & cut[second])
    rivals: dict[int, list[int]] = defaultdict(list)
    for one, other in zip(first[same].tolist(), second[same].tolist(), strict=True):
        rivals[one].append(other)
    # Whole ones first, then those that lie deepest in their tile: they are seen with the most around them.
    settled = np.zeros(len(polygons), dtype=np.bool_)
    for row in sorted(rivals, key=lambda row: (cut[row], -depth[row], row)):
        kept[row] = not any(settled[other] for other in rivals[row])
        settled[row] = kept[row]
    covered = kept[second] & ~cut[second] & cut[first] & (common > _COVERED * area[first])
    kept[first[covered]] = False
    groups: dict[int, list[int]] = {}
    overlap = kept[first] & kept[second] & cut[first] & cut[second] & (common > 0)
    if overlap.any():
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        links = coo_array((np.ones(overlap.sum()), (first[overlap], second[overlap])), shape=(len(polygons),) * 2)
        label = connected_components(links, directed=False)[1]
        for number in np.unique(label[first[overlap]]).tolist():
            rows = np.flatnonzero(label == number)
            groups[int(rows[np.argmax(area[rows])])] = rows.tolist()
    return kept, groups


def _added(
    polygons: NDArray[np.object_], kept: NDArray[np.bool_], spare: NDArray[np.intp], depth: NDArray[np.float64]
) -> list[int]:
    """Return the spare footprints of which kept ones and added ones cover little, the nearest to its tile first.

    The owner of a place can have merged a house with its neighbours into a footprint that is centred in another tile,
    where they are found one by one.
    """
    standing = np.flatnonzero(kept)
    first, _, common = _overlaps(polygons[spare], polygons[standing])
    covered = np.bincount(first, weights=common, minlength=len(spare))
    area = shapely.area(polygons[spare])
    free = np.flatnonzero(covered <= _FREE * area)
    first, second, common = _overlaps(polygons[spare[free]], polygons[spare[free]])
    starts = np.searchsorted(first, np.arange(len(free) + 1))
    taken = np.zeros(len(free), dtype=np.bool_)
    for row in np.lexsort((free, -depth[spare[free]])).tolist():
        near = slice(starts[row], starts[row + 1])
        taken[row] = common[near][taken[second[near]]].sum() <= _FREE * area[free[row]]
    return list(map(int, spare[free[taken]]))


def _overlaps(
    some: NDArray[np.object_], others: NDArray[np.object_], tile_of: NDArray[np.intp] | None = None
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Return the pairs that meet, sorted, and the area that they share; of one set those of different tiles."""
    first, second = shapely.STRtree(others).query(some, predicate="intersects")
    if tile_of is not None:
        across = tile_of[first] != tile_of[second]
        first, second = first[across], second[across]
    order = np.lexsort((second, first))
    first, second = first[order], second[order]
    return first, second, shapely.area(shapely.intersection(some[first], others[second]))


class _Numbering:
    """Numbers of buildings within tiles become numbers of the city, no number twice; columns get their types."""

    def __init__(self, facts: TileFacts, numbers: Sequence[str]) -> None:
        self._facts = facts
        self._numbers = set(numbers) & set(facts.columns)
        self._starts: dict[str | None, int] = defaultdict(int)

    def unique(self, part: Footprints) -> Footprints:
        """Return the footprints of the next tile."""
        columns = {name: part.attributes[name].astype(kind) for name, kind in self._facts.columns.items()}
        columns |= {name: self._moved(name, part.attributes[name]) for name in self._numbers}
        labels = self._moved(None, part.building_codes) if self._facts.labelled else None
        return dataclasses.replace(part, attributes=columns, building_ids=labels)

    def _moved(self, name: str | None, column: NDArray[Any]) -> NDArray[np.int64]:
        start = self._starts[name]
        self._starts[name] += int(column.max()) + 1 if len(column) else 0
        return column.astype(np.int64) + start
