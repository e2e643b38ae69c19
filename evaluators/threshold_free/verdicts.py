"""Verdicts of the threshold-free evaluation: what each object counts as, and why, in words.

Everything follows from the object graph. The words are written only when they are asked for, since a city has a million
of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from ..verdict_table import Measure, VerdictKind, Verdicts, VerdictTable
from .correspondence import DECIMALS
from .object_graph import ObjectGraph

__all__ = ["MEASURES", "VERDICT_KINDS", "find_verdicts"]

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


class _Neighbours:
    """For each object of one side, the objects of the other side that it overlaps, nearest first."""

    def __init__(
        self, own: NDArray[np.int64], other: NDArray[np.int64], distances: NDArray[np.float64], count: int
    ) -> None:
        order = np.lexsort((other, np.round(distances, DECIMALS), own))
        self._pair = order
        self._other = other[order]
        self._start = np.searchsorted(own[order], np.arange(count + 1))
        self.count = np.diff(self._start)

    def of(self, row: int) -> list[int]:
        found: list[int] = self._other[self._start[row] : self._start[row + 1]].tolist()
        return found

    def nearest_pair(self) -> NDArray[np.int64]:
        """Return for each object the position of its nearest pair in the overlaps, or -1."""
        pair = np.full(len(self.count), -1, dtype=np.int64)
        some = self.count > 0
        pair[some] = self._pair[self._start[:-1][some]]
        return pair


def find_verdicts(graph: ObjectGraph, pair_outline: NDArray[np.float64]) -> Verdicts:
    """Write one row per detection and one per reference.

    The partner of an object without a match is the nearest one that it overlaps. ``rmse`` is given for TP only.

    Parameters
    ----------
    graph : ObjectGraph
    pair_outline : ndarray, shape (number of TP pairs,)
        Outline distance of each TP pair, by detection, m.
    """
    pairs, match = graph.overlaps, graph.correspondence
    of_detection = _Neighbours(pairs.first, pairs.second, graph.distances, len(graph.detected))
    of_reference = _Neighbours(pairs.second, pairs.first, graph.distances, len(graph.reference))
    words = _Words(graph, of_detection, of_reference, _Claims.of(graph))
    detections, references = match.pairs
    pair_of_match = np.full(len(graph.detected), -1, dtype=np.int64)
    pair_of_match[detections] = graph.matched_overlaps

    matched = match.of_detection >= 0
    kind = np.where(matched, 0, np.where(of_detection.count > 0, 1, 2)).astype(np.uint8)
    kind[~graph.detections.mask] = 3
    position = np.where(matched, pair_of_match, of_detection.nearest_pair())
    partner, measures = _measured(graph, position, graph.detected, graph.reference.ids, pairs.second)
    measures["rmse"] = _spread(pair_outline, detections, len(graph.detected))
    detection_table = VerdictTable(
        ids=graph.detected.ids,
        kinds=_DETECTION_KINDS,
        kind=kind,
        partner=partner,
        measures=measures,
        reasons=tuple(words.of_detections(kind, measures["distance"])),
    )

    matched = match.of_reference >= 0
    kind = np.where(matched, 0, 1).astype(np.uint8)
    kind[~graph.references.mask] = 2
    own_pair = np.full(len(graph.reference), -1, dtype=np.int64)
    own_pair[references] = graph.matched_overlaps
    position = np.where(matched, own_pair, of_reference.nearest_pair())
    partner, measures = _measured(graph, position, graph.reference, graph.detected.ids, pairs.first)
    measures["rmse"] = _spread(pair_outline, references, len(graph.reference))
    reference_table = VerdictTable(
        ids=graph.reference.ids,
        kinds=_REFERENCE_KINDS,
        kind=kind,
        partner=partner,
        measures=measures,
        reasons=tuple(words.of_references(kind, measures)),
    )
    return Verdicts(
        kinds=VERDICT_KINDS,
        measures=MEASURES,
        detection_table=detection_table,
        reference_table=reference_table,
        detected=graph.detected,
        reference=graph.reference,
    )


def _spread(values: NDArray[np.float64], rows: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """Return `values` at `rows` of a column of `count` rows, NaN elsewhere."""
    column = np.full(count, np.nan)
    column[rows] = values
    return column


def _measured(
    graph: ObjectGraph,
    position: NDArray[np.int64],
    own: Footprints,
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


def _names(footprints: Footprints, rows: list[int]) -> str:
    """Return the ids of some footprints in words: ``12``, ``12 and 13``, ``12, 13 and 4 more``."""
    ids = [str(identity) for identity in footprints.ids[rows[:3]].tolist()]
    more = len(rows) - len(ids)
    if more:
        return f"{', '.join(ids)} and {more} more"
    return " and ".join([", ".join(ids[:-1]), ids[-1]] if len(ids) > 1 else ids)


def _share(part: float) -> str:
    return f"{100 * part:.0f} %" if part >= 0.01 else "less than 1 %"


@dataclass(frozen=True, eq=False)
class _Claims:
    """How often each reference is detected.

    Attributes
    ----------
    pieces : list of int
        Detections that are matched with a reference or are pieces of it: more than one where it is split.
    times : list of int
        Detections that are matched with it or duplicate that one: more than one where it is detected again.
    home : list of int
        For each detection the reference that it is matched with or booked on, or -1.
    """

    pieces: list[int]
    times: list[int]
    home: list[int]

    @classmethod
    def of(cls, graph: ObjectGraph) -> _Claims:
        match = graph.correspondence
        multiple = graph.detections.mask & (match.of_detection < 0) & (match.booked_on >= 0)
        found = (match.of_reference >= 0).astype(np.int64)

        def booked(kind: NDArray[np.bool_]) -> list[int]:
            numbers: list[int] = np.bincount(match.booked_on[multiple & kind], minlength=len(found)).tolist()
            return numbers

        home = np.where(match.of_detection >= 0, match.of_detection, match.booked_on)
        return cls(
            [own + more for own, more in zip(found.tolist(), booked(~graph.duplicates), strict=True)],
            [own + more for own, more in zip(found.tolist(), booked(graph.duplicates), strict=True)],
            home.tolist(),
        )

    def in_words(self, reference: int, subject: str = "") -> str:
        text = f"; {subject}split into {self.pieces[reference]} detections" if self.pieces[reference] > 1 else ""
        return text + (f"; {subject}detected {self.times[reference]} times" if self.times[reference] > 1 else "")


class _Words:
    """Reasons in words."""

    def __init__(
        self, graph: ObjectGraph, of_detection: _Neighbours, of_reference: _Neighbours, claims: _Claims
    ) -> None:
        self._graph = graph
        self._of_detection, self._of_reference = of_detection, of_reference
        self._claims = claims
        self._detection_ids, self._reference_ids = graph.detected.ids.tolist(), graph.reference.ids.tolist()

    def of_detections(self, kind: NDArray[np.uint8], distance: NDArray[np.float64]) -> list[str]:
        claims, graph = self._claims, self._graph
        touched, duplicates = self._of_detection.count.tolist(), graph.duplicates.tolist()
        holder, left_out = graph.correspondence.of_reference.tolist(), graph.detections.reasons
        reasons = []
        for row, (place, moved) in enumerate(zip(kind.tolist(), distance.tolist(), strict=True)):
            verdict = _DETECTION_KINDS[place]
            if verdict == "FP":
                reasons.append("false alarm: overlaps no reference")
                continue
            if verdict == "left out":
                reasons.append(str(left_out[row]))
                continue
            own = claims.home[row]
            name = self._reference_ids[own]
            if verdict == "TP":
                text = f"found reference {name}, shifted {moved:.1f} m"
                text += claims.in_words(own, "the reference is ")
            elif duplicates[row]:
                text = f"duplicate of detection {self._detection_ids[holder[own]]} on reference {name}"
            else:
                text = (
                    f"piece of reference {name}, which is split into {claims.pieces[own]} detections and "
                    f"represented by detection {self._detection_ids[holder[own]]}"
                )
            if touched[row] > 1:
                others = [other for other in self._of_detection.of(row) if other != own]
                text += f"; also covers part of reference {_names(graph.reference, others)}"
            reasons.append(text)
        return reasons

    def of_references(self, kind: NDArray[np.uint8], measures: dict[str, NDArray[np.float64]]) -> list[str]:
        graph = self._graph
        overlapping, left_out = self._of_reference.count.tolist(), graph.references.reasons
        covered = (measures["overlap_area"] / graph.reference.areas).tolist()
        distance = measures["distance"].tolist()
        reasons = []
        for row, place in enumerate(kind.tolist()):
            verdict = _REFERENCE_KINDS[place]
            if verdict == "left out":
                reasons.append(str(left_out[row]))
            elif verdict == "TP":
                reasons.append(self._found(row, distance[row], overlapping[row]))
            elif overlapping[row] == 0:
                reasons.append("missed: no detection overlaps it")
            else:
                reasons.append(self._missed(row, covered[row]))
        return reasons

    def _found(self, row: int, moved: float, overlapping: int) -> str:
        claims, graph = self._claims, self._graph
        own = int(graph.correspondence.of_reference[row])
        text = f"found by detection {self._detection_ids[own]}, shifted {moved:.1f} m" + claims.in_words(row)
        if self._of_detection.count[own] > 1:
            others = [other for other in self._of_detection.of(own) if other != row]
            text += f"; the detection also covers part of reference {_names(graph.reference, others)}"
        if overlapping > claims.pieces[row] + claims.times[row] - 1:
            others = [other for other in self._of_reference.of(row) if claims.home[other] != row]
            names = _names(graph.detected, others)
            text += (
                f"; detection {names} of another reference covers part of it"
                if len(others) == 1
                else f"; detections {names} of other references cover parts of it"
            )
        return text

    def _missed(self, row: int, covered: float) -> str:
        nearest = self._of_reference.of(row)[0]
        name, share = self._detection_ids[nearest], _share(covered)
        matched = int(self._graph.correspondence.of_detection[nearest])
        if matched >= 0:
            other = self._reference_ids[matched]
            return f"merged with reference {other} into detection {name}, which covers {share} of it"
        # Only where a detection has a single choice (one-pass matching).
        other = self._reference_ids[self._claims.home[nearest]]
        return f"missed: detection {name} overlaps it ({share}) but is booked on reference {other}"
