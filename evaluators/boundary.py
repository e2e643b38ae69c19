"""The evaluator ``boundary``: how far the outlines of matched footprints are apart, and how alike in shape they are.

Pairs are those of the threshold-free correspondence. Per pair: PoLiS and Hausdorff distance, boundary IoU, C-IoU,
S-IoU, corner errors, largest edge angle error, turning function distance, orthogonality. C-IoU of the scene and both
N-ratios have their own keys, because the literature uses one name for each two formulas.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from ..core.parameters import parameter
from ..scenes.geodata.crs import common_crs
from ..scenes.geodata.footprints import Footprints
from ..scenes.geodata.raster import Grid
from .base import Evaluation, Evaluator
from .index import Curve, IndexGroup, index, ratio
from .overlay import pair_shapes
from .overlay.areas import mask_areas
from .overlay.corner_matching import match_corners
from .overlay.coverage import CountedSets
from .overlay.coverage_verdicts import SideVerdicts, coverage_kinds, coverage_verdicts
from .overlay.left_out import LeftOut, left_out_notes
from .overlay.outline_distances import pair_distances
from .overlay.reference_overlaps import input_notes
from .overlay.turning import turning_distances
from .tally import ADDED, Histogram, Tallies, histogram
from .threshold_free.correspondence import MATCHINGS
from .threshold_free.object_graph import ObjectGraph, object_graph
from .verdict_table import Measure, Verdicts

__all__ = ["Boundary", "BoundaryIndices", "ComplexityIndices", "CornerIndices", "RegularityIndices"]

_POLIS = "Avbelj, Müller & Bamler 2015"
_ZORZI = "Zorzi, Bazrafkan, Habenschuss & Fraundorfer 2022"
_NAUATA = "Nauata & Furukawa 2020, radius in metres"
#: Distances in bins of 5 cm; from 5 m on in the last bin.
_METRES = histogram(low=0.0, high=5.0, bins=100)


@dataclass(frozen=True, kw_only=True)
class _Counts(Tallies):
    detected: int = 0
    reference: int = 0
    true_positives: int = 0
    false_negatives: int = 0


@dataclass(frozen=True, kw_only=True)
class _Sums(Tallies):
    boundary_iou: float = 0.0
    c_iou: float = 0.0
    s_iou: float = 0.0
    edge_angle_error: float = 0.0
    orthogonality: float = 0.0


@dataclass(frozen=True, kw_only=True)
class _Corners(Tallies):
    pairs: int = 0  # apart from the counts: stores of release 0.1 have pairs, but nothing of their corners
    turning_distance: float = 0.0
    detected: int = 0
    reference: int = 0
    matched: int = 0
    distance: float = 0.0


@dataclass(frozen=True, kw_only=True)
class _Scene(Tallies):
    scenes_with_corners: int = 0
    n_ratios: float = 0.0
    detected_corners: int = 0
    reference_corners: int = 0
    mask_shared: float = 0.0
    mask_united: float = 0.0


@dataclass(frozen=True, kw_only=True)
class _Tallies(Tallies):
    counts: _Counts = field(default_factory=_Counts)
    sums: _Sums = field(default_factory=_Sums)
    corners: _Corners = field(default_factory=_Corners, metadata=ADDED)
    scene: _Scene = field(default_factory=_Scene)
    left_out: LeftOut = field(default_factory=LeftOut)
    polis: Histogram = field(default_factory=_METRES)
    hausdorff: Histogram = field(default_factory=_METRES)


@dataclass(frozen=True, kw_only=True)
class BoundaryIndices(IndexGroup):
    """Distances of the outlines of pairs; None without a pair."""

    key = "boundary"
    title = "outlines"

    polis: float | None = index(
        "mean PoLiS",
        "lower",
        "m",
        lambda t: t.polis.mean,
        symbol="PoLiS",
        meaning="mean vertex-to-outline distance of pairs, both ways",
        source=_POLIS,
    )
    hausdorff: float | None = index(
        "mean Hausdorff distance",
        "lower",
        "m",
        lambda t: t.hausdorff.mean,
        symbol="H",
        meaning="mean over pairs of the largest distance of a vertex from the other outline",
        source="Hausdorff distance at vertices",
    )
    iou: float | None = index(
        "mean boundary IoU",
        "higher",
        "fraction",
        lambda t: ratio(t.sums.boundary_iou, t.counts.true_positives),
        symbol="B_IoU",
        meaning="mean over pairs of the IoU of the inner bands of the outlines",
        source="Cheng et al. 2021, band in metres",
    )


def _scene_c_iou(t: _Tallies) -> float | None:
    iou = ratio(t.scene.mask_shared, t.scene.mask_united)
    corners = t.scene.detected_corners, t.scene.reference_corners
    if iou is None:
        return None
    return iou * (1 - abs(corners[0] - corners[1]) / sum(corners))


@dataclass(frozen=True, kw_only=True)
class ComplexityIndices(IndexGroup):
    """Numbers of corners beside the shared area; None where undefined."""

    key = "complexity"
    title = "corners"

    c_iou: float | None = index(
        "C-IoU of pairs",
        "higher",
        "fraction",
        lambda t: ratio(t.sums.c_iou, t.counts.true_positives),
        symbol="C_IoU",
        meaning="mean over pairs of IoU (1 - |Nd - Nr|/(Nd + Nr)), N: corners",
        source=_ZORZI,
    )
    c_iou_scene: float | None = index(
        "C-IoU of the scene",
        "higher",
        "fraction",
        _scene_c_iou,
        symbol="C_IoU_s",
        meaning="IoU of both masks times (1 - |Nd - Nr|/(Nd + Nr)) with N summed over all footprints",
        source=_ZORZI,
    )
    n_ratio: float | None = index(
        "N-ratio",
        "neither",
        "ratio",
        lambda t: ratio(t.scene.detected_corners, t.scene.reference_corners),
        symbol="N_ratio",
        meaning="corners of all detections / corners of all references",
        source=_ZORZI,
    )
    n_ratio_mean: float | None = index(
        "mean N-ratio",
        "neither",
        "ratio",
        lambda t: ratio(t.scene.n_ratios, t.scene.scenes_with_corners),
        symbol="N_ratio_m",
        meaning="mean over scenes of the N-ratio",
        source=_ZORZI,
    )
    s_iou: float | None = index(
        "S-IoU of pairs",
        "higher",
        "fraction",
        lambda t: ratio(t.sums.s_iou, t.counts.true_positives),
        symbol="S_IoU",
        meaning="mean over pairs of IoU times a factor that falls with the corners of the detection; below 1 for "
        "more than three corners",
        source="formula in docs/reference/evaluators.md",
    )


@dataclass(frozen=True, kw_only=True)
class CornerIndices(IndexGroup):
    """Corners of pairs, matched one to one within the corner radius; None where undefined."""

    key = "corner"
    title = "corner errors"

    distance: float | None = index(
        "corner error",
        "lower",
        "m",
        lambda t: ratio(t.corners.distance, t.corners.matched),
        symbol="CE",
        meaning="mean distance of matched corners",
        source=_NAUATA,
    )
    completeness: float | None = index(
        "corner completeness",
        "higher",
        "fraction",
        lambda t: ratio(t.corners.matched, t.corners.reference),
        symbol="C_c",
        meaning="matched corners / corners of the references of pairs (recall)",
        source=_NAUATA,
    )
    correctness: float | None = index(
        "corner correctness",
        "higher",
        "fraction",
        lambda t: ratio(t.corners.matched, t.corners.detected),
        symbol="K_c",
        meaning="matched corners / corners of the detections of pairs (precision)",
        source=_NAUATA,
    )


@dataclass(frozen=True, kw_only=True)
class RegularityIndices(IndexGroup):
    """Directions of edges; None without a pair."""

    key = "regularity"
    title = "directions"

    edge_angle_error: float | None = index(
        "largest edge angle error",
        "lower",
        "deg",
        lambda t: ratio(t.sums.edge_angle_error, t.counts.true_positives),
        symbol="LEAE",
        meaning="mean over pairs of the largest angle of an edge of the detection to the nearest direction of the "
        "reference",
    )
    turning_distance: float | None = index(
        "turning function distance",
        "lower",
        "rad",
        lambda t: ratio(t.corners.turning_distance, t.corners.pairs),
        symbol="TFD",
        meaning="mean over pairs of the least root mean square difference of the directions along both outlines, over "
        "all starting points and rotations",
        source="Arkin et al. 1991, d_2",
    )
    orthogonality: float | None = index(
        "orthogonality",
        "neither",
        "fraction",
        lambda t: ratio(t.sums.orthogonality, t.counts.true_positives),
        symbol="Orth",
        meaning="mean over pairs of the share of edges of the detection within 5 degrees of its minimum rectangle",
    )


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Matched pairs (rows of both sides) and what is measured of them, by key."""

    detections: NDArray[np.int64]
    references: NDArray[np.int64]
    values: dict[str, NDArray[np.float64]]
    corners: _Corners


