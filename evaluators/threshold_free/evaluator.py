"""The evaluator ``threshold-free``: overlaps, correspondence, areas and distances put together.

Steps: leave out what the evaluation area or the minimum size excludes; find overlapping pairs; match; count; measure
areas and distances. The indices follow from these tallies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

import shapely

from ...core.errors import InputError
from ...core.parameters import parameter
from ...scenes.geodata.crs import common_crs
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.raster import Grid
from ..base import Evaluation, Evaluator
from ..overlay.left_out import LeftOut, left_out_notes
from ..overlay.outline_distances import PairDistances, pair_distances
from ..overlay.reference_overlaps import input_notes
from ..verdict_table import Verdicts
from .correspondence import MATCHINGS
from .counting import count_buildings, count_objects, measure_areas, pair_sums
from .indices import (
    GROUPS,
    BuildingIndices,
    GeometricIndices,
    MultipleAsCorrectIndices,
    ObjectIndices,
    PixelIndices,
    PixelLiteralIndices,
)
from .object_graph import ObjectGraph, OverlapGraph, object_graph
from .tallies import Counts, Scenes, ThresholdFreeTallies
from .verdicts import MEASURES, VERDICT_KINDS, find_verdicts

__all__ = ["ThresholdFree", "ThresholdFreeEvaluation"]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class ThresholdFreeEvaluation(Evaluation):
    """Result of the threshold-free evaluation; fractions, metres, None where undefined.

    ``evaluation.object.quality``, ``evaluation.pixel.completeness``, ``evaluation.geometric.rmse``,
    ``evaluation.counts.multiple_detections``, ``evaluation.verdicts.detections``.

    Attributes
    ----------
    tallies : ThresholdFreeTallies
    graph : ObjectGraph, optional
        Overlaps and matches; None of a pooled evaluation.
    """

    tallies: ThresholdFreeTallies
    graph: ObjectGraph | None = field(default=None, repr=False)

    @property
    def counts(self) -> Counts:
        """Numbers of objects: detected, reference, true_positives and so on."""
        return self.tallies.counts

    @cached_property
    def object(self) -> ObjectIndices:
        """The seven object indices."""
        return ObjectIndices.of(self.tallies)

    @cached_property
    def pixel(self) -> PixelIndices:
        """The seven pixel (area) indices and their variants."""
        return PixelIndices.of(self.tallies)

    @cached_property
    def pixel_literal(self) -> PixelLiteralIndices:
        """The seven pixel (area) indices by the literal text of the paper: entity by entity."""
        return PixelLiteralIndices.of(self.tallies)

    @cached_property
    def geometric(self) -> GeometricIndices:
        """RMSE and its companions."""
        return GeometricIndices.of(self.tallies)

    @cached_property
    def multiple_as_correct(self) -> MultipleAsCorrectIndices:
        """The object indices with multiple detections counted as correct."""
        return MultipleAsCorrectIndices.of(self.tallies)

    @cached_property
    def building(self) -> BuildingIndices:
        """Completeness of buildings that have several parts."""
        return BuildingIndices.of(self.tallies)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON contract: ``counts``, ``object``, ``pixel``, ``geometric``, ``areas`` and more."""
        content = super().to_dict()
        del content["tallies"]
        tallies = self.tallies
        content["geometric"] |= {
            "pairs": tallies.geometric.pairs,
            "pairs_by_corners": tallies.geometric.pairs_by_corners,
        }
        for name in ("areas", "literal_areas", "left_out", "buildings"):
            content[name] = getattr(tallies, name).to_dict()
        return content


