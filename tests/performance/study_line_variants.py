"""How the line detectors stand changes of image and points: the table of variants in docs/results/line-detectors.md.

Run by hand: ``python tests/performance/study_line_variants.py --folders ign,kentucky [-d original -d improved]``.
Each scene is scored as it is and as copies with another image (displaced, resampled, dark, grey, ...) or fewer points.
Without ``--folders``, scenes of the generator whose image has the colours of their points stand for real ones:
``--presets fairfield-1-small,knox-small --seeds 961-965``. Detectors see neither classes nor a DEM.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import cv2
import numpy as np
from study_real import blind, opened, scored

import roofbench as rb
from roofbench.core.errors import RoofbenchError
from roofbench.evaluators.threshold_free.causes import CAUSES

#: Share of the light that reaches a shadow: red, green, blue.
SKY_LIGHT = (0.30, 0.34, 0.42)
#: Point spacing of generated scenes and displacement of their images, metres, by seed.
SPACINGS, SHIFTS = (0.25, 0.3, 0.35), (0.0, 0.5, 1.0, 1.5)


def with_image(scene, image=None, points=None):
    return rb.Scene(
        scene.name,
        scene.extent,
        crs=scene.crs,
        points=scene.points if points is None else points,
        image=scene.image if image is None else image,
        reference=scene.reference,
        area=scene.area,
    )


def recoloured(scene, change):
    """Return a scene whose image values, of shape (bands, rows, columns), are changed."""
    image = scene.image
    values = np.clip(np.rint(change(image.values.astype(np.float64))), 0, 255).astype(np.uint8)
    return with_image(scene, replace(image, values=values))


def displaced(scene, east, north):
    grid = scene.image.grid
    return with_image(scene, warped(scene.image, grid, east, north))


def warped(image, grid, east=0.0, north=0.0):
    """Return an image on another grid, its content moved by metres east and north."""
    places = grid.to_world(np.arange(grid.rows)[:, None] + 0.5, np.arange(grid.columns) + 0.5)
    row, column = image.grid.to_pixel(*places)
    row, column = np.broadcast_arrays(row + north / image.grid.gsd - 0.5, column - east / image.grid.gsd - 0.5)
    maps = column.astype(np.float32), row.astype(np.float32)
    bands = [cv2.remap(band, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for band in image.values]
    return rb.Image(np.stack(bands), image.bands, grid)


def resampled(scene, gsd):
    image, grid = scene.image, rb.Grid.covering(scene.extent, gsd)
    if gsd > image.grid.gsd:
        shape = round(image.grid.columns * image.grid.gsd / gsd), round(image.grid.rows * image.grid.gsd / gsd)
        bands = [cv2.resize(band, shape, interpolation=cv2.INTER_AREA) for band in image.values]
        west, north = image.grid.west, image.grid.north
        coarse = rb.Grid(west, north, gsd, shape[1], shape[0])
        return with_image(scene, rb.Image(np.stack(bands), image.bands, coarse))
    return with_image(scene, warped(image, grid))


def half_a_cell(scene):
    grid = scene.image.grid
    moved = replace(grid, west=grid.west - grid.gsd / 2, north=grid.north + grid.gsd / 2)
    return with_image(scene, warped(scene.image, moved))


def compressed(scene, quality):
    pixels = np.ascontiguousarray(scene.image.values[:3].transpose(1, 2, 0))
    coded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    values = scene.image.values.copy()
    values[:3] = cv2.imdecode(coded, cv2.IMREAD_COLOR).transpose(2, 0, 1)
    return with_image(scene, replace(scene.image, values=values))


def shaded(scene, azimuth, elevation):
    """Return a scene with shadows of the highest points of each pixel; angles in degrees, azimuth of the sun."""
    image, points = scene.image, scene.points
    grid = image.grid
    cells, inside = grid.cells(points.x, points.y)
    surface = np.full(grid.rows * grid.columns, -np.inf)
    np.maximum.at(surface, cells[inside], points.z[inside])
    surface = surface.reshape(grid.shape).astype(np.float32)
    # Pixels without points have the highest of their neighbours.
    gaps = ~np.isfinite(surface)
    low = np.where(gaps, np.float32(-1e6), surface)
    surface = np.where(gaps, cv2.dilate(low, np.ones((5, 5))), surface)
    lit = np.ones(grid.shape, dtype=bool)
    steps = int(25 / grid.gsd)
    for k in range(1, steps):
        dx, dy = k * np.sin(np.radians(azimuth)), -k * np.cos(np.radians(azimuth))
        towards = np.array([[1, 0, -dx], [0, 1, -dy]], dtype=np.float32)
        other = cv2.warpAffine(surface, towards, grid.shape[::-1], flags=cv2.INTER_NEAREST, borderValue=-1e6)
        lit &= other <= surface + k * grid.gsd * np.tan(np.radians(elevation)) + 0.3
    light = np.where(lit, 1.0, np.array([*SKY_LIGHT, *[0.3] * 9][: len(image.bands)])[:, None, None])
    return recoloured(scene, lambda values: values * light)


def brightened(values):
    return values * np.linspace(0.45, 1.35, values.shape[2])


def blurred(scene, sigma):
    width = sigma / scene.image.grid.gsd
    return recoloured(scene, lambda values: np.stack([cv2.GaussianBlur(band, (0, 0), width) for band in values]))


def grey(scene):
    weights = np.array([0.299, 0.587, 0.114])
    values = np.rint(np.tensordot(weights, scene.image.values[:3], 1)).astype(np.uint8)
    return with_image(scene, rb.Image(values[None], ("grey",), scene.image.grid))


def half_covered(scene):
    values, valid = scene.image.values.copy(), np.ones(scene.image.grid.shape, dtype=bool)
    valid[:, valid.shape[1] // 2 :] = False
    values[:, ~valid] = 0
    return with_image(scene, replace(scene.image, values=values, valid=valid))


def thinned(scene, density):
    """Return a scene with so many pulses per square metre; None where it has fewer."""
    from roofbench.detectors.lines.masks import pulse_spacing

    own = pulse_spacing(scene.points, scene.image.grid) ** -2
    if density >= 0.9 * own:
        return None
    keep = np.random.default_rng(7).random(len(scene.points)) < density / own
    return with_image(scene, points=scene.points.take(keep))


VARIANTS = {
    "as it is": lambda scene: scene,
    "image displaced 1 m east": lambda scene: displaced(scene, 1.0, 0.0),
    "image displaced 1 m west": lambda scene: displaced(scene, -1.0, 0.0),
    "image displaced 1 m north": lambda scene: displaced(scene, 0.0, 1.0),
    "image displaced 1 m south": lambda scene: displaced(scene, 0.0, -1.0),
    "image displaced 0.7 m north-east": lambda scene: displaced(scene, 0.5, 0.5),
    "image displaced 1.5 m south-west": lambda scene: displaced(scene, -1.06, -1.06),
    "pixels of 0.15 m": lambda scene: resampled(scene, 0.15),
    "pixels of 0.2 m": lambda scene: resampled(scene, 0.2),
    "pixels of 0.25 m": lambda scene: resampled(scene, 0.25),
    "pixels of 0.35 m": lambda scene: resampled(scene, 0.35),
    "pixels of 0.6 m": lambda scene: resampled(scene, 0.6),
    "pixels of 0.8 m": lambda scene: resampled(scene, 0.8),
    "pixels of 1 m": lambda scene: resampled(scene, 1.0),
    "image moved by half a pixel": half_a_cell,
    "contrast of a third": lambda scene: recoloured(scene, lambda values: 128 + 0.33 * (values - 128)),
    "brightness gradient": lambda scene: recoloured(scene, brightened),
    "JPEG, quality 40": lambda scene: compressed(scene, 40),
    "shadows, sun in the south-east": lambda scene: shaded(scene, 140, 35),
    "shadows, sun in the south-west": lambda scene: shaded(scene, 220, 30),
    "blurred, 0.7 m": lambda scene: blurred(scene, 0.7),
    "grey": grey,
    "half without image": half_covered,
    "4 pulses/m2": lambda scene: thinned(scene, 4),
    "2 pulses/m2": lambda scene: thinned(scene, 2),
    "1 pulse/m2": lambda scene: thinned(scene, 1),
}


def made(preset, seed):
    """Return a generated scene of dense points whose image, of their colours, leans and is displaced."""
    scene = rb.make_scene(
        preset,
        seed=seed,
        point_spacing=SPACINGS[seed % len(SPACINGS)],
        pulse="all",
        digitised="ground",
        image_from="interpolated",
        registration_shift=SHIFTS[seed % len(SHIFTS)],
    )
    return compressed(blind(scene), 60) if seed % 2 else blind(scene)


def rows_of(selection, scenes):
    for name, scene in scenes.items():
        outcome = scored(rb.detect(scene, selection), scene)
        yield name, np.array(outcome.numbers)


def table(selections, scenes, variants):
    names = [cause.replace("_", " ") for cause in CAUSES]
    print(
        f"| detector | variant | Q_l | Q_lp | agreement | {' | '.join(names)} |\n|---|---|{'--:|' * (3 + len(names))}"
    )
    for selection in selections:
        means = []
        for variant in variants:
            copies = {name: VARIANTS[variant](scene) for name, scene in scenes.items()}
            copies = {name: copy for name, copy in copies.items() if copy is not None}
            if not copies:
                continue
            try:
                means.append(np.mean([numbers for _, numbers in rows_of(selection, copies)], axis=0))
            except RoofbenchError as error:
                print(f"<!-- {selection}, {variant}: {error} -->")
                continue
            print(f"| `{selection}` | {variant} | " + " | ".join(f"{v:.1f}" for v in means[-1]) + " |", flush=True)
        mean = " | ".join(f"**{v:.1f}**" for v in np.mean(means, axis=0))
        print(f"| `{selection}` | **mean** | {mean} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folders", default=[], type=lambda text: text.split(","), help="scene folders, by commas")
    parser.add_argument("--presets", default=[], type=lambda text: text.split(","), help="presets, by commas")
    parser.add_argument("--seeds", default="961-965")
    parser.add_argument("-d", dest="detectors", action="append", help="detector [original and improved]")
    options = parser.parse_args()
    first, _, last = options.seeds.partition("-")
    seeds = range(int(first), int(last or first) + 1)
    scenes = {f"{preset}-{seed}": made(preset, seed) for preset in options.presets for seed in seeds}
    variants = list(VARIANTS) if options.folders else ["as it is"]
    table(options.detectors or ["original", "improved"], opened(options.folders) | scenes, variants)


if __name__ == "__main__":
    main()
