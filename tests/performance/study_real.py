"""Where detectors lose on real scenes: the tables and figures of docs/results/real-scenes.md.

Run by hand: ``python tests/performance/study_real.py causes --folders delft,ign -d mpp -d ndsm`` and the same with
``displaced``, ``ablation``, ``leave-one-out`` or ``pictures``; ``stored --store FILE`` reads a store. Folders
are scenes with a reference, as `roofbench scenes import` writes them. Detectors see the points without classes and
without a DEM (it may have been made from the classes), so that the ground comes from the ground filter; the image
stays.

Columns: Q_l object quality, Q_lp pixel quality (threshold-free evaluator, nearest matching, exact areas), agreement
(area that all footprints have in common with all of the reference over that of both together), and the percent points
of pixel quality that each cause costs (`loss_by_cause`).
"""

from __future__ import annotations

import argparse
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shapely

import roofbench as rb
from roofbench.benchmark.analysis.report_contents import newest_runs
from roofbench.benchmark.store.writer import Store
from roofbench.core.errors import MissingInputError
from roofbench.detectors.mpp import (
    background,
    bends,
    block_cells,
    image_cue,
    mpp_detector,
    party_walls,
    preparation,
    raised_walls,
    rows,
    runs,
    shears,
)
from roofbench.detectors.registry import make_detector
from roofbench.detectors.shared import cue_information
from roofbench.evaluators.threshold_free.causes import CAUSES, loss_by_cause
from roofbench.scenes.geodata.vector_files import read_footprints

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"

#: The chosen numbers: where they live, what disables the rule (None: cannot be disabled), and the values that the
#: leave-one-out choice may take.
THRESHOLDS = {
    "low points, share of the least height": (preparation, "_LOW_SHARE", 0.9, (0.6, 0.7, 0.8, 0.9)),
    "rise of a crown above its roofs, cm": (block_cells, "_CROWN_RISE", 100_000, (100, 200, 250, 300, 100_000)),
    "share of the openness of crowns": (block_cells, "_AS_OPEN", 99.0, (0.5, 0.65, 0.75, 0.85, 99.0)),
    "step between a roof and its rim, cm": (block_cells, "_RIM_STEP", -100_000, (-100_000, 30, 50, 100)),
    "width of gaps, m": (block_cells, "_NARROW", 0.01, (0.01, 3.0, 4.0, 5.0, 6.0)),
    "radius of the opening, m": (block_cells, "_OPENING", None, (0.5, 1.0, 1.5)),
    "probable walls of one part that are certain": (rows, "_MANY", 1000, (4, 5, 6, 7, 1000)),
    "shortest row, m": (rows, "_SHORTEST", 0.0, (0.0, 20.0, 22.5, 25.0, 30.0)),
    "certain party walls of a row": (rows, "_CERTAIN_WALLS", 1000, (2, 3, 4, 1000)),
    "certain party walls of a long row": (rows, "_WALLS_OF_LONG", 1000, (2, 3, 1000)),
    "certain party walls of one part of a row": (rows, "_REPEATED", 0, (0, 2, 3, 4)),
    "rise of a chimney, m": (raised_walls, "_CHIMNEY", 1000, (0.4, 0.6, 0.8, 1.0, 1000)),
    "chimneys of a series": (raised_walls, "_FEWEST", 1000, (2, 3, 4, 1000)),
    "share of the chimneys in a series": (raised_walls, "_MOST", None, (0.5, 0.6, 0.75, 0.9)),
    "standard deviations of a parapet": (raised_walls, "_BEYOND", 1000, (1.5, 2.0, 2.5, 3.0, 1000)),
    "least change of direction, degrees": (bends, "_LEAST", 90, (3, 5, 8, 90)),
    "agreement along a shear, times that without": (shears, "_CLEARLY", 1000, (1.0, 1.1, 1.2, 1.5, 1000)),
    "strength of oblique walls, times that of others": (party_walls, "_SHARPER", 1000, (1.0, 1.2, 1.5, 1000)),
    "common depth of the houses of a run": (runs, "_ALIKE", 1000, (0.5, 0.7, 0.9, 1000)),
}  # fmt: skip

#: Numbers that cells, their scores or boxes depend on.
OF_PREPARATION = (
    (preparation, "_LOW_SHARE"),
    (background, "_WITHOUT_OPENNESS"),
    (image_cue, "_WEIGHT"),
    (cue_information, "_LEAST_SEPARATION"),
)

