"""The object graph: footprints as nodes, overlaps as edges, with the matches of the correspondence.

Counts, areas and verdicts all follow from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from ..overlay.left_out import Counted, Objects, counted_detections, counted_references
from ..overlay.overlaps import Overlaps, overlaps_between, overlaps_within
from .correspondence import Correspondence, match

__all__ = ["ObjectGraph", "OverlapGraph", "object_graph", "overlap_graph"]


#: Pairs measured at a time.
_CHUNK = 1 << 18


@dataclass(frozen=True, eq=False, kw_only=True)
class OverlapGraph:
    """Two sets of objects with their overlaps and matches.

    Attributes
    ----------
    detected, reference : Objects
    overlaps : Overlaps
        Overlapping (detection, reference) pairs of objects that count.
    distances : ndarray, shape (len(overlaps),)
        Centre distance of each overlapping pair, m.
    within : tuple of Overlaps
        Pairs of detections, and pairs of references, that share any area.
    correspondence : Correspondence
    detections, references : Counted
        Which objects count, and why the others do not.
    """

    detected: Objects
    reference: Objects
    overlaps: Overlaps
    distances: NDArray[np.float64]
    within: tuple[Overlaps, Overlaps]
    correspondence: Correspondence
    detections: Counted
    references: Counted

    @cached_property
    def matched_overlaps(self) -> NDArray[np.int64]:
        """Place of each matched pair in `overlaps`, by detection, shape (number of TP pairs,)."""
        return np.flatnonzero(self.correspondence.of_detection[self.overlaps.first] == self.overlaps.second)

    @cached_property
    def pair_iou(self) -> NDArray[np.float64]:
        """Intersection over union of each matched pair, by detection, shape (number of TP pairs,)."""
        return self.iou(self.matched_overlaps)

    def iou(self, place: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the intersection over union of the overlaps at these places."""
        shared = self.overlaps.area[place]
        united = self.detected.areas[self.overlaps.first[place]] + self.reference.areas[self.overlaps.second[place]]
        iou: NDArray[np.float64] = np.minimum(shared / (united - shared), 1.0)
        return iou

    @cached_property
    def duplicates(self) -> NDArray[np.bool_]:
        """Multiple detections that overlap the detection matched with their reference; shape (len(detected),).

        The other multiple detections are pieces of a reference.
        """
        match, within = self.correspondence, self.within[0].only_significant
        multiple = (match.of_detection < 0) & (match.assigned_to >= 0)
        holder = np.full(len(multiple), -1, dtype=np.int64)
        holder[multiple] = match.of_reference[match.assigned_to[multiple]]
        duplicates = np.zeros(len(multiple), dtype=bool)
        for own, other in ((within.first, within.second), (within.second, within.first)):
            duplicates[own[holder[own] == other]] = True
        return duplicates


@dataclass(frozen=True, eq=False, kw_only=True)
class ObjectGraph(OverlapGraph):
    """The graph of two footprint sets, which has their outlines at hand."""

    detected: Footprints
    reference: Footprints


def object_graph(
    detected: Footprints,
    reference: Footprints,
    *,
    matching: str = "nearest",
    area: shapely.Geometry | None = None,
    minimum_area: float = 0.0,
) -> ObjectGraph:
    """Find overlaps, leave out what does not count, and match.

    Parameters
    ----------
    detected, reference : Footprints
    matching : {"nearest", "one-pass", "overlap"}
        See `match`.
    area : polygon, optional
        Evaluation area.
    minimum_area : float
        Smaller references do not count, m2.
    """
    return ObjectGraph(
        **_linked(
            detected,
            reference,
            overlaps_between(detected, reference).only_significant,
            (overlaps_within(detected), overlaps_within(reference)),
            matching=matching,
            area=area,
            minimum_area=minimum_area,
        )
    )


def overlap_graph(
    detected: Objects,
    reference: Objects,
    candidates: Overlaps,
    within: tuple[Overlaps, Overlaps],
    *,
    matching: str = "nearest",
    minimum_area: float = 0.0,
) -> OverlapGraph:
    """Leave out what does not count, and match; for overlaps that were found elsewhere.

    Parameters
    ----------
    candidates : Overlaps
        All overlapping (detection, reference) pairs.
    within : tuple of Overlaps
        Pairs of detections, and pairs of references, that share any area.
    """
    return OverlapGraph(
        **_linked(detected, reference, candidates, within, matching=matching, area=None, minimum_area=minimum_area)
    )


def _linked(
    detected: Objects,
    reference: Objects,
    candidates: Overlaps,
    within: tuple[Overlaps, Overlaps],
    *,
    matching: str,
    area: shapely.Geometry | None,
    minimum_area: float,
) -> dict[str, Any]:
    """Return the fields of the graph."""
    references = counted_references(reference, area=area, minimum_area=minimum_area)
    usable = candidates.where(references.mask[candidates.second])
    distances = _centre_distances(detected, reference, usable)
    correspondence = match(usable, distances, (len(detected), len(reference)), matching=matching)
    detections = counted_detections(
        detected, candidates, references, matched=correspondence.of_detection >= 0, area=area
    )
    kept = detections.mask[usable.first]
    return {
        "detected": detected,
        "reference": reference,
        "overlaps": usable.where(kept),
        "distances": distances[kept],
        "within": within,
        "correspondence": correspondence,
        "detections": detections,
        "references": references,
    }


def _centre_distances(detected: Objects, reference: Objects, pairs: Overlaps) -> NDArray[np.float64]:
    one, two = detected.centres, reference.centres
    distances = np.empty(len(pairs))
    for start in range(0, len(pairs), _CHUNK):
        part = slice(start, start + _CHUNK)
        offsets = one[pairs.first[part]] - two[pairs.second[part]]
        distances[part] = np.hypot(offsets[:, 0], offsets[:, 1])
    return distances