@dataclass(frozen=True, kw_only=True)
class ThresholdFree(Evaluator):
    """Threshold-free, pseudo one-to-one evaluation with 15 indices (Awrangjeb, Ravanbakhsh & Fraser 2010)."""

    name: ClassVar[str] = "threshold-free"
    paper = "Awrangjeb, Ravanbakhsh & Fraser 2010, ISPRS Journal of Photogrammetry and Remote Sensing 65(5), section 4"
    groups = GROUPS
    tallies_type = ThresholdFreeTallies
    evaluation_type = ThresholdFreeEvaluation
    ranked_by: ClassVar[str] = "object.quality"
    gated_by: ClassVar[tuple[str, ...]] = (
        "object.completeness",
        "object.correctness",
        "pixel.completeness",
        "pixel.correctness",
        "geometric.rmse",
    )
    swept_by: ClassVar[tuple[str, ...]] = ("object.quality", "pixel.quality")
    summarised_by: ClassVar[tuple[str, ...]] = (
        "object.quality",
        "object.completeness",
        "object.correctness",
        "pixel.quality",
        "geometric.rmse",
    )
    verdict_kinds = VERDICT_KINDS
    measures = MEASURES

    matching: Literal["nearest", "one-pass", "overlap"] = parameter(
        "nearest",
        choices=MATCHINGS,
        doc="how partners are chosen",
        source="2010 paper, 4.1; docs/reference/evaluation.md",
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
        by_pixels = self.area == "pixels" or (self.area == "auto" and grid is not None)
        if area is not None:
            shapely.prepare(area)
        graph = object_graph(detected, reference, matching=self.matching, area=area, minimum_area=self.minimum_area)
        outlines = pair_distances(detected, reference, graph.correspondence.pairs)
        areas, literal = measure_areas(graph, detected, reference, area=area, lattice=lattice if by_pixels else None)
        tallies = ThresholdFreeTallies(
            counts=count_objects(graph),
            buildings=count_buildings(graph),
            scenes=Scenes(all=1, by_pixels=int(by_pixels)),
            left_out=LeftOut.of(graph.detections, graph.references),
            areas=areas,
            literal_areas=literal,
            geometric=pair_sums(graph, outlines, lattice.gsd if lattice else None),
            iou=ThresholdFreeTallies().iou.filled(graph.pair_iou),
        )
        return ThresholdFreeEvaluation(
            evaluator=self,
            tallies=tallies,
            notes=(
                *input_notes(detected, reference, graph.within[1]),
                *self.notes_of(tallies),
            ),
            find_verdicts=lambda: _verdicts(graph, outlines, detected, reference),
            graph=graph,
        )

    def notes_of(self, tallies: ThresholdFreeTallies) -> tuple[str, ...]:
        """Return how areas and RMSE were measured, and how many objects were left out."""
        return tuple(_notes(tallies))

    def _lattice(self, grid: Grid | None) -> Grid | None:
        """Return the pixel lattice: the orthoimage's, or one through the origin with the given GSD."""
        if self.gsd is not None:
            west, north = (grid.west, grid.north) if grid is not None else (0.0, 0.0)
            return Grid(west, north, self.gsd, 1, 1)
        if grid is None and self.area == "pixels":
            raise InputError(
                "area by pixels needs a ground sampling distance where there is no orthoimage: give "
                "gsd= or use area='exact'"
            )
        return grid


def _verdicts(graph: OverlapGraph, outlines: PairDistances, detected: Footprints, reference: Footprints) -> Verdicts:
    sides = find_verdicts(graph, outlines.outline)
    return Verdicts(
        kinds=VERDICT_KINDS,
        measures=MEASURES,
        detection_table=sides[0].whole(),
        reference_table=sides[1].whole(),
        detected=detected,
        reference=reference,
    )


def _notes(tallies: ThresholdFreeTallies) -> Iterator[str]:
    scenes, by_pixels = tallies.scenes.all, tallies.scenes.by_pixels
    if scenes == 1:
        yield "areas counted in pixels" if by_pixels else "areas exact, by polygon overlay"
    elif scenes and by_pixels in (0, scenes):
        yield f"areas {'counted in pixels' if by_pixels else 'exact'} in all {scenes} scenes"
    elif scenes:
        yield f"areas counted in pixels in {by_pixels} of {scenes} scenes, exact in the others"
    yield from left_out_notes(tallies.left_out)
    pairs, by_corners = tallies.geometric.pairs, tallies.geometric.pairs_by_corners
    if pairs > by_corners:
        yield f"RMSE uses PoLiS for {pairs - by_corners} of {pairs} pairs, whose outlines are not rectangles"
