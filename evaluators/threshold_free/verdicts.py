"""Verdicts: for every object what it counts as, and why, in words.

Everything follows from the overlap graph and the correspondence. Codes are kept as arrays; the words are written only
when somebody asks, since a city has a million of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from ..base import Verdicts
from ..overlay.overlaps import Overlaps
from .correspondence import DECIMALS, Correspondence

__all__ = ["ObjectGraph", "verdict_tables"]


@dataclass(frozen=True, eq=False)
class ObjectGraph:
    """All that an evaluation knows of the single objects.

    Attributes
    ----------
    detected, reference : Footprints
    overlaps : Overlaps
        Overlapping (detection, reference) pairs.
    distances : ndarray, shape (len(overlaps),)
        Centre distance of each overlapping pair, m.
    correspondence : Correspondence
    counted_detections, counted_references : ndarray of bool
        False where an object is left out (outside the evaluation area, or smaller than the minimum size).
    left_out_reason : tuple of two arrays of str
        Why, for detections and references; empty where counted.
    pair_outline : ndarray, shape (number of TP pairs,)
        Outline distance of each TP pair, by detection, m.
    duplicates : ndarray of bool
        The multiple detections that overlap the detection which stands for their reference; the others are pieces.
    """

    detected: Footprints
    reference: Footprints
    overlaps: Overlaps
    distances: NDArray[np.float64]
    correspondence: Correspondence
    counted_detections: NDArray[np.bool_]
    counted_references: NDArray[np.bool_]
    left_out_reason: tuple[NDArray[np.object_], NDArray[np.object_]]
    pair_outline: NDArray[np.float64]
    duplicates: NDArray[np.bool_]


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


def verdict_tables(graph: ObjectGraph) -> Verdicts:
    """Write one row per detection and one per reference.

    Columns: ``id`` (row in the source), ``verdict`` (TP, MD, FP / TP, FN, or ``left out``), ``partner`` (id on the
    other side: the matched one, else the nearest overlapped; <NA> without), ``distance`` (m between centres),
    ``overlap_area`` (m2), ``iou``, ``rmse`` (m, TP only), ``reason``, ``geometry``.
    """
    pairs, match = graph.overlaps, graph.correspondence
    of_detection = _Neighbours(pairs.first, pairs.second, graph.distances, len(graph.detected))
    of_reference = _Neighbours(pairs.second, pairs.first, graph.distances, len(graph.reference))
    pair_of_match = _matched_positions(pairs, match)
    claims = _Claims.of(graph)
    detections, references = match.pairs
    rmse = np.full(len(graph.detected), np.nan)
    rmse[detections] = graph.pair_outline
    rmse_reference = np.full(len(graph.reference), np.nan)
    rmse_reference[references] = graph.pair_outline

    matched = match.of_detection >= 0
    position = np.where(matched, pair_of_match, of_detection.nearest_pair())
    verdict = np.where(matched, "TP", np.where(of_detection.count > 0, "MD", "FP")).astype(object)
    verdict[~graph.counted_detections] = "left out"
    table_d = _table(graph.detected, verdict, position, pairs.second, graph.reference, graph, rmse)
    table_d["reason"] = _detection_reasons(graph, verdict, of_detection, claims, table_d["distance"])

    matched = match.of_reference >= 0
    own_pair = np.full(len(graph.reference), -1, dtype=np.int64)
    own_pair[references] = pair_of_match[detections]
    position = np.where(matched, own_pair, of_reference.nearest_pair())
    verdict = np.where(matched, "TP", "FN").astype(object)
    verdict[~graph.counted_references] = "left out"
    table_r = _table(graph.reference, verdict, position, pairs.first, graph.detected, graph, rmse_reference)
    table_r["reason"] = _reference_reasons(graph, table_r, of_detection, of_reference, claims)
    for table, footprints in ((table_d, graph.detected), (table_r, graph.reference)):
        table["geometry"] = footprints.polygons
    return Verdicts(table_d, table_r)


def _matched_positions(pairs: Overlaps, match: Correspondence) -> NDArray[np.int64]:
    """Return for each detection the position of its matched pair in the overlaps, or -1."""
    positions = np.full(len(match.of_detection), -1, dtype=np.int64)
    is_match = match.of_detection[pairs.first] == pairs.second
    positions[pairs.first[is_match]] = np.flatnonzero(is_match)
    return positions


def _table(
    footprints: Footprints,
    verdict: NDArray[np.object_],
    position: NDArray[np.int64],
    other_rows: NDArray[np.int64],
    others: Footprints,
    graph: ObjectGraph,
    rmse: NDArray[np.float64],
) -> dict[str, Any]:
    has = position >= 0
    pair = position[has]
    partner = np.zeros(len(footprints), dtype=np.int64)
    partner[has] = others.ids[other_rows[pair]]
    numbers = {name: np.full(len(footprints), np.nan) for name in ("distance", "overlap_area", "iou")}
    numbers["distance"][has] = graph.distances[pair]
    shared = graph.overlaps.area[pair]
    numbers["overlap_area"][has] = shared
    united = footprints.areas[has] + others.areas[other_rows[pair]] - shared
    numbers["iou"][has] = np.minimum(shared / united, 1.0)
    partners = np.ma.MaskedArray(partner, mask=~has)
    return {"id": footprints.ids, "verdict": verdict, "partner": partners, **numbers, "rmse": rmse}


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
        Detections that stand for a reference or are pieces of it: more than one when it is split.
    times : list of int
        Detections that stand for it or duplicate that one: more than one when it is detected again.
    home : list of int
        For each detection the reference that it is matched with or booked on, or -1.
    """

    pieces: list[int]
    times: list[int]
    home: list[int]

    @classmethod
    def of(cls, graph: ObjectGraph) -> _Claims:
        match = graph.correspondence
        multiple = graph.counted_detections & (match.of_detection < 0) & (match.booked_on >= 0)
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

    def told(self, reference: int, subject: str = "") -> str:
        text = f"; {subject}split into {self.pieces[reference]} detections" if self.pieces[reference] > 1 else ""
        return text + (f"; {subject}detected {self.times[reference]} times" if self.times[reference] > 1 else "")


