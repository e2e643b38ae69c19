"""Verdicts of the threshold-free evaluation: what each object counts as, and why, in words.

Everything follows from the object graph. The words are written only when they are asked for, since a city has a million
of them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..overlay.left_out import Objects
from ..verdict_table import LazyReasons, Measure, VerdictKind, VerdictTable
from .correspondence import DECIMALS, Correspondence
from .object_graph import OverlapGraph

__all__ = ["MEASURES", "VERDICT_KINDS", "find_verdicts", "verdict_tables"]

VERDICT_KINDS = (
    VerdictKind(key="TP", label="detected building", side="detection", role="correct", counts_as="correct"),
    VerdictKind(key="MD", label="multiple detection", side="detection", role="partial", counts_as="duplicate"),
    VerdictKind(key="FP", label="false alarm", side="detection", role="excess", counts_as="wrong"),
    VerdictKind(key="left out", label="left out", side="detection", role="left out", counts_as="neutral"),
    VerdictKind(key="TP", label="reference of a TP", side="reference", role="outline", counts_as="correct"),
    VerdictKind(key="FN", label="missed reference", side="reference", role="missing", counts_as="wrong"),
    VerdictKind(key="left out", label="left out", side="reference", role="left out", counts_as="neutral"),
)

MEASURES = (
    Measure(key="distance", title="centre distance", unit="m"),
    Measure(key="overlap_area", title="shared area", unit="m2"),
    Measure(key="iou", title="IoU", unit="fraction"),
    Measure(key="rmse", title="corner distance", unit="m"),
)

_Texts: TypeAlias = NDArray[np.object_]

_DETECTION_KINDS = tuple(kind.key for kind in VERDICT_KINDS if kind.side == "detection")
_REFERENCE_KINDS = tuple(kind.key for kind in VERDICT_KINDS if kind.side == "reference")


class _Neighbours:
    """For each object of one side, the objects of the other side that it overlaps, nearest first."""

    def __init__(
        self, own: NDArray[np.int64], other: NDArray[np.int64], distances: NDArray[np.float64], count: int
    ) -> None:
        # Half the memory: a nation has ten million objects and more pairs, but never 2^31.
        self.count = np.bincount(own, minlength=count).astype(np.int32)
        self._start = np.zeros(count + 1, dtype=np.int32)
        np.cumsum(self.count, out=self._start[1:])
        self._pair = np.argsort(own, kind="stable").astype(np.int32)
        # Only objects with several neighbours need an order among them.
        several = np.flatnonzero(self.count[own[self._pair]] > 1)
        pair = self._pair[several]
        order = np.lexsort((other[pair], np.round(distances[pair], DECIMALS), own[pair]))
        self._pair[several] = pair[order]
        self._other = other[self._pair].astype(np.int32)

    def nearest(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the nearest neighbour of objects that have one."""
        return self._other[self._start[rows]].astype(np.int64)

    def of(self, rows: NDArray[np.int64]) -> list[list[int]]:
        """Return all neighbours of some objects."""
        begins, counts = self._start[rows], self.count[rows]
        ends = np.cumsum(counts)
        flat = self._other[np.arange(counts.sum()) + np.repeat(begins - ends + counts, counts)].tolist()
        return [flat[end - count : end] for end, count in zip(ends.tolist(), counts.tolist(), strict=True)]

    def nearest_pair(self) -> NDArray[np.int64]:
        """Return for each object the position of its nearest pair in the overlaps, or -1."""
        pair = np.full(len(self.count), -1, dtype=np.int64)
        some = self.count > 0
        pair[some] = self._pair[self._start[:-1][some]]
        return pair


def find_verdicts(graph: OverlapGraph, pair_outline: NDArray[np.float64]) -> tuple[VerdictTable, VerdictTable]:
    """Write one row per detection and one per reference; see `verdict_tables`."""
    detections, references = verdict_tables(graph, pair_outline)
    return detections, references


def verdict_tables(graph: OverlapGraph, pair_outline: NDArray[np.float64]) -> Iterator[VerdictTable]:
    """Yield the table of the detections, then that of the references, so that one at a time may be in memory.

    The partner of an object without a match is the nearest one that it overlaps. ``rmse`` is given for TP only.

    Parameters
    ----------
    graph : OverlapGraph
    pair_outline : ndarray, shape (number of TP pairs,)
        Outline distance of each TP pair, by detection, m.
    """
    pairs = graph.overlaps
    of_detection = _Neighbours(pairs.first, pairs.second, graph.distances, len(graph.detected))
    of_reference = _Neighbours(pairs.second, pairs.first, graph.distances, len(graph.reference))
    words = _Words(graph, of_detection, of_reference, _Claims.of(graph))
    yield _detection_table(graph, pair_outline, of_detection, words)
    yield _reference_table(graph, pair_outline, of_reference, words)


