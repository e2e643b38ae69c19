"""Reasons of the threshold-free verdicts in words, which follow from the object graph.

They are written only when they are asked for, since a city has a million of them.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from .correspondence import DECIMALS, Correspondence
from .object_graph import OverlapGraph

__all__ = ["Neighbours", "Words"]

_Texts: TypeAlias = NDArray[np.object_]


class Neighbours:
    """For each object of one side, the objects of the other side that it overlaps, nearest first.

    Parameters
    ----------
    own, other : ndarray of int64, shape (pairs,)
        Rows of the two sides of each overlapping pair.
    distances : ndarray, shape (pairs,)
        Centre distances, m.
    count : int
        Number of objects of the own side.
    """

    def __init__(
        self, own: NDArray[np.int64], other: NDArray[np.int64], distances: NDArray[np.float64], count: int
    ) -> None:
        # Half the memory: a nation has ten million objects and more pairs, but never 2^31.
        self._start = np.zeros(count + 1, dtype=np.int32)
        np.cumsum(np.bincount(own, minlength=count), out=self._start[1:])
        self._pair = np.argsort(own, kind="stable").astype(np.int32)
        self._other = other
        # Only objects with several neighbours need an order among them.
        numbers = self.count(slice(None))
        several = np.flatnonzero(np.repeat(numbers > 1, numbers))
        pair = self._pair[several]
        order = np.lexsort((other[pair], np.round(distances[pair], DECIMALS), own[pair]))
        self._pair[several] = pair[order]

    def count(self, rows: slice | NDArray[np.int64]) -> NDArray[np.int32]:
        """Return the number of neighbours of some objects."""
        count: NDArray[np.int32] = self._start[1:][rows] - self._start[:-1][rows]
        return count

    def nearest(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the nearest neighbour of objects that have one."""
        return self._other[self._pair[self._start[rows]]]

    def nearest_pairs(self, part: slice) -> NDArray[np.int64]:
        """Return the place of the nearest pair of the objects of some rows, or -1."""
        pairs = np.full(part.stop - part.start, -1, dtype=np.int64)
        some = self.count(part) > 0
        pairs[some] = self._pair[self._start[part][some]]
        return pairs

    def of(self, rows: NDArray[np.int64]) -> list[list[int]]:
        """Return all neighbours of some objects."""
        begins, counts = self._start[rows], self.count(rows)
        ends = np.cumsum(counts)
        places = np.arange(counts.sum()) + np.repeat(begins - ends + counts, counts)
        flat = self._other[self._pair[places]].tolist()
        return [flat[end - count : end] for end, count in zip(ends.tolist(), counts.tolist(), strict=True)]


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
        multiple = graph.detections.mask & (match.of_detection < 0) & (match.assigned_to >= 0)
        found = (match.of_reference >= 0).astype(np.int32)

        def counted_on(kind: NDArray[np.bool_]) -> NDArray[np.int32]:
            return np.bincount(match.assigned_to[multiple & kind], minlength=len(found)).astype(np.int32)

        return cls(found + counted_on(~graph.duplicates), found + counted_on(graph.duplicates), match)

    def home(self, detections: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the reference that each of some detections is matched with or assigned to, or -1."""
        partner = self.match.of_detection[detections]
        return np.where(partner >= 0, partner, self.match.assigned_to[detections])


class Words:
    """Reasons in words, for a stretch of rows at a time.

    Parameters
    ----------
    graph : OverlapGraph
    of_detection, of_reference : Neighbours
        Of the detections, and of the references.
    """

    def __init__(self, graph: OverlapGraph, of_detection: Neighbours, of_reference: Neighbours) -> None:
        self._graph = graph
        self._of_detection, self._of_reference = of_detection, of_reference
        self._claims = _Claims.of(graph)

    def of_detections(self, start: int, kind: NDArray[np.uint8], distance: NDArray[np.float64]) -> _Texts:
        """Return the reasons of the detections of some rows.

        Parameters
        ----------
        start : int
            First of the rows.
        kind : ndarray of uint8, shape (n,)
            Verdict of each: 0 TP, 1 MD, 2 FP, 3 left out.
        distance : ndarray, shape (n,)
            Centre distance of the partner, m.
        """
        claims, graph, part = self._claims, self._graph, slice(start, start + len(kind))
        texts = np.full(len(kind), "false alarm: overlaps no reference", dtype=object)
        texts[kind == 3] = graph.detections.reasons_of(part)[kind == 3]

        found = np.flatnonzero(kind == 0)
        own = claims.home(start + found)
        columns = (graph.reference.ids[own], distance[found], claims.pieces[own], claims.times[own])
        texts[found] = [
            f"found reference {name}, shifted {moved:.1f} m"
            + (_claimed(pieces, times, "the reference is ") if pieces > 1 or times > 1 else "")
            for name, moved, pieces, times in zip(*(column.tolist() for column in columns), strict=True)
        ]

        multiple = np.flatnonzero(kind == 1)
        own = claims.home(start + multiple)
        holder = graph.detected.ids[graph.correspondence.of_reference[own]]
        multiples = (graph.reference.ids[own], holder, claims.pieces[own], graph.duplicates[start + multiple])
        texts[multiple] = [
            f"duplicate of detection {first} on reference {name}"
            if duplicate
            else f"piece of reference {name}, which is split into {pieces} detections and represented by "
            f"detection {first}"
            for name, first, pieces, duplicate in zip(*(column.tolist() for column in multiples), strict=True)
        ]

        wide = np.flatnonzero((kind < 2) & (self._of_detection.count(part) > 1))
        covered = self._of_detection.of(start + wide)
        for place, own_row, neighbours in zip(wide.tolist(), claims.home(start + wide).tolist(), covered, strict=True):
            others = _names(graph.reference.ids[[other for other in neighbours if other != own_row]].tolist())
            texts[place] += f"; also covers part of reference {others}"
        return texts

    def of_references(
        self,
        start: int,
        kind: NDArray[np.uint8],
        distance: NDArray[np.float64],
        overlap_area: NDArray[np.float64],
    ) -> _Texts:
        """Return the reasons of the references of some rows.

        Parameters
        ----------
        start : int
            First of the rows.
        kind : ndarray of uint8, shape (n,)
            Verdict of each: 0 TP, 1 FN, 2 left out.
        distance, overlap_area : ndarray, shape (n,)
            Centre distance of the partner, m, and area shared with it, m2.
        """
        graph, part = self._graph, slice(start, start + len(kind))
        texts = np.full(len(kind), "missed: no detection overlaps it", dtype=object)
        texts[kind == 2] = graph.references.reasons_of(part)[kind == 2]
        found = np.flatnonzero(kind == 0)
        texts[found] = self._found(start + found, distance[found])
        missed = np.flatnonzero((kind == 1) & (self._of_reference.count(part) > 0))
        covered = overlap_area[missed] / graph.reference.areas[start + missed]
        texts[missed] = self._missed(start + missed, covered)
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
        wide = np.flatnonzero(self._of_detection.count(own) > 1)
        for place, row, neighbours in zip(
            wide.tolist(), rows[wide].tolist(), self._of_detection.of(own[wide]), strict=True
        ):
            others = _names(graph.reference.ids[[other for other in neighbours if other != row]].tolist())
            texts[place] += f"; the detection also covers part of reference {others}"
        shared = np.flatnonzero(self._of_reference.count(rows) > claims.pieces[rows] + claims.times[rows] - 1)
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
            else f"missed: detection {name} overlaps it ({_share(share)}) but is assigned to reference {other}"
            for name, other, has, share in zip(*(column.tolist() for column in columns), strict=True)
        ]