def _detection_reasons(
    graph: ObjectGraph,
    verdict: NDArray[np.object_],
    of_detection: _Neighbours,
    claims: _Claims,
    distance: NDArray[np.float64],
) -> list[str]:
    reference_ids, detection_ids = graph.reference.ids.tolist(), graph.detected.ids.tolist()
    touched, duplicates = of_detection.count.tolist(), graph.duplicates.tolist()
    holder = graph.correspondence.of_reference.tolist()
    reasons = []
    for row, (what, moved) in enumerate(zip(verdict.tolist(), distance.tolist(), strict=True)):
        if what == "FP":
            reasons.append("false alarm: overlaps no reference")
            continue
        if what == "left out":
            reasons.append(str(graph.left_out_reason[0][row]))
            continue
        mine = claims.home[row]
        if what == "TP":
            text = f"found reference {reference_ids[mine]}, shifted {moved:.1f} m" + claims.told(
                mine, "the reference is "
            )
        elif duplicates[row]:
            text = f"duplicate of detection {detection_ids[holder[mine]]} on reference {reference_ids[mine]}"
        else:
            text = (
                f"piece of reference {reference_ids[mine]}, which is split into {claims.pieces[mine]} detections and "
                f"represented by detection {detection_ids[holder[mine]]}"
            )
        if touched[row] > 1:
            others = [other for other in of_detection.of(row) if other != mine]
            text += f"; also covers part of reference {_names(graph.reference, others)}"
        reasons.append(text)
    return reasons


def _reference_reasons(
    graph: ObjectGraph,
    table: dict[str, Any],
    of_detection: _Neighbours,
    of_reference: _Neighbours,
    claims: _Claims,
) -> list[str]:
    match = graph.correspondence
    reference_ids, detection_ids = graph.reference.ids.tolist(), graph.detected.ids.tolist()
    partner, holds = match.of_reference.tolist(), match.of_detection.tolist()
    overlapping, touched = of_reference.count.tolist(), of_detection.count.tolist()
    covered = (table["overlap_area"] / graph.reference.areas).tolist()
    reasons = []
    for row, (what, moved) in enumerate(zip(table["verdict"].tolist(), table["distance"].tolist(), strict=True)):
        if what == "left out":
            reasons.append(str(graph.left_out_reason[1][row]))
        elif what == "TP":
            mine = partner[row]
            text = f"found by detection {detection_ids[mine]}, shifted {moved:.1f} m" + claims.told(row)
            if touched[mine] > 1:
                others = [other for other in of_detection.of(mine) if other != row]
                text += f"; the detection also covers part of reference {_names(graph.reference, others)}"
            if overlapping[row] > claims.pieces[row] + claims.times[row] - 1:
                others = [other for other in of_reference.of(row) if claims.home[other] != row]
                names = _names(graph.detected, others)
                text += (
                    f"; detection {names} of another reference covers part of it"
                    if len(others) == 1
                    else f"; detections {names} of other references cover parts of it"
                )
            reasons.append(text)
        elif overlapping[row] == 0:
            reasons.append("missed: no detection overlaps it")
        else:
            nearest = of_reference.of(row)[0]
            name, share = detection_ids[nearest], _share(covered[row])
            if holds[nearest] >= 0:
                other = reference_ids[holds[nearest]]
                text = f"merged with reference {other} into detection {name}, which covers {share} of it"
            else:
                # Only where a detection has a single choice (one-pass matching).
                other = reference_ids[claims.home[nearest]]
                text = f"missed: detection {name} overlaps it ({share}) but is booked on reference {other}"
            reasons.append(text)
    return reasons
