"""The studies of docs/results/line-detectors.md: pattern of results, losses, ablation, pictures.

Run by hand: ``python tests/performance/study_lines.py STUDY [--seeds 1,2,3]``; ``--help`` names the studies.

Tables go to standard output as Markdown, pictures to docs/images. Scenes are made once and kept in the folder named by
ROOFBENCH_BENCH_SCENES (default: bench-scenes). Figures are means over scenes and seeds of the percentages of each.
"""

from __future__ import annotations

import argparse
import os
import statistics
from collections import Counter
from pathlib import Path

import numpy as np

import roofbench as rb

IMAGES = Path(__file__).parents[2] / "docs" / "images"
FAIRFIELD = ("fairfield-1", "fairfield-2", "fairfield-3")
AREAS = {"Fairfield 1-3": FAIRFIELD, "Moonee Ponds": ("moonee-ponds",), "Knox": ("knox",)}
COLUMNS = ("C_m", "C_r", "Q_l", "M_d", "D_o", "C_rd", "C_rr", "C_mp", "C_rp", "Q_lp", "RMSE m")
#: Columns of the matchings other than the nearest centre.
OTHER = ("Q_l", "M_d", "Q_lp")

ABLATIONS = {
    "original": (
        "marking=squares",
        "ground=tile-dem",
        "ground=tile-mode",
        "vegetation=pseudo-ndvi",
        "adjustment_reference=longer",
        "adjustment_reference=any",
        "adjustment_share=1",
        "missed_corner=1000",
        "curve_step=0.15",
        "extension_part=3",
        "extension_part=6",
        "extension_part=1000",
        "extension_part=1000,extension_black=0.8",
        "inside_share=0.75",
        "inside_share=1",
        "inside_margin=0",
        "rise=0",
        "colour_from=shrunk",
        "compare=whole",
        "new_share=0",
        "new_width=0",
        "same_overlap=1",
    ),
    "improved": (
        "marking=squares",
        "ground=tile-dem",
        "below_ground=1",
        "entropy=mean,entropy_threshold=0.7",
        "vegetation_side=inside",
        "adjustment=longest",
        "adjustment=neighbours",
        "adjustment=none",
        "voting=true",
        "texture=none",
        "texture=tests,entropy=mean,entropy_threshold=0.7,voting=true",
        "texture_margin=0",
        "texture=tests",
        "missed_corner=1000",
        "curve_step=0.15",
        "extension_part=3",
        "extension_part=6",
        "extension_part=1000",
        "extension_part=1000,extension_black=0.8",
        "extension_stop=0.4",
        "minimum_side=2.5",
        "inside_share=0.75",
        "inside_share=1",
        "inside_margin=0",
        "rise=0",
        "colour_from=shrunk",
        "new_share=0",
        "new_width=2",
        "same_overlap=1",
    ),
}
#: Steps that the page shows.
PICTURED = {
    "original-01-masks",
    "original-02-lines",
    "original-04-initial-rectangles",
    "original-05-final-rectangles",
    "improved-02-lines",
    "improved-05-final-rectangles",
}


def scene_of(name, seed):
    folder = Path(os.environ.get("ROOFBENCH_BENCH_SCENES", "bench-scenes"))
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}-{seed}"
    if not path.exists():
        rb.save_scene(rb.make_scene(name, seed=seed), path)
    return rb.open_scene(path)


def indices(scene, selection, reference=None):
    """Return the percentages of COLUMNS of one detector on one scene, against its reference or another."""
    found = rb.make_detector(selection).detect(scene.for_detection(), np.random.default_rng(0))
    result = rb.make_evaluator("threshold-free").evaluate(found, reference or scene.reference)
    by_object, pixel = result.object, result.pixel
    shares = (
        by_object.completeness, by_object.correctness, by_object.quality, by_object.multiple_detection_rate,
        by_object.detection_overlap_rate, by_object.detection_cross_lap_rate, by_object.reference_cross_lap_rate,
        pixel.completeness, pixel.correctness, pixel.quality,
    )  # fmt: skip
    return [None if share is None else 100 * share for share in shares] + [result.geometric.rmse]


def means(rows):
    columns = ([value for value in column if value is not None] for column in zip(*rows, strict=True))
    return [statistics.fmean(column) if column else float("nan") for column in columns]


def cells(row):
    """Return a row of COLUMNS as cells of a table: percentages to a tenth, metres to a centimetre."""
    return " | ".join([f"{share:.1f}" for share in row[:-1]] + [f"{row[-1]:.2f}"])


def pattern(seeds):
    print("| detector, area | " + " | ".join(COLUMNS) + " |")
    print("|---" * (len(COLUMNS) + 1) + "|")
    for area, names in AREAS.items():
        scenes = [scene_of(name, seed) for name in names for seed in seeds]
        for detector in ("original", "improved"):
            row = means([indices(scene, detector) for scene in scenes])
            print(f"| {detector}, {area} | {cells(row)} |", flush=True)


