"""Thresholds of mpp that need other scenes than airborne clouds, chosen without each place and scored on it.

Run by hand: ``python tests/performance/study_held_out.py rasters --folders delft-s,ign-s``, the same with ``images``,
``walls`` or ``clouds``; ``kinds`` compares kinds of clouds. Folders are scenes with a reference, as for study_real.py.
A place is a folder or a preset with all the scenes made from it: they are left out together.

clouds
    The folders as they are.
rasters
    The highest point of each cell of 0.5 m, or of 1 m where points are farther apart than 0.5 m, gaps filled by the
    nearest cell: what ``roofbench scenes import --dsm`` makes of a surface model. Without images. Four rasters of each
    folder, with cells that begin half a cell apart: one raster alone decides by chance.
images
    Folders with an image in colours, as first returns without numbers and as rasters, and presets whose points record
    no number of returns (``level=part``, as their references have a rectangle for each wing). The first scene of each
    place also with its image turned by 180 degrees, which says nothing about the points.
walls
    The presets `rows` and `old-town`, `toronto-a` for its deep roofs (``level=part``), and the folders of Delft.
"""

from __future__ import annotations

import argparse
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import distance_transform_edt
from study_real import merit, opened, remembered, scored, set_to

import roofbench as rb
from roofbench.detectors.mpp import background, image_cue, mpp_detector, party_walls, rows
from roofbench.detectors.shared import cue_information
from roofbench.scenes.geodata.density import point_spacing
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Grid

#: Metres: cells of rasters, and of those of points that are farther apart than the first.
FINE, COARSE = 0.5, 1.0
#: Cells by which the rasters of one scene are displaced, west and north.
SHIFTS = ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5))
#: Presets whose references have a rectangle for each wing.
OF_PARTS = ("knox", "moonee-ponds", "toronto-a")
#: Presets of the studies of images and of walls.
PRESETS = {"images": ("knox", "moonee-ponds"), "walls": ("rows", "old-town", "toronto-a")}


class Threshold(NamedTuple):
    """A chosen number: where it lives (None: a parameter of mpp), its name, the values to choose from.

    A name with a dot is a field of a named tuple.
    """

    module: ModuleType | None
    name: str
    values: tuple[float, ...]

    @property
    def present(self) -> float:
        if self.module is None:
            return getattr(mpp_detector.MPP(), self.name)
        value: Any = self.module
        for part in self.name.split("."):
            value = getattr(value, part)
        return value


THRESHOLDS = {
    "clouds": {
        "least height, m": Threshold(None, "least_height", (2.0, 2.2, 2.5, 3.0)),
    },
    "rasters": {
        "prior of roughness, nats": Threshold(background, "_WITHOUT_OPENNESS", (0.0, 0.125, 0.25, 0.5, 1.0)),
        "share of the least evidence": Threshold(mpp_detector, "_LEAST_OF_ONE_CUE", (0.6, 0.7, 0.8, 0.9, 1.0)),
    },
    "images": {
        "weight of the image, nats": Threshold(image_cue, "_WEIGHT", (0.0, 0.25, 0.5, 0.75, 1.0)),
        "least separation of the image": Threshold(cue_information, "_LEAST_SEPARATION", (0.0, 0.25, 0.5, 0.75, 2.0)),
    },
    "walls": {
        "certain colour edge": Threshold(rows, "CERTAIN.colour", (0.01, 0.015, 0.02, 0.03, 0.04, 1.0)),
        "probable colour edge": Threshold(rows, "PROBABLE.colour", (0.005, 0.01, 0.015, 0.02, 1.0)),
        "deepest house, m": Threshold(party_walls, "_DEEPEST", (8.0, 12.0, 16.0, 20.0, 1000.0)),
        "least depth, m": Threshold(party_walls, "_SHALLOWEST", (2.5, 3.0, 3.5, 4.0, 4.5)),
    },
}


@contextmanager
def value_of(threshold, value):
    """Set a threshold; yield the parameters of the detector."""
    if threshold.module is None:
        yield {threshold.name: value}
        return
    name, _, field = threshold.name.partition(".")
    whole = getattr(threshold.module, name)
    with set_to(threshold.module, name, whole._replace(**{field: value}) if field else value):
        yield {}


def with_points(scene, points, image):
    return rb.Scene(
        scene.name,
        scene.extent,
        crs=scene.crs,
        points=points,
        image=image,
        reference=scene.reference,
        area=scene.area,
    )


def first_returns(scene):
    """Return a scene as a scanner of single returns would record it."""
    points = scene.points
    first = points if points.return_number is None else points.take(points.return_number == 1)
    return with_points(scene, replace(first, return_number=None, number_of_returns=None), scene.image)


def rastered(scene, image=None, shift=(0.0, 0.0)):
    """Return a scene of the highest points of cells, gaps filled by the nearest cell; the shift is in cells."""
    points = scene.points
    cell = FINE if point_spacing(points.x, points.y, scene.extent) <= FINE else COARSE
    grid = Grid.covering(scene.extent, cell)
    grid = replace(grid, west=grid.west - shift[0] * cell, north=grid.north + shift[1] * cell)
    row, column = (np.floor(place).astype(int) for place in grid.to_pixel(points.x, points.y))
    inside = (row >= 0) & (row < grid.rows) & (column >= 0) & (column < grid.columns)
    top = np.full(grid.shape, -np.inf)
    np.maximum.at(top, (row[inside], column[inside]), points.z[inside])
    nearest = distance_transform_edt(np.isinf(top), return_distances=False, return_indices=True)
    top = top[tuple(nearest)]
    rows_, columns_ = np.indices(grid.shape)
    x, y = grid.to_world(rows_.ravel() + 0.5, columns_.ravel() + 0.5)
    return with_points(scene, PointCloud(x=x, y=y, z=top.ravel()), image)


