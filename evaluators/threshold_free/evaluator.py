"""The evaluator ``threshold-free``: overlaps, correspondence, areas and distances put together.

Steps: leave out what the evaluation area or the minimum size excludes; find overlapping pairs; match; count; measure
areas and distances; derive the indices.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.parameters import parameter
from ...scenes.geodata.crs import common_crs
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.raster import Grid
from ..base import Evaluation, Evaluator, Index, Samples, Tallies, Verdicts
from ..overlay.areas import AreaTally, exact_areas
from ..overlay.outline_distances import pair_distances
from ..overlay.overlaps import Overlaps, common_ground, overlaps_between, overlaps_within, shared_areas
from ..overlay.pixels import pixel_areas
from .correspondence import MATCHINGS, Correspondence, match
from .indices import COUNTS, INDICES, index_values
from .verdicts import ObjectGraph, verdict_tables

__all__ = ["ThresholdFree", "ThresholdFreeEvaluation"]


@dataclass(frozen=True, eq=False, kw_only=True)
class ThresholdFreeEvaluation(Evaluation):
    """Result of the threshold-free evaluation; fractions, metres, None where undefined.

    ``evaluation.object.quality``, ``evaluation.pixel.completeness``, ``evaluation.geometric.rmse``,
    ``evaluation.counts.multiple_detections``, ``evaluation.verdicts.detections``.
    """

    graph: ObjectGraph | None = field(default=None, repr=False)

    @property
    def counts(self) -> SimpleNamespace:
        """Numbers of objects: detected, reference, true_positives and so on."""
        return SimpleNamespace(**{name: int(self.tallies.get(f"counts.{name}", 0)) for name in COUNTS})

    @property
    def object(self) -> SimpleNamespace:
        """The seven object indices."""
        return self._group("object")

    @property
    def pixel(self) -> SimpleNamespace:
        """The seven pixel (area) indices and their variants."""
        return self._group("pixel")

    @property
    def geometric(self) -> SimpleNamespace:
        """RMSE and its companions."""
        return self._group("geometric")

    def _group(self, name: str) -> SimpleNamespace:
        prefix = name + "."
        return SimpleNamespace(
            **{key.removeprefix(prefix): value for key, value in self.values.items() if key.startswith(prefix)}
        )

    @cached_property
    def _verdicts(self) -> Verdicts | None:
        return None if self.graph is None else verdict_tables(self.graph)

    @property
    def verdicts(self) -> Verdicts | None:
        """One row per detection and per reference with its reason; None of a pooled evaluation."""
        return self._verdicts

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON contract: ``counts``, ``object``, ``pixel``, ``geometric``, ``areas`` and more."""
        nested = super().to_dict()
        nested.pop("tallies")
        for key, value in self.tallies.items():
            group, _, name = key.partition(".")
            if group in ("counts", "areas", "left_out", "buildings"):
                nested.setdefault(group, {})[name] = value if group == "areas" else int(value)
        for name in ("pairs", "pairs_by_corners"):
            nested["geometric"][name] = int(self.tallies.get(f"geometric.{name}", 0))
        order = ("evaluator", "parameters", "counts", "object", "pixel", "geometric")
        return {key: nested[key] for key in order} | nested