#: Copies of a scene: metres east and north, and share of the points.
COPIES = (
    *((0.0, 0.0, 1.0), (37.3, 0.0, 1.0), (0.0, 37.3, 1.0), (64.2, 64.1, 1.0), (91.7, 20.6, 1.0)),
    *((0.0, 0.0, 0.5), (37.3, 64.3, 0.5), (0.0, 0.0, 0.3)),
)


@dataclass(frozen=True)
class Outcome:
    """One run: object and pixel quality, agreement, and points lost by each cause, percent."""

    object: float
    pixel: float
    agreement: float
    causes: tuple[float, ...]

    @property
    def numbers(self):
        return (self.object, self.pixel, self.agreement, *self.causes)


def blind(scene):
    """Return a scene as a detector sees one of which nobody has classified the points."""
    return rb.Scene(
        scene.name,
        scene.extent,
        crs=scene.crs,
        points=scene.points.unclassified(),
        image=scene.image,
        reference=scene.reference,
        area=scene.area,
    )


def opened(folders):
    return {Path(folder).name: blind(rb.open_scene(folder)) for folder in folders}


def scored(found, scene):
    evaluation = rb.evaluate(found, scene.reference, area=scene.area)
    areas = evaluation.tallies.areas
    lost = loss_by_cause(evaluation.graph, area=scene.area)
    points = lost.points(areas.true_positive + areas.false_positive + areas.false_negative)
    return Outcome(
        100 * (evaluation.object.quality or 0),
        100 * (evaluation.pixel.quality or 0),
        100 * agreement(found, scene),
        tuple(value or 0.0 for value in points.values()),
    )


def agreement(found, scene):
    detected, reference = (shapely.union_all(footprints.polygons) for footprints in (found, scene.reference))
    if scene.area is not None:
        detected, reference = shapely.intersection([detected, reference], scene.area)
    united = detected.union(reference).area
    return detected.intersection(reference).area / united if united else 0.0


def run(detector, scenes, seeds):
    """Return the mean over seeds, one if it draws no random number, for each scene on which the detector runs.

    A folder (a name with a slash) in place of a detector holds footprints of another version, SCENE-SEED.gpkg.
    """
    found = {}
    for name, scene in scenes.items():
        try:
            if "/" in detector:
                sets = [read_footprints(file) for file in sorted(Path(detector).glob(f"{name}-[0-9].gpkg"))]
            else:
                many = seeds if make_detector(detector).stochastic else 1
                sets = [rb.detect(scene, detector, seed=seed) for seed in range(many)]
            outcomes = [scored(footprints, scene).numbers for footprints in sets]
        except MissingInputError as error:
            print(f"<!-- {detector} on {name}: {error} -->")
            continue
        mean = np.mean(outcomes, axis=0)
        found[name] = Outcome(*mean[:3], tuple(mean[3:]))
    return found


def causes(options):
    """Print a row a scene and detector, and the mean of each detector."""
    scenes = opened(options.folders)
    table_head()
    for detector in options.detectors:
        table_rows(detector, run(detector, scenes, options.seeds))


def stored(options):
    """Print the same of the newest runs of a results store, so that all rows are of one command."""
    table_head()
    with Store(Path(options.store), must_exist=True) as store:
        found = {}
        for row in newest_runs(store):
            if row.status == "ok":
                outcome = scored(store.detections(row.id), store.scene(row.scene_id))
                found.setdefault(row.label, {})[row.scene] = outcome
    for label, outcomes in found.items():
        table_rows(label, outcomes)


def table_head():
    names = [cause.replace("_", " ") for cause in CAUSES]
    print(
        f"\n| detector | scene | Q_l | Q_lp | agreement | {' | '.join(names)} |\n|---|---|{'--:|' * (3 + len(names))}"
    )


def table_rows(detector, found):
    for name, outcome in found.items():
        print(f"| `{detector}` | {name} | " + " | ".join(f"{v:.1f}" for v in outcome.numbers) + " |", flush=True)
    if found:
        mean = np.mean([outcome.numbers for outcome in found.values()], axis=0)
        print(f"| `{detector}` | **mean** | " + " | ".join(f"**{v:.1f}**" for v in mean) + " |", flush=True)


@contextmanager
def set_to(module, name, value):
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)


