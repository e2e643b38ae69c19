"""Verdicts of the threshold-free evaluation: what each object counts as, and why, in words.

Everything follows from the object graph. A table can be made of some rows at a time, since a nation has ten million of
them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..verdict_table import LazyReasons, Measure, VerdictKind, VerdictTable, rows_of_kinds
from .object_graph import OverlapGraph
from .reasons import Neighbours, Words

__all__ = ["MEASURES", "VERDICT_KINDS", "SideVerdicts", "find_verdicts"]

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

_DETECTION_KINDS = tuple(kind.key for kind in VERDICT_KINDS if kind.side == "detection")
_REFERENCE_KINDS = tuple(kind.key for kind in VERDICT_KINDS if kind.side == "reference")


@dataclass(frozen=True, eq=False)
class SideVerdicts:
    """The verdicts of one side, of which a table is made for some rows at a time.

    Attributes
    ----------
    ids : ndarray of int64, shape (n,)
        Row of each object in its source.
    kinds : tuple of str
    kind : ndarray of uint8, shape (n,)
        Place of each verdict in `kinds`.
    table : callable
        Takes a slice of rows with start and stop, and returns their `VerdictTable`.
    """

    ids: NDArray[np.int64]
    kinds: tuple[str, ...]
    kind: NDArray[np.uint8]
    table: Callable[[slice], VerdictTable]

    def __len__(self) -> int:
        return len(self.ids)

    def where(self, *keys: str) -> NDArray[np.bool_]:
        """Return which objects have one of these verdicts, shape (n,)."""
        return rows_of_kinds(self.kinds, self.kind, keys)

    def whole(self) -> VerdictTable:
        """Return the table of all rows."""
        return self.table(slice(0, len(self)))


def find_verdicts(graph: OverlapGraph, pair_outline: NDArray[np.float64]) -> tuple[SideVerdicts, SideVerdicts]:
    """Return the verdicts of the detections and of the references.

    The partner of an object without a match is the nearest one that it overlaps. ``rmse`` is given for TP only.

    Parameters
    ----------
    graph : OverlapGraph
    pair_outline : ndarray, shape (number of TP pairs,)
        Outline distance of each TP pair, by detection, m.
    """
    tables = _Tables(graph, pair_outline)
    return tables.detections(), tables.references()


class _Tables:
    """What the tables of both sides are made of; see `find_verdicts`."""

    def __init__(self, graph: OverlapGraph, pair_outline: NDArray[np.float64]) -> None:
        pairs = graph.overlaps
        self._graph, self._pair_outline = graph, pair_outline
        self._of_detection = Neighbours(pairs.first, pairs.second, graph.distances, len(graph.detected))
        self._of_reference = Neighbours(pairs.second, pairs.first, graph.distances, len(graph.reference))
        self._words = Words(graph, self._of_detection, self._of_reference)
        # Place among the TP pairs of each detection that has a match.
        self._rank = np.cumsum(graph.correspondence.of_detection >= 0, dtype=np.int32) - np.int32(1)

    def detections(self) -> SideVerdicts:
        graph = self._graph
        kind = np.full(len(graph.detected), 2, dtype=np.uint8)
        kind[self._of_detection.count(slice(None)) > 0] = 1
        kind[graph.correspondence.of_detection >= 0] = 0
        kind[~graph.detections.mask] = 3
        return SideVerdicts(graph.detected.ids, _DETECTION_KINDS, kind, partial(self._detection_table, kind))

    def references(self) -> SideVerdicts:
        graph = self._graph
        kind = np.ones(len(graph.reference), dtype=np.uint8)
        kind[graph.correspondence.of_reference >= 0] = 0
        kind[~graph.references.mask] = 2
        return SideVerdicts(graph.reference.ids, _REFERENCE_KINDS, kind, partial(self._reference_table, kind))

    def _detection_table(self, every: NDArray[np.uint8], part: slice) -> VerdictTable:
        graph, kind = self._graph, every[part]
        matched = np.flatnonzero(graph.correspondence.of_detection[part] >= 0)
        pair = self._of_detection.nearest_pairs(part)
        measures = self._measures(pair, matched, self._rank[part][matched])

        def words(rows: slice) -> NDArray[np.object_]:
            return self._words.of_detections(part.start + rows.start, kind[rows], measures["distance"][rows])

        return VerdictTable(
            ids=graph.detected.ids[part],
            kinds=_DETECTION_KINDS,
            kind=kind,
            partner=_partners(pair, graph.overlaps.second, graph.reference.ids),
            measures=measures,
            reasons=LazyReasons(len(kind), words),
        )

    def _reference_table(self, every: NDArray[np.uint8], part: slice) -> VerdictTable:
        graph, kind = self._graph, every[part]
        detections = graph.correspondence.of_reference[part]
        matched = np.flatnonzero(detections >= 0)
        pair = self._of_reference.nearest_pairs(part)
        measures = self._measures(pair, matched, self._rank[detections[matched]])

        def words(rows: slice) -> NDArray[np.object_]:
            columns = measures["distance"][rows], measures["overlap_area"][rows]
            return self._words.of_references(part.start + rows.start, kind[rows], *columns)

        return VerdictTable(
            ids=graph.reference.ids[part],
            kinds=_REFERENCE_KINDS,
            kind=kind,
            partner=_partners(pair, graph.overlaps.first, graph.detected.ids),
            measures=measures,
            reasons=LazyReasons(len(kind), words),
        )

    def _measures(
        self, pair: NDArray[np.int64], matched: NDArray[np.int64], rank: NDArray[np.int32]
    ) -> dict[str, NDArray[np.float64]]:
        """Put the pairs of matched objects into `pair`, and return the measures of each object's pair.

        Parameters
        ----------
        pair : ndarray of int64, shape (n,)
            Place of each object's nearest pair in the overlaps, or -1.
        matched : ndarray of int64
            Objects with a match.
        rank : ndarray of int32
            Place of these among the TP pairs.
        """
        graph = self._graph
        pair[matched] = graph.matched_overlaps[rank]
        some = np.flatnonzero(pair >= 0)
        chosen = pair[some]
        return {
            "distance": _spread(graph.distances[chosen], some, len(pair)),
            "overlap_area": _spread(graph.overlaps.area[chosen], some, len(pair)),
            "iou": _spread(graph.iou(chosen), some, len(pair)),
            "rmse": _spread(self._pair_outline[rank], matched, len(pair)),
        }


def _partners(pair: NDArray[np.int64], rows: NDArray[np.int64], ids: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the id of the other object of each pair, -1 where there is none."""
    partners = np.full(len(pair), -1, dtype=np.int64)
    some = pair >= 0
    partners[some] = ids[rows[pair[some]]]
    return partners


def _spread(values: NDArray[np.float64], rows: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """Return `values` at `rows` of a column of `count` rows, NaN elsewhere."""
    column = np.full(count, np.nan)
    column[rows] = values
    return column