@dataclass(frozen=True, kw_only=True)
class ThresholdFree(Evaluator):
    """Threshold-free, pseudo one-to-one evaluation with 15 indices (Awrangjeb, Ravanbakhsh & Fraser 2010)."""

    name: ClassVar[str] = "threshold-free"
    indices: ClassVar[tuple[Index, ...]] = INDICES

    matching: Literal["nearest", "one-pass", "overlap"] = parameter(
        "nearest", choices=MATCHINGS, doc="how partners are chosen", source="2010 paper, 4.1; evaluation.md, 2"
    )
    area: Literal["auto", "exact", "pixels"] = parameter(
        "auto",
        choices=("auto", "exact", "pixels"),
        doc="areas by polygon overlay or by pixel centres; auto: pixels where the scene has an orthoimage",
        source="2010 paper, 4.2.2",
    )
    gsd: float | None = parameter(
        None, unit="m", minimum=0.001, doc="ground sampling distance of the pixel lattice, where there is no orthoimage"
    )
    minimum_area: float = parameter(
        0.0, unit="m2", minimum=0.0, doc="smaller references do not count, nor do detections that overlap only them"
    )

    def evaluate(
        self,
        detected: Footprints,
        reference: Footprints,
        *,
        area: shapely.Geometry | None = None,
        grid: Grid | None = None,
    ) -> ThresholdFreeEvaluation:
        """Compare two sets; see `Evaluator.evaluate`."""
        if len(detected) and len(reference):
            common_crs(detected.crs, reference.crs, (detected.source, reference.source))
        lattice = self._lattice(grid)
        if area is not None:
            shapely.prepare(area)
        pairs = overlaps_between(detected, reference)
        counted_references, reference_reason = self._counted_references(reference, area)
        candidates = pairs.only_significant
        usable = candidates.where(counted_references[candidates.second])
        distances = _centre_distances(detected, reference, usable)
        correspondence = match(usable, distances, (len(detected), len(reference)), matching=self.matching)
        counted_detections, detection_reason = _counted_detections(
            detected, correspondence, candidates, counted_references, area
        )
        kept = counted_detections[usable.first]
        usable, distances = usable.where(kept), distances[kept]
        within_detected, within_reference = overlaps_within(detected), overlaps_within(reference)
        tallies = _counts(
            detected,
            reference,
            usable,
            correspondence,
            (counted_detections, counted_references),
            within_detected.only_significant,
        )
        by_pixels = lattice if self._by_pixels(grid) else None
        tallies |= {
            "scenes.all": 1.0,
            "scenes.by_pixels": float(by_pixels is not None),
            "left_out.detected": float((~counted_detections).sum()),
            "left_out.reference_outside": float((reference_reason == _OUTSIDE).sum()),
            "left_out.reference_small": float((reference_reason == _SMALL).sum()),
        }
        tallies |= _areas(
            detected,
            reference,
            usable,
            correspondence,
            (counted_detections, counted_references),
            (within_detected, within_reference),
            area,
            by_pixels,
        )
        distances_of_pairs = pair_distances(detected, reference, correspondence.pairs)
        squared = distances_of_pairs.outline**2
        detections, references = correspondence.pairs
        offsets = detected.centres[detections] - reference.centres[references]
        centre = np.hypot(offsets[:, 0], offsets[:, 1])
        tallies |= {
            "geometric.pairs": float(len(squared)),
            "geometric.pairs_by_corners": float(distances_of_pairs.by_corners.sum()),
            "geometric.sum_squared": float(squared.sum()),
            "geometric.sum_squared_pixels": float(squared.sum() / lattice.gsd**2) if lattice else 0.0,
            "geometric.pairs_with_gsd": float(len(squared)) if lattice else 0.0,
            "geometric.sum_squared_centre": float((centre**2).sum()),
            "geometric.sum_centre": float(centre.sum()),
            "geometric.sum_polis": float(distances_of_pairs.polis.sum()),
        }
        graph = ObjectGraph(
            detected,
            reference,
            usable,
            distances,
            correspondence,
            counted_detections,
            counted_references,
            (detection_reason, reference_reason),
            distances_of_pairs.outline,
            _duplicates(correspondence, within_detected.only_significant),
        )
        samples = {"iou": _pair_iou(detected, reference, usable, correspondence)}
        evaluation = self.summarise(tallies, samples, list(_repair_notes(detected, reference)))
        return ThresholdFreeEvaluation(
            evaluator=self,
            tallies=evaluation.tallies,
            samples=samples,
            values=evaluation.values,
            notes=evaluation.notes,
            graph=graph,
        )

    def summarise(self, tallies: Tallies, samples: Samples, notes: Sequence[str] = ()) -> ThresholdFreeEvaluation:
        """Return the evaluation that follows from tallies and samples; see `Evaluator.summarise`."""
        return ThresholdFreeEvaluation(
            evaluator=self,
            tallies=dict(tallies),
            samples=dict(samples),
            values=index_values(tallies, samples),
            notes=(*notes, *_tally_notes(tallies)),
        )

    def _by_pixels(self, grid: Grid | None) -> bool:
        return self.area == "pixels" or (self.area == "auto" and grid is not None)

    def _lattice(self, grid: Grid | None) -> Grid | None:
        """Return the pixel lattice: the orthoimage's, or one through the origin with the given GSD."""
        if self.gsd is not None:
            west, north = (grid.west, grid.north) if grid is not None else (0.0, 0.0)
            return Grid(west, north, self.gsd, 1, 1)
        if grid is None and self.area == "pixels":
            raise InputError(
                "area by pixels needs a ground sampling distance where there is no orthoimage: give --gsd "
                "(in Python: gsd=), or use --area exact"
            )
        return grid

    def _counted_references(
        self, reference: Footprints, area: shapely.Geometry | None
    ) -> tuple[NDArray[np.bool_], NDArray[np.object_]]:
        reason = np.full(len(reference), "", dtype=object)
        if self.minimum_area > 0:
            reason[reference.areas < self.minimum_area] = _SMALL
        if area is not None:
            reason[~_centres_inside(reference, area)] = _OUTSIDE
        return reason == "", reason