def ablation(seeds, detectors):
    chosen = {area: [scene_of(name, seed) for name in names for seed in seeds] for area, names in AREAS.items()}
    heads = " | ".join(f"{area} Q_l | Q_lp" for area in AREAS)
    for detector in detectors:
        print(f"| {detector} | {heads} |")
        print("|---" * (2 * len(AREAS) + 1) + "|")
        base = None
        for change in ("", *ABLATIONS[detector]):
            values = []
            for scenes in chosen.values():
                row = means([indices(scene, f"{detector}[{change}]") for scene in scenes])
                values += [row[2], row[9]]
            if base is None:
                base, text = values, [f"{value:.1f}" for value in values]
            else:
                text = [f"{value - before:+.1f}" for value, before in zip(values, base, strict=True)]
            print(f"| {f'`{change}`' if change else 'as it is'} | " + " | ".join(text) + " |", flush=True)


def loss_of(reference, trace, lines, detected):
    """Return the step that lost one reference, from what lies in it."""
    import shapely

    from roofbench.detectors.lines.trace import Outcome

    if reference.intersection(detected).area > 0.4 * reference.area:
        return "covered by another part"
    xmin, ymin, xmax, ymax = reference.bounds
    x, y = np.meshgrid(np.arange(xmin, xmax, 0.2), np.arange(ymin, ymax, 0.2))
    inside = shapely.contains_xy(reference, x, y)
    cells, on = trace.grid.cells(x[inside], y[inside])
    if not (trace.masks.primary.ravel()[cells] & on).mean() >= 0.5:
        return "mask: less than half black"
    outcomes = trace.outcomes[shapely.distance(lines, reference.exterior) < 1.2]
    if not len(outcomes):
        return "no line of 3 m"
    if (outcomes == Outcome.RECTANGLE).any():
        from roofbench.detectors.lines.boxes import box_corners

        corners = box_corners(trace.candidates[~trace.kept & ~trace.duplicates])
        lost = shapely.polygons(np.stack(trace.grid.to_world(corners[..., 1], corners[..., 0]), axis=-1))
        covers = shapely.area(shapely.intersection(lost, reference)) > 0.4 * reference.area
        return "texture" if covers.any() else "rectangle elsewhere"
    return "lines: " + Outcome(int(np.bincount(outcomes).argmax())).label


def losses(seeds):
    """Count the missed references by the step that lost them."""
    import shapely

    from roofbench.detectors.lines.boxes import box_centres

    counts, heads = [], []
    for detector in ("original", "improved"):
        for area, names in AREAS.items():
            counted, size = Counter(), 0
            for scene in (scene_of(name, seed) for name in names for seed in seeds):
                trace = rb.make_detector(detector).trace(scene.for_detection())
                found = rb.make_detector(detector).detect(scene.for_detection(), np.random.default_rng(0))
                verdicts = rb.make_evaluator("threshold-free").evaluate(found, scene.reference).verdicts.references
                middle = box_centres(trace.fitted)
                lines = shapely.points(*trace.grid.to_world(middle[:, 1], middle[:, 0]))
                detected = shapely.union_all(found.polygons)
                size += len(scene.reference)
                for polygon, verdict in zip(scene.reference.polygons, verdicts["verdict"], strict=True):
                    if verdict == "FN":
                        counted[loss_of(polygon, trace, lines, detected)] += 1
            counts.append(counted)
            heads.append(f"{detector}, {area} ({size})")
    print("| lost by | " + " | ".join(heads) + " |")
    print("|---" * (len(heads) + 1) + "|")
    for reason in sorted({reason for counted in counts for reason in counted}):
        print(f"| {reason} | " + " | ".join(str(counted[reason]) for counted in counts) + " |")
    print("| all missed | " + " | ".join(str(counted.total()) for counted in counts) + " |")


def above_tile(scene):
    """Return the references of section 4.1 of the 2010 paper: most of what the laser saw in them is above T_h."""
    import shapely

    from roofbench.detectors.lines.line_detector import PAPER_PIXEL
    from roofbench.detectors.lines.masks import ground_heights

    original, cloud = rb.make_detector("original"), scene.points
    side = original.values()["ground_tile"] * PAPER_PIXEL
    limit = ground_heights(cloud, scene.dem, method="tile-dem", tile_side=side) + original.values()["height"]
    tree = shapely.STRtree(shapely.points(cloud.x, cloud.y))
    high = [
        (cloud.z[inside] > limit[inside]).mean() >= 0.5
        for inside in (tree.query(polygon, predicate="contains") for polygon in scene.reference.polygons)
    ]
    return scene.reference.take(np.flatnonzero(high))


