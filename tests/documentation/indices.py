"""The page of all indices: formula, drawing and worked example of each, from the declarations of the evaluators.

An *example* is a drawing of a few rectangles with a text in which the tallies are filled in. Its value is that of the
evaluator, so that page and code cannot disagree.
"""

from __future__ import annotations

from dataclasses import dataclass

import shapely
from shapely import Geometry, box

import roofbench as rb
from roofbench.evaluators.registry import EVALUATORS, make_evaluator
from roofbench.reports.format import value_text

__all__ = ["drawings", "page"]

CRS = "EPSG:25832"
_COLOURS = {"TP": "#009e73", "MD": "#e69f00", "FP": "#d55e00"}
_SCALE, _RIM = 11, 1.5
_BETTER = {"higher": "higher is better", "lower": "lower is better", "neither": "neither direction is better"}


@dataclass(frozen=True)
class Example:
    """Reference and detected outlines, and the worked example with tallies in braces."""

    name: str
    reference: tuple[Geometry, ...]
    detected: tuple[Geometry, ...]
    worked: str

    @property
    def evaluation(self) -> rb.Evaluation:
        return rb.evaluate(rb.Footprints.of(self.detected, crs=CRS), rb.Footprints.of(self.reference, crs=CRS))


HOUSE = box(0, 0, 10, 8)


def _at(x: float, y: float = 0, *, width: float = 10, height: float = 8) -> Geometry:
    return box(x, y, x + width, y + height)


_AREAS = ((_at(0, height=10),), (box(2, 0, 14, 10),))

#: By the key of the index.
EXAMPLES = {
    "object.completeness": Example(
        "completeness", (_at(0), _at(14), _at(28)), (_at(0.5), _at(14.5)), "TP = {TP}, FN = {FN}: {TP} / ({TP} + {FN})"
    ),
    "object.correctness": Example(
        "correctness", (_at(0), _at(14)), (_at(0.5), _at(14.5), _at(28)), "TP = {TP}, FP = {FP}: {TP} / ({TP} + {FP})"
    ),
    "object.quality": Example(
        "quality",
        (_at(0), _at(14), _at(28)),
        (_at(0.5), _at(14.5), _at(42)),
        "TP = {TP}, FP = {FP}, FN = {FN}: {TP} / ({TP} + {FP} + {FN})",
    ),
    "object.multiple_detection_rate": Example(
        "multiple-detections",
        (_at(0, width=14), _at(18)),
        (_at(0, width=8), _at(8.5, width=5.5), _at(18.5)),
        "the reference on the left is split: MD = {MD} of {D} detections: {MD} / {D}",
    ),
    "object.detection_overlap_rate": Example(
        "detection-overlap",
        (_at(0), _at(14), _at(28)),
        (_at(0, width=13), _at(12, width=12), _at(28.5)),
        "O_d = {O_d} of {D} detections overlap another one: {O_d} / {D}",
    ),
    "object.detection_cross_lap_rate": Example(
        "detection-cross-lap",
        (_at(0), _at(11), _at(26)),
        (_at(0, width=21), _at(26.5)),
        "the detection on the left covers two buildings: C_ld = {C_ld} of {D} detections: {C_ld} / {D}",
    ),
    "object.reference_cross_lap_rate": Example(
        "reference-cross-lap",
        (_at(0, width=14), _at(18)),
        (_at(0, width=6), _at(7, width=7), _at(18.5)),
        "two detections cover the reference on the left: C_lr = {C_lr} of {R} references: {C_lr} / {R}",
    ),
    "pixel.completeness": Example("areas", *_AREAS, "T = {T} m², M = {M} m²: {T} / ({T} + {M})"),
    "pixel.correctness": Example("areas", *_AREAS, "T = {T} m², F = {F} m²: {T} / ({T} + {F})"),
    "pixel.quality": Example("areas", *_AREAS, "T = {T} m², F = {F} m², M = {M} m²: {T} / ({T} + {F} + {M})"),
    "pixel.area_omission_error": Example("areas", *_AREAS, "M = {M} m², T = {T} m²: {M} / ({T} + {M})"),
    "pixel.area_commission_error": Example("areas", *_AREAS, "F = {F} m², T = {T} m²: {F} / ({T} + {F})"),
    "pixel.branching_factor": Example("areas", *_AREAS, "F = {F} m², T = {T} m²: {F} / {T}"),
    "pixel.miss_factor": Example("areas", *_AREAS, "M = {M} m², T = {T} m²: {M} / {T}"),
    "geometric.rmse": Example(
        "rmse",
        (_at(0),),
        (_at(0.6, 0.8),),
        "each of the four corners is off by √(0.6² + 0.8²) m; their root mean square is the same",
    ),
}
#: A village in which every kind of error occurs, for the variants and the other systems.
VILLAGE = Example(
    "village",
    (_at(0), _at(14), _at(28, width=14), _at(46), _at(57), _at(72)),
    (_at(0.5), _at(15, 0.6), _at(28, width=7), _at(36, width=6), _at(46, width=21), _at(86)),
    "",
)


def _tallies(evaluation: rb.Evaluation) -> dict[str, str]:
    counts, areas = evaluation.tallies.counts, evaluation.tallies.areas
    values = {
        **{"TP": counts.true_positives, "FP": counts.false_positives, "FN": counts.false_negatives},
        **{"MD": counts.multiple_detections, "D": counts.detected, "R": counts.reference},
        **{"O_d": counts.overlapping_detections, "C_ld": counts.cross_lapping_detections},
        "C_lr": counts.cross_lapped_references,
        **{"T": areas.true_positive, "F": areas.false_positive, "M": areas.false_negative},
    }
    return {name: f"{value:g}" for name, value in values.items()}