_OUTSIDE = "left out: its centre lies outside the evaluation area"
_SMALL = "left out: smaller than the minimum area"
_ONLY_LEFT_OUT = "left out: overlaps only references that are left out"


def _centres_inside(footprints: Footprints, area: shapely.Geometry) -> NDArray[np.bool_]:
    centres = footprints.centres
    inside: NDArray[np.bool_] = shapely.intersects_xy(area, centres[:, 0], centres[:, 1])
    return inside


def _centre_distances(detected: Footprints, reference: Footprints, pairs: Overlaps) -> NDArray[np.float64]:
    offsets = detected.centres[pairs.first] - reference.centres[pairs.second]
    distances: NDArray[np.float64] = np.hypot(offsets[:, 0], offsets[:, 1])
    return distances


def _counted_detections(
    detected: Footprints,
    correspondence: Correspondence,
    candidates: Overlaps,
    counted_references: NDArray[np.bool_],
    area: shapely.Geometry | None,
) -> tuple[NDArray[np.bool_], NDArray[np.object_]]:
    """Leave out unmatched detections outside the area, and those that overlap only left-out references."""
    reason = np.full(len(detected), "", dtype=object)
    unmatched = correspondence.of_detection < 0
    overlapping = np.zeros(len(detected), dtype=bool)
    overlapping[candidates.first] = True
    reason[unmatched & overlapping & (correspondence.booked_on < 0)] = _ONLY_LEFT_OUT
    if area is not None:
        reason[unmatched & ~_centres_inside(detected, area)] = _OUTSIDE
    return reason == "", reason


def _duplicates(correspondence: Correspondence, within: Overlaps) -> NDArray[np.bool_]:
    """Return the multiple detections that overlap the detection which stands for their reference."""
    multiple = (correspondence.of_detection < 0) & (correspondence.booked_on >= 0)
    holder = np.full(len(multiple), -1, dtype=np.int64)
    holder[multiple] = correspondence.of_reference[correspondence.booked_on[multiple]]
    duplicates = np.zeros(len(multiple), dtype=bool)
    for own, other in ((within.first, within.second), (within.second, within.first)):
        duplicates[own[holder[own] == other]] = True
    return duplicates


def _counts(
    detected: Footprints,
    reference: Footprints,
    overlaps: Overlaps,
    correspondence: Correspondence,
    counted: tuple[NDArray[np.bool_], NDArray[np.bool_]],
    within: Overlaps,
) -> dict[str, float]:
    """Return the counts of section 4.2.1 and of the buildings that are complete."""
    counted_detections, counted_references = counted
    partner, building = correspondence.of_detection, reference.building_codes
    matched = partner >= 0
    multiple = counted_detections & ~matched & (correspondence.booked_on >= 0)

    both = counted_detections[within.first] & counted_detections[within.second]
    one, two = within.first[both], within.second[both]
    # Natural overlap: two true positives on two parts of one building (a reference has one partner, so parts differ).
    natural = matched[one] & matched[two]
    natural[natural] = building[partner[one[natural]]] == building[partner[two[natural]]]
    overlapping = np.union1d(one[~natural], two[~natural])

    touched = np.unique(np.stack([overlaps.first, building[overlaps.second]], axis=1), axis=0)[:, 0]
    cross_lapping = (np.bincount(touched, minlength=len(detected)) > 1).sum()

    other = partner[overlaps.first]
    of_another_part = (other >= 0) & (other != overlaps.second) & (building[other] == building[overlaps.second])
    claimants = np.bincount(overlaps.second[~of_another_part], minlength=len(reference))

    found = correspondence.of_reference >= 0
    _, part_building = np.unique(building[counted_references], return_inverse=True)
    parts = np.bincount(part_building)
    found_parts = np.bincount(part_building, weights=found[counted_references], minlength=len(parts))
    values = {
        "counts.detected": counted_detections.sum(),
        "counts.reference": counted_references.sum(),
        "counts.true_positives": matched.sum(),
        "counts.false_positives": (counted_detections & ~matched & ~multiple).sum(),
        "counts.false_negatives": (counted_references & ~found).sum(),
        "counts.multiple_detections": multiple.sum(),
        "counts.overlapping_detections": len(overlapping),
        "counts.cross_lapping_detections": cross_lapping,
        "counts.cross_lapped_references": (claimants > 1).sum(),
        "buildings.reference": len(parts),
        "buildings.complete_all": (found_parts == parts).sum(),
        "buildings.complete_any": (found_parts > 0).sum(),
    }
    return {key: float(value) for key, value in values.items()}


