"""Coverage: how much of each footprint the other side covers.

Nouns
-----
share covered
    Part of a footprint's own area that lies inside any footprint of the other side, 0 to 1. Where several of them
    overlap each other inside it, the place counts once.
main partner
    The footprint of the other side that shares the most area; of equal ones the first.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.crs import common_crs
from ...scenes.geodata.footprints import Footprints
from .left_out import Counted, LeftOut, counted_detections, counted_references
from .overlaps import Overlaps, overlaps_between
from .polygon_overlay import common_ground, united_area

__all__ = ["CountedSets", "Coverage", "counted_sets"]


@dataclass(frozen=True, eq=False)
class Coverage:
    """What the other side does to the footprints of one side; arrays of shape (n,).

    Attributes
    ----------
    share : ndarray of float64
        Share covered, 0 to 1.
    touched : ndarray of int64
        Number of footprints of the other side that overlap it.
    partner : ndarray of int64
        Row of the main partner, or -1.
    shared : ndarray of float64
        Area shared with the main partner, m2; 0 without one.
    """

    share: NDArray[np.float64]
    touched: NDArray[np.int64]
    partner: NDArray[np.int64]
    shared: NDArray[np.float64]

    def partner_ids(self, others: Footprints) -> NDArray[np.int64]:
        """Return the ids of the main partners, -1 without any."""
        ids = np.full(len(self.partner), -1, dtype=np.int64)
        has = self.partner >= 0
        ids[has] = others.ids[self.partner[has]]
        return ids


@dataclass(frozen=True, eq=False, kw_only=True)
class CountedSets:
    """Two footprint sets, which of them count, and their overlaps.

    Attributes
    ----------
    detected, reference : Footprints
    detections, references : Counted
    overlaps : Overlaps
        Overlapping (detection, reference) pairs of objects that count.
    """

    detected: Footprints
    reference: Footprints
    detections: Counted
    references: Counted
    overlaps: Overlaps

    @property
    def left_out(self) -> LeftOut:
        """Numbers of objects that do not count."""
        return LeftOut.of(self.detections, self.references)

    @cached_property
    def of_detections(self) -> Coverage:
        """Coverage of the detections by the references."""
        return _coverage(self.detected, self.reference, self.overlaps.first, self.overlaps.second, self.overlaps.area)

    @cached_property
    def of_references(self) -> Coverage:
        """Coverage of the references by the detections."""
        return _coverage(self.reference, self.detected, self.overlaps.second, self.overlaps.first, self.overlaps.area)


def counted_sets(
    detected: Footprints,
    reference: Footprints,
    *,
    area: shapely.Geometry | None = None,
    minimum_area: float = 0.0,
) -> CountedSets:
    """Find overlaps and leave out what does not count; see `overlay.left_out`.

    A detection that overlaps a counted reference always counts.

    Parameters
    ----------
    detected, reference : Footprints
        In one CRS.
    area : polygon, optional
        Evaluation area.
    minimum_area : float
        Smaller references do not count, m2.

    Raises
    ------
    CRSError
        The two sets have no common CRS.
    """
    if len(detected) and len(reference):
        common_crs(detected.crs, reference.crs, (detected.source, reference.source))
    if area is not None:
        shapely.prepare(area)
    references = counted_references(reference, area=area, minimum_area=minimum_area)
    candidates = overlaps_between(detected, reference).only_significant
    overlaps = candidates.where(references.mask[candidates.second])
    matched = np.zeros(len(detected), dtype=bool)
    matched[overlaps.first] = True
    return CountedSets(
        detected=detected,
        reference=reference,
        detections=counted_detections(detected, candidates, references, matched=matched, area=area),
        references=references,
        overlaps=overlaps,
    )


def _coverage(
    own: Footprints,
    others: Footprints,
    row: NDArray[np.int64],
    other: NDArray[np.int64],
    area: NDArray[np.float64],
) -> Coverage:
    touched = np.bincount(row, minlength=len(own))
    # Last of each row after sorting by area; of equal areas the lowest other row.
    order = np.lexsort((-other, area, row))
    partner = np.full(len(own), -1, dtype=np.int64)
    shared = np.zeros(len(own))
    partner[row[order]], shared[row[order]] = other[order], area[order]
    covered: NDArray[np.float64] = np.bincount(row, weights=area, minlength=len(own)).astype(np.float64)
    several = np.flatnonzero(touched[row] > 1)
    if len(several):
        ground = common_ground(own.polygons[row[several]], others.polygons[other[several]])
        order = np.argsort(row[several], kind="stable")
        rows, start = np.unique(row[several][order], return_index=True)
        for number, group in zip(rows.tolist(), np.split(ground[order], start[1:]), strict=True):
            covered[number] = united_area(group)
    return Coverage(np.clip(covered / own.areas, 0.0, 1.0), touched, partner, shared)
