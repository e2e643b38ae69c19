"""How the quality of ndsm depends on its cues, its parameters and the points: the tables of docs/results/ndsm.md.

Run by hand on scene folders: ``python tests/performance/study_ndsm.py delft ign [--tables cues,parameters,points]``.

Reference footprints that touch (gaps below 0.1 m) are joined to blocks first. Each figure is in percent: pixel quality
of the threshold-free evaluator (nearest matching, exact areas, evaluation area of the scene), and in brackets the
area of intersection over that of union of all footprints, which no matching moves. The table of presets
(``--tables presets``) needs no folder: it pools the indices of five seeds each, and averages the agreement.
"""

from __future__ import annotations

import argparse
import dataclasses

import numpy as np
import shapely

import roofbench as rb
from roofbench.detectors.ndsm.ndsm_detector import NDSM
from roofbench.reports.tables import Column, Table

CUES = {
    "all cues": {},
    "without multiple returns": {"multiple_share": None},
    "without roughness": {"roughness": None},
    "without penetration": {"penetration": None},
    "without image": {"ndvi": None, "green_red": None},
    "multiple returns only": {"roughness": None, "penetration": None, "ndvi": None, "green_red": None},
    "roughness only": {"multiple_share": None, "penetration": None, "ndvi": None, "green_red": None},
    "penetration only": {"multiple_share": None, "roughness": None, "ndvi": None, "green_red": None},
    "image only": {"multiple_share": None, "roughness": None, "penetration": None},
    "height alone": {
        "multiple_share": None,
        "roughness": None,
        "penetration": None,
        "ndvi": None,
        "green_red": None,
        "most_tree_like": 1,
    },
    "neither smoothing nor opening": {"smoothing": 0, "opening": 0},
    "traced, no straight walls": {"tolerance": 0.01},
    "rectangles": {"outline": "rectangle"},
    "ground from the points": {"dem": False},
}
VALUES = {
    "height": (1.5, 2.0, 3.0, 3.5),
    "cell": (0.25, 0.5, 0.7, 1.0),
    "multiple_share": (0.3, 0.4, 0.6, 0.7),
    "roughness": (0.1, 0.15, 0.4, 0.6),
    "window": (1.0, 2.0, 2.5, 3.0),
    "penetration": (0.2, 0.3, 0.4, 0.5),
    "green_red": (0.0, 0.03, 0.08, 0.12),
    "smoothing": (0.0, 0.5, 1.0, 1.5),
    "opening": (0.0, 0.5, 1.5, 2.0),
    "largest_hole": (0.0, 2.0, 10.0, 30.0),
    "most_tree_like": (-0.6, -0.5, -0.3, 0.0),
    "smallest_area": (0.0, 4.0, 12.0, 20.0),
    "tolerance": (0.1, 0.25, 0.75, 1.0),
}


PRESETS = {
    "fairfield-small": "last pulse, 0.5 m",
    "vaihingen-a-small": "all returns",
    "toronto-a-small": "all returns",
    "moonee-ponds-small": "first pulse, 1 m",
    "knox-small": "first pulse, 1 m, dense trees",
}
SEEDS = range(11, 16)


def compared(scene, points=None, **parameters):
    """Return the evaluation and the intersection over union of all footprints."""
    seen = scene.for_detection()
    if points is not None:
        seen = rb.Scene(scene.name, scene.extent, crs=scene.crs, points=points, image=scene.image)
    found = NDSM(**parameters).detect(seen, np.random.default_rng(0))
    reference = scene.reference.joined(0.1)
    evaluation = rb.evaluate(found, reference, area=scene.area)
    one, two = shapely.union_all(found.polygons), shapely.union_all(reference.polygons)
    if scene.area is not None:
        one, two = one.intersection(scene.area), two.intersection(scene.area)
    return evaluation, one.intersection(two).area / one.union(two).area


def quality(scene, points=None, **parameters):
    """Return pixel quality and intersection over union as text."""
    evaluation, agreement = compared(scene, points, **parameters)
    return f"{100 * (evaluation.pixel.quality or 0):.1f} ({100 * agreement:.1f})"


