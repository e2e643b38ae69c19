"""How the quality of the line detectors depends on the making of the image, and the weights of the texture score.

Run by hand: ``python tests/performance/study_texture.py table [--detectors improved] [--seeds 1-12]`` prints object and
pixel quality (per cent) by kind of image on three presets; ``fit [--seeds 101-104]`` prints the weights of a logistic
regression on candidates of the same kinds. Weights are fitted on other seeds than the table shows.

Scenes are made once and kept in the folder named by ROOFBENCH_BENCH_SCENES (default: bench-scenes).
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np

import roofbench as rb

PRESETS = ("fairfield-1-small", "moonee-ponds-small", "knox-small")
#: Points per square metre to point spacing, metres.
DENSITIES = {1: 1.0, 2: 0.7071, 4: 0.5, 10: 0.3162}
#: Weight of the squared weights: crowns of real trees are smoother than the generator's, so that smoothness alone,
#: which separates those almost without an error, must not decide.
RIDGE = 1e-3
KINDS = {"original": {}} | {
    name: {"image_processing": name} for name in ("resampled", "compressed", "sharpened", "blurred")
}  # fmt: skip
for _density, _spacing in DENSITIES.items():
    KINDS[f"{_density}/m2, original"] = {"point_spacing": _spacing}
    for _fill in ("nearest", "interpolated"):
        KINDS[f"{_density}/m2, {_fill}"] = {"point_spacing": _spacing, "image_from": _fill}


def scene_of(preset, seed, kind):
    folder = Path(os.environ.get("ROOFBENCH_BENCH_SCENES", "bench-scenes"))
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{preset}-{seed}-{kind.replace('/', '-').replace(', ', '-')}"
    if not path.exists():
        rb.save_scene(rb.make_scene(preset, seed=seed, **KINDS[kind]), path)
    return rb.open_scene(path)


def qualities(preset, seed, kind, detector):
    scene = scene_of(preset, seed, kind)
    found = detector.detect(scene.for_detection(), np.random.default_rng(0))
    result = rb.evaluate(found, scene.reference)
    shares = result.object.quality, result.pixel.quality, result.object.multiple_detection_rate
    return [100 * (share or 0.0) for share in shares]


def table(seeds, selections, kinds):
    """Print mean object / pixel quality by kind of image, and the difference from the original with its interval."""
    for selection in selections:
        detector = rb.make_detector(selection)
        print(f"\n| {selection} | {' | '.join(PRESETS)} | mean | against original, 95 % | M_d |")
        print("|---|" + "--:|" * (len(PRESETS) + 3), flush=True)
        base = {}
        for kind in kinds:
            rows = {preset: [qualities(preset, seed, kind, detector) for seed in seeds] for preset in PRESETS}
            means = {preset: np.mean(found, axis=0) for preset, found in rows.items()}
            scores = np.mean([np.array(found) for found in rows.values()], axis=0)
            density = kind.split(",")[0]
            if "original" in kind:
                base[density] = scores
            change = scores - base.get(density, base.get("original", scores))
            spread = 1.96 * change.std(axis=0, ddof=1) / np.sqrt(len(seeds)) if len(seeds) > 1 else np.zeros(3)
            text = " | ".join(f"{value[0]:.1f} / {value[1]:.1f}" for value in means.values())
            mean = scores.mean(axis=0)
            against = " / ".join(f"{change[:, k].mean():+.1f} ± {spread[k]:.1f}" for k in range(2))
            print(f"| {kind} | {text} | {mean[0]:.1f} / {mean[1]:.1f} | {against} | {mean[2]:.1f} |", flush=True)


def candidates(seeds, kinds):
    """Yield preset and kind, and of each candidate: share inside references, measures."""
    import shapely

    from roofbench.detectors.lines.boxes import box_corners

    detector = rb.make_detector("improved[new_share=0]")
    for kind in kinds:
        for preset in PRESETS:
            for seed in seeds:
                scene = scene_of(preset, seed, kind)
                trace = detector.trace(scene.for_detection())
                corners = box_corners(trace.candidates)
                boxes = shapely.polygons(np.stack(trace.grid.to_world(corners[..., 1], corners[..., 0]), axis=-1))
                area = shapely.area(boxes)
                known = shapely.union_all(scene.reference.polygons)
                share = shapely.area(shapely.intersection(boxes, known)) / area
                measured = trace.texture
                columns = (measured.alignment, measured.concentration, measured.entropy, measured.vegetation)
                columns += (measured.smoothness, measured.independent)
                yield f"{kind}, {preset}", np.stack([share, *columns], axis=1)


def fit(seeds, kinds):
    """Print the weights: candidates over half in a building against those under a fifth, each kind and preset alike."""
    from scipy.optimize import minimize

    from roofbench.detectors.lines.orientation import clipped_measures

    groups = {}
    for name, rows in candidates(seeds, kinds):
        groups.setdefault(name, []).append(rows)
    rows = np.concatenate([np.concatenate(found) for found in groups.values()])
    weight = np.concatenate([np.full(sum(map(len, found)), 1 / sum(map(len, found))) for found in groups.values()])
    clear = (rows[:, 0] > 0.5) | (rows[:, 0] < 0.2)
    building, weight = rows[clear, 0] > 0.5, weight[clear] / weight[clear].sum()
    measures = clipped_measures(rows[clear, 1:3], *rows[clear, 3:].T)
    columns = np.stack([*measures, np.ones(len(building))], axis=1)
    sign = np.where(building, 1, -1)
    spread = columns.std(axis=0)[:-1]
    found = minimize(
        lambda b: (weight * np.logaddexp(0, -sign * (columns @ b))).sum() + RIDGE * ((b[:-1] * spread) ** 2).sum(),
        np.zeros(columns.shape[1]),
    )
    print("weights", found.x.round(2))
    score = columns @ found.x
    print(
        f"kept: {(score[building] > 0).mean():.3f} of the buildings, {(score[~building] > 0).mean():.3f} of the others"
    )


def numbers(text):
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=("table", "fit"))
    parser.add_argument("--seeds", default="")
    parser.add_argument("--detectors", nargs="*", default=["improved"])
    parser.add_argument("--kinds", nargs="*", default=list(KINDS))
    options = parser.parse_args()
    if options.study == "table":
        table(numbers(options.seeds or "1-12"), options.detectors, options.kinds)
    else:
        fit(numbers(options.seeds or "101-104"), options.kinds)


if __name__ == "__main__":
    main()