@contextmanager
def remembered():
    """Search each scene once for all thresholds that only outlines depend on; the ground is filtered once, too."""
    results = {}

    def keep(name, function, key):
        def wrapped(*arguments):
            place = (name, *key(arguments), *(getattr(module, value) for module, value in OF_PREPARATION))
            if place not in results:
                results[place] = function(*arguments)
            return results[place]

        return wrapped

    def cloud_of(given):
        return given[2].extent, len(given[1]), float(given[1].z[:1000].sum())

    prepared = keep("prepare", mpp_detector.prepare, lambda given: (*cloud_of(given), given[0]))
    searched = keep("find", mpp_detector.find_rectangles, lambda given: (id(given[1]), given[2]))
    with set_to(mpp_detector, "prepare", prepared), set_to(mpp_detector, "find_rectangles", searched):
        yield


def ablation(options):
    """Print what each rule contributes: the change without it, object and pixel quality by scene."""
    scenes = opened(options.folders)
    detector = options.detectors[0]
    base = run(detector, scenes, options.seeds)
    head = " | ".join(f"{name} Q_l | Q_lp" for name in base)
    print(f"\n| without | {head} | mean Q_l | Q_lp |\n|---|{'--:|' * (2 * len(base) + 2)}")
    row("as it is", [(o.object, o.pixel) for o in base.values()], "{:.1f}")
    for label, (module, name, off, _) in THRESHOLDS.items():
        if off is None:
            continue
        with set_to(module, name, off):
            found = run(detector, scenes, options.seeds)
        changes = [(found[s].object - o.object, found[s].pixel - o.pixel) for s, o in base.items()]
        row(f"{label} ({name} = {off})", changes, "{:+.1f}")


def row(label, pairs, form):
    pairs = [*pairs, tuple(np.mean(pairs, axis=0))]
    print(f"| {label} | " + " | ".join(form.format(value) for pair in pairs for value in pair) + " |", flush=True)


def leave_one_out(options):
    """Choose each threshold on all scenes but one, by the mean of both qualities, and score it on that one."""
    scenes = opened(options.folders)
    detector = options.detectors[0]
    print(
        "\n| threshold | now | chosen without each scene | Q_l, Q_lp now | Q_l, Q_lp left out |\n|---|--:|---|---|---|"
    )
    for label, (module, name, _, values) in THRESHOLDS.items():
        now = getattr(module, name)
        found = {}
        for value in dict.fromkeys((now, *values)):
            with set_to(module, name, value):
                found[value] = run(detector, scenes, options.seeds)
        chosen, held = [], []
        for left_out in found[now]:
            # Of equal values the present one is kept.
            order = sorted(found, key=now.__ne__)
            merits = [merit(found[value], [left_out]) for value in order]
            best = order[int(np.argmax(merits))]
            chosen.append(best)
            held.append((found[best][left_out].object, found[best][left_out].pixel))
        present = np.mean([(o.object, o.pixel) for o in found[now].values()], axis=0)
        picks = ", ".join(f"{scene} {value:g}" for scene, value in zip(found[now], chosen, strict=True))
        ends = [", ".join(f"{v:.1f}" for v in pair) for pair in (present, np.mean(held, axis=0))]
        print(f"| {label} | {now:g} | {picks} | {ends[0]} | {ends[1]} |", flush=True)


def merit(outcomes, left_out):
    """Return the sum of both qualities over all scenes but those left out."""
    return round(sum(o.object + o.pixel for scene, o in outcomes.items() if scene not in left_out), 2)