def _detection_table(
    graph: OverlapGraph, pair_outline: NDArray[np.float64], neighbours: _Neighbours, words: _Words
) -> VerdictTable:
    match = graph.correspondence
    matched = match.of_detection >= 0
    kind = np.where(matched, 0, np.where(neighbours.count > 0, 1, 2)).astype(np.uint8)
    kind[~graph.detections.mask] = 3
    position = neighbours.nearest_pair()
    rows = match.pairs[0]
    position[rows] = graph.matched_overlaps
    partner, measures = _measured(graph, position, graph.detected, graph.reference.ids, graph.overlaps.second)
    measures["rmse"] = _spread(pair_outline, rows, len(graph.detected))
    return VerdictTable(
        ids=graph.detected.ids,
        kinds=_DETECTION_KINDS,
        kind=kind,
        partner=partner,
        measures=measures,
        reasons=LazyReasons(len(kind), partial(words.of_detections, kind, measures)),
    )


def _reference_table(
    graph: OverlapGraph, pair_outline: NDArray[np.float64], neighbours: _Neighbours, words: _Words
) -> VerdictTable:
    match = graph.correspondence
    kind = np.where(match.of_reference >= 0, 0, 1).astype(np.uint8)
    kind[~graph.references.mask] = 2
    position = neighbours.nearest_pair()
    rows = match.pairs[1]
    position[rows] = graph.matched_overlaps
    partner, measures = _measured(graph, position, graph.reference, graph.detected.ids, graph.overlaps.first)
    measures["rmse"] = _spread(pair_outline, rows, len(graph.reference))
    return VerdictTable(
        ids=graph.reference.ids,
        kinds=_REFERENCE_KINDS,
        kind=kind,
        partner=partner,
        measures=measures,
        reasons=LazyReasons(len(kind), partial(words.of_references, kind, measures)),
    )