def tiles(seeds):
    """Compare `original` with the reference as it is and with what the paper's reference holds."""
    print("| reference | entities | " + " | ".join(COLUMNS) + " |\n" + "|---" * (len(COLUMNS) + 2) + "|")
    scenes = [scene_of(name, seed) for name in FAIRFIELD for seed in seeds]
    for label, references in (
        ("all", [scene.reference for scene in scenes]),
        ("above T_h of their tile", [above_tile(scene) for scene in scenes]),
    ):
        pairs = zip(scenes, references, strict=True)
        row = means([indices(scene, "original[ground=tile-dem]", known) for scene, known in pairs])
        print(f"| {label} | {sum(map(len, references))} | {cells(row)} |", flush=True)


def save(figure, name):
    """Save a picture of less than 300 kB: with 256 colours, then smaller."""
    from PIL import Image as Picture

    IMAGES.mkdir(parents=True, exist_ok=True)
    for dpi in (90, 75, 60, 50):
        figure.savefig(IMAGES / name, dpi=dpi, bbox_inches="tight")
        with Picture.open(IMAGES / name) as picture:
            picture.convert("RGB").quantize(256, Picture.Quantize.MAXCOVERAGE).save(IMAGES / name, optimize=True)
        if (IMAGES / name).stat().st_size < 290_000:
            return


def crop(scene, share):
    """Return the part of a scene around its centre, `share` of its width and height."""
    xmin, ymin, xmax, ymax = scene.extent
    x, y = (xmin + xmax) / 2, (ymin + ymax) / 2
    half = share * (xmax - xmin) / 2, share * (ymax - ymin) / 2
    grid = scene.image.grid
    top, bottom = (round((grid.north - value) / grid.gsd) for value in (y + half[1], y - half[1]))
    left, right = (round((value - grid.west) / grid.gsd) for value in (x - half[0], x + half[0]))
    part = rb.Grid(grid.west + left * grid.gsd, grid.north - top * grid.gsd, grid.gsd, bottom - top, right - left)
    image = rb.Image(scene.image.values[:, top:bottom, left:right].copy(), scene.image.bands, part)
    cloud = scene.points
    xmin, ymin, xmax, ymax = part.extent
    inside = (cloud.x >= xmin) & (cloud.x <= xmax) & (cloud.y >= ymin) & (cloud.y <= ymax)
    return rb.Scene("part", part.extent, crs=scene.crs, points=cloud.take(inside), image=image, dem=scene.dem)


def pictures(_seeds):
    from roofbench.reports.steps.step_figure import step_figure

    for detector, name, share in (("original", "fairfield-1", 0.4), ("improved", "moonee-ponds", 0.22)):
        scene = crop(scene_of(name, 1), share)
        for number, step in enumerate(rb.make_detector(detector).steps(scene, np.random.default_rng(0)), start=1):
            name = f"{detector}-{number:02d}-{step.name}"
            if name in PICTURED:
                save(step_figure(step), f"lines-{name}.png")


def modes(seeds, folders):
    """Print every mode of both detectors on the papers' presets and on scene folders, by three matchings."""
    columns = ("C_m", "C_r", "Q_l", "M_d", "Q_lp", *(f"{name} {m}" for m in ("one-pass", "overlap") for name in OTHER))
    print(f"| detector, area | {' | '.join(columns)} |\n|---|{'---|' * len(columns)}")
    areas = {area: [scene_of(name, seed) for name in names for seed in seeds] for area, names in AREAS.items()}
    areas |= {Path(folder).name: [rb.open_scene(folder)] for folder in folders}
    for detector in ("original", "improved"):
        for area, scenes in areas.items():
            for mode in ("default", "paper", "program"):
                rows = [of_matchings(scene, f"{detector}[mode={mode}]") for scene in scenes]
                means = [statistics.fmean(column) for column in zip(*rows, strict=True)]
                print(f"| {detector}, {mode}, {area} | {' | '.join(f'{value:.1f}' for value in means)} |", flush=True)


def of_matchings(scene, selection):
    found = rb.make_detector(selection).detect(scene.for_detection(), np.random.default_rng(0))
    nearest, *others = (
        rb.evaluate(found, scene.reference, area=scene.area, matching=matching)
        for matching in ("nearest", "one-pass", "overlap")
    )
    one = nearest.object
    shares = [one.completeness, one.correctness, one.quality, one.multiple_detection_rate, nearest.pixel.quality]
    for other in others:
        shares += [other.object.quality, other.object.multiple_detection_rate, other.pixel.quality]
    return [100 * (share or 0.0) for share in shares]


STUDIES = {
    "pattern": pattern,
    "losses": losses,
    "tiles": tiles,
    "pictures": pictures,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=("ablation", "modes", *STUDIES))
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("--detectors", default="original,improved")
    parser.add_argument("--folders", nargs="*", default=[], help="scene folders besides the presets, for modes")
    options = parser.parse_args()
    seeds = [int(seed) for seed in options.seeds.split(",")]
    if options.study == "ablation":
        ablation(seeds, options.detectors.split(","))
    elif options.study == "modes":
        modes(seeds, options.folders)
    else:
        STUDIES[options.study](seeds)


if __name__ == "__main__":
    main()