def pictures(options):
    """Draw the two references a scene on which the footprints of ``--before`` lose most, with those of now."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from PIL import Image as Picture

    scenes = opened(options.folders)
    candidates = []
    for name, scene in scenes.items():
        before = read_footprints(Path(options.before) / f"{name}-0.gpkg")
        after = rb.detect(scene, options.detectors[0], seed=0)
        graph = rb.evaluate(before, scene.reference, area=scene.area).graph
        counted = np.flatnonzero(graph.references.mask)
        worst = sorted(counted, key=lambda k, graph=graph: -lost(graph, k))[:2]
        candidates += [(name, k, before, after) for k in worst]
    figure = Figure(figsize=(15, 6.4), layout="constrained")
    panels = figure.subplots(2, 5).ravel()
    for panel, (name, k, before, after) in zip(panels, candidates, strict=False):
        draw(panel, scenes[name], k, before, after)
        panel.set_title(name, fontsize=9)
    lines = [Line2D([], [], color=colour, linewidth=2) for colour in ("C2", "C3", "C0")]
    figure.legend(lines, ("reference", "mpp before", "mpp now"), loc="outside lower center", ncols=3, frameon=False)
    file = IMAGES / "real-scenes-worst.png"
    figure.savefig(file, dpi=80)
    with Picture.open(file) as picture:
        few = picture.convert("RGB").quantize(160, method=Picture.Quantize.MAXCOVERAGE, dither=Picture.Dither.NONE)
    few.save(file, optimize=True)


def lost(graph, k):
    """Return the area that reference k costs: what its match lacks and has too much, or all of it."""
    reference = graph.reference.polygons[k]
    match = graph.correspondence.of_reference[k]
    return reference.area if match < 0 else reference.symmetric_difference(graph.detected.polygons[match]).area


def draw(panel, scene, k, before, after, margin=6.0, cell=0.5):
    west, south, east, north = scene.reference.polygons[k].bounds
    size = max(east - west, north - south) / 2 + margin
    x0, y0 = (west + east) / 2 - size, (south + north) / 2 - size
    points = scene.points
    column, line = ((points.x - x0) / cell).astype(int), ((points.y - y0) / cell).astype(int)
    side = int(2 * size / cell) + 1
    inside = (points.x >= x0) & (points.y >= y0) & (column < side) & (line < side)
    height = points.z[inside] - scene.heights.ground.sample(points.x[inside], points.y[inside])
    top = np.full((side, side), np.nan)
    np.fmax.at(top, (line[inside], column[inside]), height)
    panel.imshow(top, origin="lower", extent=(x0, x0 + side * cell, y0, y0 + side * cell), cmap="Greys", vmin=0,
                 vmax=max(np.nanquantile(top, 0.95), 4))  # fmt: skip
    for footprints, colour, width in ((scene.reference, "C2", 2.5), (before, "C3", 1.2), (after, "C0", 1.6)):
        for polygon in shapely.get_parts(footprints.polygons):
            for ring in (polygon.exterior, *polygon.interiors):
                panel.plot(*ring.xy, color=colour, linewidth=width)
    panel.set(xlim=(x0, x0 + 2 * size), ylim=(y0, y0 + 2 * size), xticks=[], yticks=[])


def displaced(options):
    """Print the qualities of each scene as it is, and the mean with its moved and thinned copies."""
    print("\n| detector | scene | as it is | mean of copies |\n|---|---|--:|--:|")
    for detector in options.detectors:
        for name, scene in opened(options.folders).items():
            copies = {str(copy): moved(scene, *copy) for copy in COPIES}
            outcomes = list(run(detector, copies, options.seeds).values())
            mean = np.mean([(outcome.object, outcome.pixel) for outcome in outcomes], axis=0)
            first = f"{outcomes[0].object:.1f} / {outcomes[0].pixel:.1f}"
            print(f"| `{detector}` | {name} | {first} | {mean[0]:.1f} / {mean[1]:.1f} |", flush=True)


def moved(scene, east, north, share):
    """Return a copy of a scene elsewhere, with a share of its points; it has no image."""
    points = scene.points
    if share < 1:
        points = points.take(np.random.default_rng(0).random(len(points)) < share)
    by = np.array([east, north])
    polygons = shapely.transform(scene.reference.polygons, lambda places: places + by)
    xmin, ymin, xmax, ymax = scene.extent
    return rb.Scene(
        scene.name,
        (xmin + east, ymin + north, xmax + east, ymax + north),
        crs=scene.crs,
        points=replace(points, x=points.x + east, y=points.y + north),
        reference=rb.Footprints.of(polygons, crs=scene.crs),
        area=None if scene.area is None else shapely.transform(scene.area, lambda places: places + by),
    )


STUDIES = {
    "causes": causes,
    "stored": stored,
    "displaced": displaced,
    "ablation": ablation,
    "leave-one-out": leave_one_out,
    "pictures": pictures,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=tuple(STUDIES))
    parser.add_argument("--folders", default=[], type=lambda text: text.split(","), help="scene folders, by commas")
    parser.add_argument("-d", dest="detectors", action="append", help="detector [mpp]")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--before", help="folder with the footprints SCENE-0.gpkg of another version")
    parser.add_argument("--store", help="results store of `roofbench run` on the folders, for stored")
    options = parser.parse_args()
    options.detectors = options.detectors or ["mpp"]
    with remembered() if options.study in ("ablation", "leave-one-out") else nullcontext():
        STUDIES[options.study](options)


if __name__ == "__main__":
    main()