def scenes_of(study, folders, seeds):
    """Return the scenes of a study by place, what was made of it, and seed."""
    places = opened(folders)
    if study == "clouds":
        return places
    if study == "rasters":
        return {f"{name} {shift}": rastered(scene, None, shift) for name, scene in places.items() for shift in SHIFTS}
    found = {}
    if study == "walls":
        found = {name: scene for name, scene in places.items() if name.startswith("delft")}
    else:
        coloured = {name: scene for name, scene in places.items() if scene.image is not None and scene.image.is_colour}
        found |= {f"{name} first returns": first_returns(scene) for name, scene in coloured.items()}
        found |= {f"{name} raster": rastered(scene, scene.image) for name, scene in coloured.items()}
    for preset in PRESETS[study]:
        found |= {f"{preset} {seed}": rb.make_scene(preset, seed=seed) for seed in range(1, seeds + 1)}
    if study == "images":
        first = {place_of(name): name for name in reversed(found)}
        found |= {f"{name} turned": with_turned_image(found[name]) for name in first.values()}
    return found


def with_turned_image(scene):
    image = scene.image
    valid = None if image.valid is None else image.valid[::-1, ::-1]
    turned = replace(image, values=np.ascontiguousarray(image.values[:, ::-1, ::-1]), valid=valid)
    return with_points(scene, scene.points, turned)


def place_of(name):
    """Return the place of a scene: both references of Delft are of one cloud."""
    place = name.split()[0]
    return "delft" if place.startswith("delft") else place


def run(scenes, parameters):
    level = {name: "part" if place_of(name) in OF_PARTS else "building" for name in scenes}
    return {
        name: scored(rb.detect(scene, "mpp", level=level[name], **parameters), scene) for name, scene in scenes.items()
    }


def held_out(scenes, label, threshold):
    """Choose a threshold without each place, by the sum of both qualities; print its means and those of now."""
    now = threshold.present
    found = {}
    with remembered():
        for value in dict.fromkeys((now, *threshold.values)):
            with value_of(threshold, value) as parameters:
                found[value] = run(scenes, parameters)
    order = sorted(found, key=now.__ne__)
    places = list(dict.fromkeys(map(place_of, scenes)))
    chosen, held = {}, []
    for place in places:
        own = [name for name in scenes if place_of(name) == place]
        # Of equal values the present one is kept.
        best = chosen[place] = order[int(np.argmax([merit(found[value], own) for value in order]))]
        held += [found[best][name].numbers[:3] for name in own]
    means = {value: mean_of([o.numbers[:3] for o in found[value].values()]) for value in found}
    each = "; ".join(f"{value:g}: {means[value]}" for value in sorted(found))
    picks = ", ".join(f"{place} {value:g}" for place, value in chosen.items())
    print(f"| {label} | {now:g} | {each} | {picks} | {means[now]} | {mean_of(held)} |", flush=True)


def mean_of(qualities):
    return " / ".join(f"{value:.1f}" for value in np.mean(qualities, axis=0))


def kinds(folders):
    """Print the qualities on each cloud, its first returns without numbers, its raster, and that with the image."""
    made = {
        "cloud": lambda scene: with_points(scene, scene.points, None),
        "first returns": lambda scene: with_points(scene, first_returns(scene).points, None),
        "raster": rastered,
        "raster and image": lambda scene: rastered(scene, scene.image),
    }
    print(f"\n| scene | detector | {' | '.join(made)} |\n|---|---|{'--:|' * len(made)}")
    for name, scene in opened(folders).items():
        for detector in ("mpp", "ndsm"):
            cells = []
            for kind, make in made.items():
                if "image" in kind and (scene.image is None or not scene.image.is_colour):
                    cells.append("")
                    continue
                other = make(scene)
                cells.append(mean_of([scored(rb.detect(other, detector), other).numbers[:2]]))
            print(f"| {name} | `{detector}` | {' | '.join(cells)} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=(*THRESHOLDS, "kinds"))
    parser.add_argument("--folders", default="", help="scene folders, by commas")
    parser.add_argument("--seeds", type=int, default=3, help="scenes of each preset")
    parser.add_argument("--threshold", default="", help="only those whose name contains this")
    options = parser.parse_args()
    folders = [folder for folder in options.folders.split(",") if Path(folder).name]
    if options.study == "kinds":
        kinds(folders)
        return
    scenes = scenes_of(options.study, folders, options.seeds)
    print(f"<!-- {', '.join(scenes)} -->")
    print(
        "\n| threshold | present | Q_l / Q_lp / agreement of each value | chosen without each place | now | left out |"
    )
    print("|---|--:|---|---|--:|--:|")
    for label, threshold in THRESHOLDS[options.study].items():
        if options.threshold in label:
            held_out(scenes, label, threshold)


if __name__ == "__main__":
    main()