def _spread(values: NDArray[np.float64], rows: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """Return `values` at `rows` of a column of `count` rows, NaN elsewhere."""
    column = np.full(count, np.nan)
    column[rows] = values
    return column


def _measured(
    graph: OverlapGraph,
    position: NDArray[np.int64],
    own: Objects,
    other_ids: NDArray[np.int64],
    other_rows: NDArray[np.int64],
) -> tuple[NDArray[np.int64], dict[str, NDArray[np.float64]]]:
    """Return the id of each object's partner, and the measures of the overlap at `position` (-1: none)."""
    has = np.flatnonzero(position >= 0)
    pair = position[has]
    partner = np.full(len(own), -1, dtype=np.int64)
    partner[has] = other_ids[other_rows[pair]]
    return partner, {
        "distance": _spread(graph.distances[pair], has, len(own)),
        "overlap_area": _spread(graph.overlaps.area[pair], has, len(own)),
        "iou": _spread(graph.iou(pair), has, len(own)),
    }


def _names(ids: list[int]) -> str:
    """Return some ids in words: ``12``, ``12 and 13``, ``12, 13, 14 and 4 more``."""
    if len(ids) == 1:
        return str(ids[0])
    if len(ids) > 3:
        return f"{', '.join(map(str, ids[:3]))} and {len(ids) - 3} more"
    return f"{', '.join(map(str, ids[:-1]))} and {ids[-1]}"


def _share(part: float) -> str:
    return f"{100 * part:.0f} %" if part >= 0.01 else "less than 1 %"


def _claimed(pieces: int, times: int, subject: str = "") -> str:
    text = f"; {subject}split into {pieces} detections" if pieces > 1 else ""
    return text + (f"; {subject}detected {times} times" if times > 1 else "")


@dataclass(frozen=True, eq=False)
class _Claims:
    """How often each reference is detected.

    Attributes
    ----------
    pieces : ndarray of int32
        Detections that are matched with a reference or are pieces of it: more than one where it is split.
    times : ndarray of int32
        Detections that are matched with it or duplicate that one: more than one where it is detected again.
    match : Correspondence
    """

    pieces: NDArray[np.int32]
    times: NDArray[np.int32]
    match: Correspondence

    @classmethod
    def of(cls, graph: OverlapGraph) -> _Claims:
        match = graph.correspondence
        multiple = graph.detections.mask & (match.of_detection < 0) & (match.booked_on >= 0)
        found = (match.of_reference >= 0).astype(np.int32)

        def booked(kind: NDArray[np.bool_]) -> NDArray[np.int32]:
            return np.bincount(match.booked_on[multiple & kind], minlength=len(found)).astype(np.int32)

        return cls(found + booked(~graph.duplicates), found + booked(graph.duplicates), match)

    def home(self, detections: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the reference that each of some detections is matched with or booked on, or -1."""
        partner = self.match.of_detection[detections]
        return np.where(partner >= 0, partner, self.match.booked_on[detections])


class _Words:
    """Reasons in words, for a stretch of rows at a time."""

    def __init__(
        self, graph: OverlapGraph, of_detection: _Neighbours, of_reference: _Neighbours, claims: _Claims
    ) -> None:
        self._graph = graph
        self._of_detection, self._of_reference = of_detection, of_reference
        self._claims = claims

    def of_detections(
        self, kind: NDArray[np.uint8], measures: Mapping[str, NDArray[np.float64]], part: slice
    ) -> _Texts:
        claims, graph = self._claims, self._graph
        texts = np.full(part.stop - part.start, "false alarm: overlaps no reference", dtype=object)
        verdict = kind[part]
        texts[verdict == 3] = graph.detections.reasons_of(part)[verdict == 3]

        found = part.start + np.flatnonzero(verdict == 0)
        own = claims.home(found)
        columns = (graph.reference.ids[own], measures["distance"][found], claims.pieces[own], claims.times[own])
        texts[found - part.start] = [
            f"found reference {name}, shifted {moved:.1f} m"
            + (_claimed(pieces, times, "the reference is ") if pieces > 1 or times > 1 else "")
            for name, moved, pieces, times in zip(*(column.tolist() for column in columns), strict=True)
        ]

        multiple = part.start + np.flatnonzero(verdict == 1)
        own = claims.home(multiple)
        holder = graph.detected.ids[graph.correspondence.of_reference[own]]
        columns = (graph.reference.ids[own], holder, claims.pieces[own], graph.duplicates[multiple])
        texts[multiple - part.start] = [
            f"duplicate of detection {first} on reference {name}"
            if duplicate
            else f"piece of reference {name}, which is split into {pieces} detections and represented by "
            f"detection {first}"
            for name, first, pieces, duplicate in zip(*(column.tolist() for column in columns), strict=True)
        ]

        wide = part.start + np.flatnonzero((verdict < 2) & (self._of_detection.count[part] > 1))
        for row, own_row, neighbours in zip(
            wide.tolist(), claims.home(wide).tolist(), self._of_detection.of(wide), strict=True
        ):
            others = _names(graph.reference.ids[[other for other in neighbours if other != own_row]].tolist())
            texts[row - part.start] += f"; also covers part of reference {others}"
        return texts

    def of_references(
        self, kind: NDArray[np.uint8], measures: Mapping[str, NDArray[np.float64]], part: slice
    ) -> _Texts:
        graph, overlapping = self._graph, self._of_reference.count
        texts = np.full(part.stop - part.start, "missed: no detection overlaps it", dtype=object)
        verdict = kind[part]
        texts[verdict == 2] = graph.references.reasons_of(part)[verdict == 2]
        found = part.start + np.flatnonzero(verdict == 0)
        texts[found - part.start] = self._found(found, measures["distance"][found])
        missed = part.start + np.flatnonzero((verdict == 1) & (overlapping[part] > 0))
        covered = measures["overlap_area"][missed] / graph.reference.areas[missed]
        texts[missed - part.start] = self._missed(missed, covered)
        return texts

    def _found(self, rows: NDArray[np.int64], moved: NDArray[np.float64]) -> list[str]:
        claims, graph = self._claims, self._graph
        own = graph.correspondence.of_reference[rows]
        columns = (graph.detected.ids[own], moved, claims.pieces[rows], claims.times[rows])
        texts = [
            f"found by detection {name}, shifted {distance:.1f} m"
            + (_claimed(pieces, times) if pieces > 1 or times > 1 else "")
            for name, distance, pieces, times in zip(*(column.tolist() for column in columns), strict=True)
        ]
        wide = np.flatnonzero(self._of_detection.count[own] > 1)
        for place, row, neighbours in zip(
            wide.tolist(), rows[wide].tolist(), self._of_detection.of(own[wide]), strict=True
        ):
            others = _names(graph.reference.ids[[other for other in neighbours if other != row]].tolist())
            texts[place] += f"; the detection also covers part of reference {others}"
        shared = np.flatnonzero(self._of_reference.count[rows] > claims.pieces[rows] + claims.times[rows] - 1)
        covering = self._of_reference.of(rows[shared])
        homes = iter(claims.home(np.fromiter(itertools.chain(*covering), dtype=np.int64)).tolist())
        for place, row, neighbours in zip(shared.tolist(), rows[shared].tolist(), covering, strict=True):
            strangers = [other for other in neighbours if next(homes) != row]
            names = _names(graph.detected.ids[strangers].tolist())
            texts[place] += (
                f"; detection {names} of another reference covers part of it"
                if len(strangers) == 1
                else f"; detections {names} of other references cover parts of it"
            )
        return texts

    def _missed(self, rows: NDArray[np.int64], covered: NDArray[np.float64]) -> list[str]:
        graph = self._graph
        nearest = self._of_reference.nearest(rows)
        matched = graph.correspondence.of_detection[nearest] >= 0
        # Without a match only where a detection has a single choice (one-pass matching).
        home = graph.reference.ids[self._claims.home(nearest)]
        columns = (graph.detected.ids[nearest], home, matched, covered)
        return [
            f"merged with reference {other} into detection {name}, which covers {_share(share)} of it"
            if has
            else f"missed: detection {name} overlaps it ({_share(share)}) but is booked on reference {other}"
            for name, other, has, share in zip(*(column.tolist() for column in columns), strict=True)
        ]
