"""A small report made by hand: two scenes, two detectors, every kind of verdict."""

import shapely

import roofbench as rb
from roofbench.benchmark.analysis.break_down import BreakDown
from roofbench.benchmark.analysis.published import PUBLISHED, Comparison, OursRow
from roofbench.benchmark.analysis.report_data import (
    CostPoint,
    Error,
    Overlay,
    Provenance,
    Report,
    SceneView,
    Sensitivity,
    SensitivityPoint,
    SizeBin,
    SizeCurve,
)
from roofbench.benchmark.analysis.results import Cell, Entry, Leaderboard
from roofbench.benchmark.execution.scene_picture import scene_picture
from roofbench.evaluators.threshold_free.evaluator import ThresholdFree
from roofbench.scenes.builtin import hamlet

MAIN = tuple(index for index in ThresholdFree.indices if index.main)
QUALITY = next(index for index in MAIN if index.key == "object.quality")


BROKEN = BreakDown(detector="d", axis="scene.slope", index=QUALITY, level=0.8, value=1.0)


def overlay(label, detected, reference, run):
    return Overlay(label=label, run=run, seed=0, verdicts=rb.evaluate(detected, reference).verdicts)


def view(name, labels, seed):
    """The hamlet: the first detector finds all but two and invents one; the second finds half, some of them twice."""
    scene = hamlet(seed)
    reference = scene.reference
    x, y = scene.extent[0], scene.extent[1]
    places = (shapely.box(x + i, y + j, x + i + 8, y + j + 6) for i in range(2, 110) for j in range(2, 110))
    invented = next(box for box in places if shapely.distance(box, reference.polygons).min() > 2)
    moved = shapely.affinity.translate
    first = [*(moved(polygon, 0.5, 0.3) for polygon in reference.polygons[2:]), invented]
    half = reference.polygons[: len(reference) // 2]
    second = [*half, *(moved(polygon, 2.0, 0.0) for polygon in half[:2])]
    return SceneView(
        name=name,
        group="hamlet",
        extent=scene.extent,
        picture=scene_picture(scene),
        reference=reference,
        area=None,
        overlays=tuple(
            overlay(label, rb.Footprints.of(polygons, crs=reference.crs), reference, run)
            for run, (label, polygons) in enumerate(zip(labels, (first, second), strict=True), start=1)
        ),
    )


def entry(label, pooling, rank, quality):
    cells = {index.key: Cell(quality if index == QUALITY else 0.5, 2, quality - 0.1, quality + 0.1) for index in MAIN}
    return Entry(
        label=label,
        detector=label,
        parameters={},
        pooling=pooling,
        rank=rank,
        group="",
        scenes=2,
        runs=2,
        failed=0,
        skipped=0,
        detected=40,
        reference=50,
        cpu_seconds=0.5 / rank,
        peak_memory=int(2e8),
        cells=cells,
        benchmark="1",
    )


def make_report(labels=("first", "second"), scenes=("hamlet-1", "hamlet-2"), title="A report"):
    """Return a report; the names are those of detectors and scenes."""
    board = Leaderboard(
        title=title,
        evaluator="threshold-free (matching nearest)",
        rank_by=QUALITY,
        indices=MAIN,
        summary=(QUALITY,),
        entries=tuple(
            entry(label, pooling, rank, quality)
            for rank, (label, quality) in enumerate(zip(labels, (0.9, 0.5), strict=True), start=1)
            for pooling in ("pooled", "mean")
        ),
        scenes=scenes,
        by_scene={name: dict.fromkeys(labels, 0.5) for name in scenes},
        notes=(f"a note on {labels[0]}",),
    )
    views = tuple(view(name, labels, seed) for seed, name in enumerate(scenes, start=1))
    bins = (SizeBin(0, 50, 10, 4), SizeBin(50, float("inf"), 20, 19))
    means = [0.9 - 0.1 * value for value in range(4)]
    points = tuple(SensitivityPoint(value, mean, mean - 0.1, mean + 0.05, 5) for value, mean in enumerate(means))
    alarm = views[0].overlays[0].verdicts.detection_table.verdicts.tolist().index("FP")
    parts = {
        "matrix": {name: dict.fromkeys(labels, 0.5) for name in scenes},
        "scenes": views,
        "errors": (Error(scene=0, overlay=0, side="detection", position=alarm, wrong=48.0),),
        "sizes": tuple(SizeCurve(label=label, found=bins, correct=bins) for label in labels),
        "sensitivities": tuple(
            Sensitivity(detector=label, axis="scene.slope", unit="deg", index=QUALITY, points=points, break_down=BROKEN)
            for label in labels
        ),
        "costs": tuple(
            CostPoint(
                label=label,
                scene=name,
                points=1000 * place,
                hectares=1.4,
                cpu_seconds=0.1 * place,
                peak_memory=10**8,
                runs=1,
            )
            for label in labels
            for place, name in enumerate(scenes, start=1)
        ),
        "comparison": Comparison(
            MAIN,
            tuple((row, (OursRow(label="ndsm", scenes=3, values={"object.quality": 0.8}),)) for row in PUBLISHED),
        ),
    }
    return Report(
        title=title,
        boards=(board,),
        provenance=Provenance(
            facts=(("command", f"roofbench run {scenes[0]}"),), scenes=tuple((name, name, "0" * 64) for name in scenes)
        ),
        **parts,
    )
