"""Counts and areas of the threshold-free evaluation (Awrangjeb et al. 2010, sections 4.2.1 and 4.2.2)."""

from __future__ import annotations

from functools import partial

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.raster import Grid
from ..overlay.areas import AreaTally, exact_areas
from ..overlay.exact_sum import exact_sum
from ..overlay.left_out import clipped, remeasured
from ..overlay.outline_distances import PairDistances
from ..overlay.overlaps import Overlaps, shared_areas
from ..overlay.pixels import pixel_areas
from .object_graph import OverlapGraph
from .tallies import Buildings, Counts, LiteralAreas, PairSums

__all__ = ["count_buildings", "count_objects", "measure_areas", "natural_overlaps", "pair_sums"]


def count_objects(graph: OverlapGraph) -> Counts:
    """Return the counts of section 4.2.1."""
    overlaps, within = graph.overlaps, graph.within[0].only_significant
    partner, building = graph.correspondence.of_detection, graph.reference.building_codes
    matched = partner >= 0
    multiple = graph.detections.mask & ~matched & (graph.correspondence.assigned_to >= 0)

    both = graph.detections.mask[within.first] & graph.detections.mask[within.second]
    one, two = within.first[both], within.second[both]
    natural = _natural(graph, one, two)
    overlapping = np.union1d(one[~natural], two[~natural])

    buildings = int(building.max()) + 1 if len(building) else 1
    touched = np.sort(overlaps.first * buildings + building[overlaps.second])
    touched = touched[np.diff(touched, prepend=-1) > 0] // buildings
    cross_lapping = (np.bincount(touched, minlength=len(graph.detected)) > 1).sum()

    other = partner[overlaps.first]
    of_another_part = (other >= 0) & (other != overlaps.second) & (building[other] == building[overlaps.second])
    claimants = np.bincount(overlaps.second[~of_another_part], minlength=len(graph.reference))

    found = graph.correspondence.of_reference >= 0
    return Counts(
        detected=int(graph.detections.mask.sum()),
        reference=int(graph.references.mask.sum()),
        true_positives=int(matched.sum()),
        false_positives=int((graph.detections.mask & ~matched & ~multiple).sum()),
        false_negatives=int((graph.references.mask & ~found).sum()),
        multiple_detections=int(multiple.sum()),
        overlapping_detections=len(overlapping),
        cross_lapping_detections=int(cross_lapping),
        cross_lapped_references=int((claimants > 1).sum()),
    )


def _natural(graph: OverlapGraph, one: NDArray[np.int64], two: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which pairs of detections are true positives on two parts of one building.

    A reference has one partner, so the parts differ.
    """
    partner, building = graph.correspondence.of_detection, graph.reference.building_codes
    natural = (partner[one] >= 0) & (partner[two] >= 0)
    natural[natural] = building[partner[one[natural]]] == building[partner[two[natural]]]
    return natural


def natural_overlaps(graph: OverlapGraph, within: tuple[Overlaps, Overlaps]) -> tuple[Overlaps, Overlaps]:
    """Return the overlaps of parts of one building: between detections, and between references."""
    building = graph.reference.building_codes
    found, known = within
    return (
        found.where(_natural(graph, found.first, found.second)),
        known.where(building[known.first] == building[known.second]),
    )


def count_buildings(graph: OverlapGraph) -> Buildings:
    """Return how many reference buildings there are, and how many have all or any of their parts found."""
    counted = graph.references.mask
    found = graph.correspondence.of_reference >= 0
    part_building = graph.reference.building_codes[counted]
    parts = np.bincount(part_building)
    found_parts = np.bincount(part_building[found[counted]], minlength=len(parts))
    return Buildings(
        reference=int((parts > 0).sum()),
        complete_all=int(((parts > 0) & (found_parts == parts)).sum()),
        complete_any=int((found_parts > 0).sum()),
    )


def measure_areas(
    graph: OverlapGraph,
    detected: Footprints,
    reference: Footprints,
    *,
    area: shapely.Geometry | None,
    lattice: Grid | None,
) -> tuple[AreaTally, LiteralAreas]:
    """Return T, F and M, clipped to the evaluation area: of the unions, and by the literal text of section 4.2.2.

    By the literal text each entity counts for itself, and only what parts of one building share counts once.

    Parameters
    ----------
    graph : OverlapGraph
    detected, reference : Footprints
        The objects of the graph.
    area : polygon or None
        Evaluation area.
    lattice : Grid or None
        Pixels to count; None for exact areas.
    """
    match, overlaps, within = graph.correspondence, graph.overlaps, graph.within
    pairs = match.pairs
    false_positives = np.flatnonzero(graph.detections.mask & (match.assigned_to < 0))
    false_negatives = np.flatnonzero(graph.references.mask & (match.of_reference < 0))
    shared = overlaps.area[graph.matched_overlaps]
    if area is not None:
        detected, reference = clipped(detected, area), clipped(reference, area)
        shared = shared_areas(detected, reference, *pairs)
        within = remeasured(detected, within[0]), remeasured(reference, within[1])
    if lattice is not None:
        building = graph.reference.building_codes
        alone = len(building) + np.arange(len(false_positives))
        buildings = np.concatenate([building[pairs[1]], alone, building[false_negatives]])
        by_pixels = partial(
            pixel_areas,
            *(detected.polygons, reference.polygons, pairs, lattice),
            false_positives=false_positives,
            false_negatives=false_negatives,
        )
        return by_pixels(), LiteralAreas.of(by_pixels(groups=buildings))
    exact = partial(
        exact_areas,
        *(detected, reference, pairs, shared),
        false_positives=false_positives,
        false_negatives=false_negatives,
    )
    return exact(within=within), LiteralAreas.of(exact(within=natural_overlaps(graph, within)))


def pair_sums(graph: OverlapGraph, outlines: PairDistances, gsd: float | None) -> PairSums:
    """Return the sums over the TP pairs; `gsd` is the ground sampling distance of the pixels, m, where it is known."""
    squared: NDArray[np.float64] = outlines.outline**2
    centre = graph.distances[graph.matched_overlaps]
    sum_squared = exact_sum(squared)
    return PairSums(
        pairs=len(squared),
        pairs_by_corners=int(outlines.by_corners.sum()),
        sum_squared=sum_squared,
        sum_squared_pixels=sum_squared / gsd**2 if gsd else 0.0,
        pairs_with_gsd=len(squared) if gsd else 0,
        sum_squared_centre=exact_sum(centre**2),
        sum_centre=exact_sum(centre),
        sum_polis=exact_sum(outlines.polis),
    )