@dataclass(frozen=True, kw_only=True)
class Boundary(Evaluator):
    """Outline distances and shapes of matched footprints: PoLiS, Hausdorff, boundary IoU, C-IoU, S-IoU."""

    name: ClassVar[str] = "boundary"
    paper = "Avbelj, Müller & Bamler 2015, doi:10.1109/LGRS.2014.2330695; further ones at the indices"
    groups = (BoundaryIndices, ComplexityIndices, CornerIndices, RegularityIndices)
    tallies_type = _Tallies
    ranked_by: ClassVar[str] = "boundary.iou"
    gated_by: ClassVar[tuple[str, ...]] = ("boundary.polis", "boundary.iou", "complexity.c_iou")
    swept_by: ClassVar[tuple[str, ...]] = ("boundary.iou", "boundary.polis")
    verdict_kinds = coverage_kinds(
        correct=("pair", "matched detection"),
        excess=("unmatched", "detection without a pair"),
        missing=("missed", "reference without a pair"),
    )
    measures = (
        Measure(key="polis", title="PoLiS", unit="m"),
        Measure(key="hausdorff", title="Hausdorff distance", unit="m"),
        Measure(key="boundary_iou", title="boundary IoU", unit="fraction"),
        Measure(key="c_iou", title="C-IoU", unit="fraction"),
        Measure(key="s_iou", title="S-IoU", unit="fraction"),
        Measure(key="corner_error", title="corner error", unit="m"),
        Measure(key="edge_angle_error", title="largest edge angle error", unit="deg"),
        Measure(key="turning_distance", title="turning function distance", unit="rad"),
        Measure(key="orthogonality", title="orthogonality", unit="fraction"),
    )
    curves = (
        Curve(
            key="polis",
            title="PoLiS of pairs",
            x="PoLiS",
            y="number of pairs",
            x_unit="m",
            y_unit="count",
            formula=lambda t: (t.polis.edges, t.polis.counts.astype(np.float64)),
            meaning="pairs in bins of 5 cm; from 5 m on in the last bin",
            source=_POLIS,
            bars=True,
        ),
    )

    band: float = parameter(1.0, unit="m", minimum=0.01, doc="width of the inner band of the boundary IoU")
    corner_radius: float = parameter(1.0, unit="m", minimum=0.0, doc="largest distance of matched corners")
    matching: Literal["nearest", "one-pass", "overlap"] = parameter(
        "nearest", choices=MATCHINGS, doc="how partners are chosen", source="2010 paper, 4.1"
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
    ) -> Evaluation:
        """Compare two sets; see `Evaluator.evaluate`."""
        if len(detected) and len(reference):
            common_crs(detected.crs, reference.crs, (detected.source, reference.source))
        if area is not None:
            shapely.prepare(area)
        graph = object_graph(detected, reference, matching=self.matching, area=area, minimum_area=self.minimum_area)
        pairs = self._measured(graph)
        r_count = int(graph.references.mask.sum())
        sums = {name: float(pairs.values[name].sum()) for name in _Sums().to_dict()}
        tallies = _Tallies(
            counts=_Counts(
                detected=int(graph.detections.mask.sum()),
                reference=r_count,
                true_positives=len(pairs.detections),
                false_negatives=r_count - len(pairs.detections),
            ),
            sums=_Sums(**sums),
            corners=pairs.corners,
            scene=_scene(graph),
            left_out=LeftOut.of(graph.detections, graph.references),
            polis=_METRES().filled(pairs.values["polis"]),
            hausdorff=_METRES().filled(pairs.values["hausdorff"]),
        )
        return self.summarise(
            tallies,
            list(input_notes(detected, reference, graph.within[1])),
            find_verdicts=lambda: self._verdicts(graph, pairs),
        )

    def notes_of(self, tallies: Any) -> Sequence[str]:
        """Return how many objects were left out."""
        return tuple(left_out_notes(tallies.left_out))

    def _measured(self, graph: ObjectGraph) -> _Pairs:
        rows = graph.correspondence.pairs
        d, r = graph.detected.polygons[rows[0]], graph.reference.polygons[rows[1]]
        corners = pair_shapes.corner_counts(d).astype(np.float64), pair_shapes.corner_counts(r).astype(np.float64)
        matched = match_corners(d, r, self.corner_radius)
        turning = turning_distances(d, r)
        with np.errstate(invalid="ignore"):
            corner_error = matched.distances / matched.counts
        return _Pairs(
            *rows,
            {
                "polis": pair_distances(graph.detected, graph.reference, rows).polis,
                "hausdorff": pair_shapes.hausdorff_distances(d, r),
                "boundary_iou": pair_shapes.boundary_iou(d, r, self.band),
                "c_iou": graph.pair_iou * pair_shapes.complexity_factor(*corners),
                "s_iou": graph.pair_iou * pair_shapes.simplicity_factor(corners[0]),
                "corner_error": corner_error,
                "edge_angle_error": pair_shapes.largest_edge_angle_error(d, r),
                "turning_distance": turning,
                "orthogonality": pair_shapes.orthogonal_edges(d),
            },
            _Corners(
                pairs=len(d),
                turning_distance=float(turning.sum()),
                detected=int(corners[0].sum()),
                reference=int(corners[1].sum()),
                matched=int(matched.counts.sum()),
                distance=float(matched.distances.sum()),
            ),
        )

    def _verdicts(self, graph: ObjectGraph, pairs: _Pairs) -> Verdicts:
        sets = CountedSets(
            detected=graph.detected,
            reference=graph.reference,
            detections=graph.detections,
            references=graph.references,
            overlaps=graph.overlaps,
        )
        match = graph.correspondence
        sides = []
        for rows, partner in ((pairs.detections, match.of_detection), (pairs.references, match.of_reference)):
            measures = {name: np.full(len(partner), np.nan) for name in pairs.values}
            for name, column in measures.items():
                column[rows] = pairs.values[name]
            polis = measures["polis"].tolist()
            reasons = ["no pair" if value != value else f"outline {value:.2f} m apart" for value in polis]
            sides.append(SideVerdicts(partner >= 0, reasons, measures, partner))
        return coverage_verdicts(sets, self.verdict_kinds, self.measures, detections=sides[0], references=sides[1])


def _scene(graph: ObjectGraph) -> _Scene:
    d, r = graph.detections.mask, graph.references.mask
    corners = [
        int(pair_shapes.corner_counts(footprints.polygons[mask]).sum())
        for footprints, mask in ((graph.detected, d), (graph.reference, r))
    ]
    one, two, both = mask_areas(graph.detected, graph.reference, graph.overlaps, graph.within, (d, r))
    return _Scene(
        scenes_with_corners=int(corners[1] > 0),
        n_ratios=corners[0] / corners[1] if corners[1] else 0.0,
        detected_corners=corners[0],
        reference_corners=corners[1],
        mask_shared=max(one + two - both, 0.0),
        mask_united=both,
    )