def drawing(example: Example) -> str:
    """Return an example as SVG: references outlined, missed ones hatched, detections filled, labelled by verdict."""
    xmin, ymin, xmax, ymax = shapely.total_bounds([*example.reference, *example.detected])
    width, height = (xmax - xmin + 2 * _RIM) * _SCALE, (ymax - ymin + 2 * _RIM) * _SCALE
    verdicts = example.evaluation.verdicts
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" '
        f'height="{height:.0f}" font-family="sans-serif" font-size="13" text-anchor="middle">',
        '<rect width="100%" height="100%" fill="#fff"/>',
        '<pattern id="missed" width="8" height="8" patternUnits="userSpaceOnUse" patternTransform="rotate(45)">'
        '<rect width="8" height="8" fill="#fff"/><rect width="3" height="8" fill="#56b4e9"/></pattern>',
    ]

    def shape(outline: Geometry, style: str) -> str:
        left, low, right, high = outline.bounds
        return (
            f'<rect x="{(left - xmin + _RIM) * _SCALE:.1f}" y="{(ymax - high + _RIM) * _SCALE:.1f}" '
            f'width="{(right - left) * _SCALE:.1f}" height="{(high - low) * _SCALE:.1f}" {style}/>'
        )

    def label(outline: Geometry, text: str) -> str:
        x, y = outline.centroid.coords[0]
        return (
            f'<text x="{(x - xmin + _RIM) * _SCALE:.1f}" y="{(ymax - y + _RIM) * _SCALE + 5:.1f}" stroke="#fff" '
            f'stroke-width="3" paint-order="stroke">{text}</text>'
        )

    missed = [
        outline
        for outline, kind in zip(example.reference, verdicts.reference_table.verdicts, strict=True)
        if kind == "FN"
    ]
    kinds = verdicts.detection_table.verdicts.tolist()
    parts += [shape(outline, 'fill="url(#missed)"') for outline in missed]
    parts += [
        shape(outline, f'fill="{_COLOURS[kind]}" fill-opacity="0.55"')
        for outline, kind in zip(example.detected, kinds, strict=True)
    ]
    parts += [shape(outline, 'fill="none" stroke="#000" stroke-width="2"') for outline in example.reference]
    covered = shapely.union_all(example.detected)
    parts += [label(outline, "FN") for outline in missed if not covered.covers(outline.centroid)]
    parts += [label(outline, kind) for outline, kind in zip(example.detected, kinds, strict=True)]
    return "\n".join([*parts, "</svg>", ""])


def drawings() -> dict[str, str]:
    """Return the SVG of every drawing by its file name."""
    return {f"index-{example.name}.svg": drawing(example) for example in (*EXAMPLES.values(), VILLAGE)}


def _picture(example: Example, text: str) -> str:
    return f"![{text}](../images/index-{example.name}.svg)"


def _entry(index: rb.Index) -> list[str]:
    example = EXAMPLES[index.key]
    evaluation = example.evaluation
    worked = example.worked.format(**_tallies(evaluation))
    return [
        f"### {index.title}, {index.symbol}" if index.symbol != index.title else f"### {index.title}",
        f"`{index.key}` · {index.meaning} · {_BETTER[index.better]} · {index.source}",
        _picture(example, f"Drawing of the example of {index.title}"),
        f"Example: {worked} = **{value_text(evaluation.values[index.key], index.unit)}**",
    ]


def _table(name: str, *, main: bool | None = None) -> list[str]:
    evaluator = make_evaluator(name)
    reference, detected = (rb.Footprints.of(side, crs=CRS) for side in (VILLAGE.reference, VILLAGE.detected))
    values = evaluator.evaluate(detected, reference).values
    rows = [
        f"| {index.title} | {index.symbol} | `{index.key}` | {index.meaning} | {_BETTER[index.better].split()[0]} "
        f"| {value_text(values[index.key], index.unit)} |".replace("|D|", "\\|D\\|")
        for index in evaluator.indices
        if main is None or index.main is main
    ]
    return ["\n".join(["| index | symbol | key | meaning | better | village |", "|---|---|---|---|---|--:|", *rows])]


def page() -> str:
    """Return the page in Markdown."""
    default = make_evaluator("threshold-free")
    parts = [
        "# All indices",
        "<!-- Written by python -m tests.documentation.reference from the declarations of the evaluators. -->",
        "Black outlines are references, filled shapes are detections: true positives (TP) green, multiple detections "
        "(MD) yellow, false positives (FP) orange; missed references (FN) are hatched. D and R are the numbers of "
        "detections and references that count. All values on this page are computed by roofbench.",
        "How detections and references are matched is described in [the evaluation](evaluation.md), what a good value "
        "is in [which index to read](../guide/which-index.md).",
        "## The 15 indices of 2010",
    ]
    for index in default.indices:
        if index.main:
            parts += _entry(index)
    parts += [
        "## The village",
        "Six references and six detections, with every kind of error: a shift, a reference that is split into two "
        "detections, two references that one detection merges, a missed building and a false alarm. The last column of "
        "the tables below is the value of each index in this village; – is undefined or needs an orthoimage.",
        _picture(VILLAGE, "Drawing of the village"),
        "## Variants of the threshold-free evaluation",
        *_table("threshold-free", main=False),
    ]
    for name in EVALUATORS.names():
        if name != "threshold-free":
            evaluator = make_evaluator(name)
            sources = sorted({index.source for index in evaluator.indices})
            parts += [
                f"## {name}",
                f"{evaluator.description()} Sources: {'; '.join(sources)}.",
                *_table(name),
            ]
    return "\n\n".join(parts) + "\n"