def _areas(
    detected: Footprints,
    reference: Footprints,
    overlaps: Overlaps,
    correspondence: Correspondence,
    counted: tuple[NDArray[np.bool_], NDArray[np.bool_]],
    within: tuple[Overlaps, Overlaps],
    area: shapely.Geometry | None,
    lattice: Grid | None,
) -> dict[str, float]:
    """Return T, F and M, clipped to the evaluation area, counted on the lattice where there is one."""
    pairs = correspondence.pairs
    false_positives = np.flatnonzero(counted[0] & (correspondence.booked_on < 0))
    false_negatives = np.flatnonzero(counted[1] & (correspondence.of_reference < 0))
    is_match = correspondence.of_detection[overlaps.first] == overlaps.second
    shared = overlaps.area[is_match]
    if area is not None:
        detected, reference = _clipped(detected, area), _clipped(reference, area)
        shared = shared_areas(detected, reference, *pairs)
        within = _remeasured(detected, within[0]), _remeasured(reference, within[1])
    if lattice is not None:
        tally = pixel_areas(
            detected.polygons,
            reference.polygons,
            pairs,
            lattice,
            false_positives=false_positives,
            false_negatives=false_negatives,
        )
    else:
        tally = exact_areas(
            detected,
            reference,
            pairs,
            shared,
            false_positives=false_positives,
            false_negatives=false_negatives,
            within=within,
        )
    return {f"areas.{name}": getattr(tally, name) for name in AreaTally.__dataclass_fields__}


def _clipped(footprints: Footprints, area: shapely.Geometry) -> Footprints:
    """Return the footprints cut at the evaluation area; those outside become empty."""
    crossing = ~shapely.contains_properly(area, footprints.polygons)
    inside = footprints.polygons.copy()
    inside[crossing] = common_ground(inside[crossing], area)
    return Footprints(polygons=inside, crs=footprints.crs, source=footprints.source)


def _remeasured(footprints: Footprints, within: Overlaps) -> Overlaps:
    area = shared_areas(footprints, footprints, within.first, within.second)
    return Overlaps(within.first, within.second, area, within.significant)


def _pair_iou(
    detected: Footprints, reference: Footprints, overlaps: Overlaps, correspondence: Correspondence
) -> NDArray[np.float64]:
    is_match = correspondence.of_detection[overlaps.first] == overlaps.second
    shared = overlaps.area[is_match]
    united = detected.areas[overlaps.first[is_match]] + reference.areas[overlaps.second[is_match]] - shared
    iou: NDArray[np.float64] = np.minimum(shared / united, 1.0)
    return iou


def _repair_notes(*sets: Footprints) -> Iterator[str]:
    for footprints in sets:
        for action in ("mended", "left out"):
            ids = [str(repair.id) for repair in footprints.repairs if repair.action == action]
            if ids:
                more = f" and {len(ids) - 10} more" if len(ids) > 10 else ""
                yield f"{footprints.source}: {_counted(len(ids), 'feature')} {action}: {', '.join(ids[:10])}{more}"


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _tally_notes(tallies: Mapping[str, float]) -> Iterator[str]:
    def number(key: str) -> int:
        return int(tallies.get(key, 0))

    scenes, by_pixels = number("scenes.all"), number("scenes.by_pixels")
    if scenes == 1:
        yield "areas counted in pixels" if by_pixels else "areas exact, by polygon overlay"
    elif scenes and by_pixels in (0, scenes):
        yield f"areas {'counted in pixels' if by_pixels else 'exact'} in all {scenes} scenes"
    elif scenes:
        yield f"areas counted in pixels in {by_pixels} of {scenes} scenes, exact in the others"
    if number("left_out.detected"):
        yield (
            f"{_counted(number('left_out.detected'), 'detection')} left out: outside the evaluation area, "
            "or on references that are left out"
        )
    if number("left_out.reference_outside"):
        yield f"{_counted(number('left_out.reference_outside'), 'reference')} outside the evaluation area left out"
    if number("left_out.reference_small"):
        yield f"{_counted(number('left_out.reference_small'), 'reference')} below the minimum area left out"
    by_polis = number("geometric.pairs") - number("geometric.pairs_by_corners")
    if by_polis:
        yield f"RMSE uses PoLiS for {by_polis} of {number('geometric.pairs')} pairs, whose outlines are no rectangles"