def cue_table(scenes):
    rows = [[name, *(quality(scene, **values) for scene in scenes)] for name, values in CUES.items()]
    return Table.of(map(Column, ["variant", *(scene.name for scene in scenes)]), rows).to_markdown()


def parameter_table(scenes):
    rows = []
    for name, values in VALUES.items():
        default = NDSM.parameters()[name].default
        for scene in scenes:
            cells = [f"{value:g}: {quality(scene, **{name: value})}" for value in values]
            rows.append([f"`{name}`", "automatic" if default is None else f"{default:g}", scene.name, *cells])
    return Table.of(map(Column, ["parameter", "default", "scene", "", "", "", ""]), rows).to_markdown()


def point_variants(points):
    """Yield what a poorer flight would have given of the same points; no DEM goes with them."""
    rng = np.random.default_rng(5)
    covered = np.unique(np.floor(np.column_stack([points.x, points.y]) / 2), axis=0).shape[0] * 4.0

    def thin(cloud, density):
        return cloud.take(rng.random(len(cloud)) < density * covered / len(cloud))

    def untold(cloud):
        return dataclasses.replace(cloud, return_number=None, number_of_returns=None)

    first = points.take(points.return_number == 1)
    last = points.take(points.return_number == points.number_of_returns)
    yield f"all returns, {len(points) / covered:.0f} per m2", points
    for density in (10, 5, 3):
        yield f"all returns, {density} per m2", thin(points, density)
    yield "all returns, numbers unknown", untold(points)
    yield "first returns", first
    yield "first returns, numbers unknown", untold(first)
    yield "last returns", last
    yield "last returns, numbers unknown", untold(last)
    for density in (5, 3, 1):
        yield f"first returns, numbers unknown, {density} per m2", untold(thin(first, density))
    yield "last returns, numbers unknown, 3 per m2", untold(thin(last, 3))


def point_table(scenes):
    rows = []
    columns = [list(point_variants(scene.points.unclassified())) for scene in scenes]
    for number, (name, _) in enumerate(columns[0]):
        label = "all returns, as flown" if number == 0 else name
        cells = []
        for scene, variants in zip(scenes, columns, strict=True):
            cells.append(quality(scene, variants[number][1]))
            if scene.image is not None:
                cells.append(quality(scene, variants[number][1], ndvi=None, green_red=None))
        rows.append([label, *cells])
    heads = []
    for scene in scenes:
        heads += [scene.name] if scene.image is None else [f"{scene.name}, with image", f"{scene.name}, without"]
    return Table.of(map(Column, ["points", *heads]), rows).to_markdown()


def preset_table(_):
    rows = []
    for preset, pulses in PRESETS.items():
        scenes = [rb.make_scene(preset, seed=seed) for seed in SEEDS]
        evaluations, agreement = zip(*(compared(scene) for scene in scenes), strict=True)
        without = [compared(scene, dem=False)[1] for scene in scenes]
        pooled = rb.pool(evaluations)
        indices = (pooled.pixel.quality, pooled.object.completeness, pooled.object.correctness)
        figures = [np.mean(agreement), *indices, np.mean(without)]
        rows.append([f"`{preset}` ({pulses})", *(f"{100 * figure:.1f}" for figure in figures)])
    heads = ("preset", "IoU", "pixel quality", "completeness", "correctness", "IoU, without DEM")
    return Table.of(map(Column, heads), rows).to_markdown()


TABLES = {"cues": cue_table, "parameters": parameter_table, "points": point_table, "presets": preset_table}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", help="scene folders with a reference")
    parser.add_argument("--tables", default=",".join(TABLES), help="which, of: " + ", ".join(TABLES))
    options = parser.parse_args()
    scenes = [rb.open_scene(folder) for folder in options.folders]
    for name in options.tables.split(","):
        print(f"\n### {name}\n\n{TABLES[name](scenes)}", flush=True)


if __name__ == "__main__":
    main()
