"""Causes: which kind of error each square metre of false positive and false negative area (F and M) belongs to.

Nouns
-----
rim
    What lies within a distance (1.5 m) of the outline of a reference: outlines drawn too small or too large.
split
    Part of a matched reference that another detection covers.
merged
    Part of a reference without a match that a detection of another reference covers, and what that detection has there.

Where neither detections nor references overlap each other, the areas of all causes sum up to F + M; common area of
several detections may be counted for several causes.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from .object_graph import ObjectGraph

__all__ = ["CAUSES", "LossByCause", "loss_by_cause"]

#: Metres: width of the rim on either side of the outline of a reference.
_RIM = 1.5


@dataclass(frozen=True, kw_only=True)
class LossByCause:
    """Area of each cause, m2.

    Attributes
    ----------
    split : float
        M: of matched references, covered by other detections.
    merged : float
        F and M: of a detection inside references other than its own, and of unmatched references that are covered.
    false_alarms : float
        F: of detections that overlap no reference.
    missed : float
        M: of unmatched references, not covered by any detection.
    rim_omitted, rim_added : float
        M and F within the rim of matched references.
    holes, bulges : float
        M deeper inside matched references, F farther outside.
    """

    split: float = 0.0
    merged: float = 0.0
    false_alarms: float = 0.0
    missed: float = 0.0
    rim_omitted: float = 0.0
    rim_added: float = 0.0
    holes: float = 0.0
    bulges: float = 0.0

    def points(self, total: float) -> dict[str, float | None]:
        """Return percent points of pixel quality lost by each cause; `total` is T + F + M, m2. None where that is 0."""
        return {name: 100 * value / total if total > 0 else None for name, value in asdict(self).items()}


#: Names of the causes, in the order of their columns.
CAUSES = tuple(asdict(LossByCause()))


def loss_by_cause(graph: ObjectGraph, *, area: Any = None, rim: float = _RIM) -> LossByCause:
    """Return the area that is lost by each cause.

    Parameters
    ----------
    graph : ObjectGraph
        Of an evaluation (`ThresholdFreeEvaluation.graph`).
    area : polygon, optional
        Evaluation area, the same as that of the evaluation.
    rim : float
        Width of the rim, m.

    Examples
    --------
    >>> import roofbench as rb, shapely
    >>> reference = rb.Footprints.of([shapely.box(0, 0, 10, 10), shapely.box(20, 0, 30, 10)])
    >>> detected = rb.Footprints.of([shapely.box(0, 0, 10, 9), shapely.box(50, 0, 55, 5)])
    >>> loss = loss_by_cause(rb.evaluate(detected, reference).graph)
    >>> loss.rim_omitted, loss.missed, loss.false_alarms
    (10.0, 100.0, 25.0)
    """
    match = graph.correspondence
    detected, reference = graph.detected.polygons, graph.reference.polygons
    if area is not None:
        detected, reference = shapely.intersection(detected, area), shapely.intersection(reference, area)
    all_detected = shapely.union_all(detected[graph.detections.mask])
    all_reference = shapely.union_all(reference[graph.references.mask])
    rows, partners = match.pairs
    found, own = detected[rows], reference[partners]

    omitted = shapely.difference(own, found)
    open_omitted = shapely.difference(omitted, all_detected)
    deep = _area(shapely.intersection(open_omitted, shapely.buffer(own, -rim)))
    added = shapely.difference(found, own)
    open_added = shapely.difference(added, all_reference)
    near = _area(shapely.intersection(open_added, shapely.buffer(own, rim)))
    unmatched = reference[graph.references.mask & (match.of_reference < 0)]
    covered = _area(shapely.intersection(unmatched, all_detected))
    alone = np.flatnonzero(graph.detections.mask & (match.assigned_to < 0))
    return LossByCause(
        split=max(_area(omitted) - _area(open_omitted), 0.0),
        merged=max(_area(added) - _area(open_added), 0.0) + covered,
        false_alarms=_area(detected[alone]),
        missed=max(_area(unmatched) - covered, 0.0),
        rim_omitted=max(_area(open_omitted) - deep, 0.0),
        rim_added=near,
        holes=deep,
        bulges=max(_area(open_added) - near, 0.0),
    )


def _area(polygons: NDArray[np.object_]) -> float:
    return float(shapely.area(polygons).sum())
