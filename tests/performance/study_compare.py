"""Seven detections of one place, pair by pair, and how often intervals cover the truth.

``python tests/performance/study_compare.py FILE.gpkg [REFERENCE] [FOLDER]`` prints the tables of
docs/results/compare.md. The file
has one layer per detector; one of them serves as reference. With a folder, the map of one pair is drawn there.
"""

import itertools
import sys
from pathlib import Path

import numpy as np
import pyogrio
import shapely

import roofbench as rb
from roofbench.benchmark.analysis.inference import holm
from roofbench.evaluators.uncertainty import blocks, intervals
from roofbench.reports.figures import save_figure
from roofbench.reports.format import interval_text, number_text
from roofbench.reports.pair_map import pair_figure

#: Indices of the table, of the default evaluator, and the unit in which they differ.
SHOWN = ("object.completeness", "object.correctness", "object.quality", "pixel.quality", "geometric.rmse")
PICTURE = ("U-Net34", "DeepLabV3Plus50")


def main(file, reference="Blackshark_ai", folder=None):
    layers = {name: rb.read_footprints(file, layer=name) for name, kind in pyogrio.list_layers(file) if kind}
    truth = layers.pop(reference)
    print(f"## Values against {reference}, with 95 % intervals and the change under a reference redrawn by 0.3 m\n")
    values(layers, truth)
    print("\n## Pairs\n")
    pairs(layers, truth)
    print("\n## Coverage of 95 % intervals of completeness in 60 simulated scenes\n")
    coverage()
    if folder:
        one, two = PICTURE
        found = rb.compare(layers[one], layers[two], truth)
        title = f"A: {one}, B: {two}, reference: {reference}"
        save_figure(pair_figure(found, title=title), Path(folder) / "compare-indiana.png", overwrite=True)


def values(layers, truth):
    print(f"| detector | n | {' | '.join(SHOWN)} |\n| --- | --: |{' --: |' * len(SHOWN)}")
    for name, detected in layers.items():
        found, ends = rb.evaluate(detected, truth), rb.block_intervals(detected, truth).ends
        moved = rb.redraw_changes(detected, truth, error=0.3, redraws=20).changes
        cells = []
        for key in SHOWN:
            unit = found.evaluator.index(key).unit
            low, high = ends[key]
            moves = number_text(moved[key], unit, fine=True)
            cells.append(f"{number_text(found.values[key], unit)} ({interval_text(low, high, unit)}; ±{moves})")
        print(f"| {name} | {len(detected)} | {' | '.join(cells)} |")


def pairs(layers, truth):
    every = {(one, two): rb.compare(layers[one], layers[two], truth) for one, two in itertools.combinations(layers, 2)}
    adjusted = dict(zip(every, holm([found.p_value for found in every.values()]), strict=True))
    print("| A | B | both | only A | only B | neither | p | p (Holm) | object quality B − A | pixel quality B − A |")
    print("| --- | --- | --: | --: | --: | --: | --: | --: | --: | --: |")
    for (one, two), found in every.items():
        counts = [str(found.objects[fate]) for fate in ("both", "only A", "only B", "neither")]
        by_key = {difference.index.key: difference for difference in found.differences}
        cells = []
        for key in ("object.quality", "pixel.quality"):
            difference = by_key[key]
            low, high = difference.ends
            interval = interval_text(low, high, "fraction", signed=True)
            text = f"{number_text(difference.difference, 'fraction', signed=True)} ({interval})"
            cells.append(f"**{text}**" if difference.conclusion.endswith("better") else text)
        ps = [f"{found.p_value:.2g}", f"{adjusted[one, two]:.2g}"]
        print(f"| {' | '.join([one, two, *counts, *ps, *cells])} |")


def houses(count):
    return rb.Footprints.of(
        [shapely.box(30 * (k % 20), 30 * (k // 20), 30 * (k % 20) + 10, 30 * (k // 20) + 10) for k in range(count)]
    )


def covers(reference, detected, most):
    """Return whether the interval of the share of references found covers 0.7, with this number of blocks."""
    evaluation = rb.evaluate(detected, reference, evaluator="mobj0")
    found = blocks.spatial_blocks([detected, reference], most=most)
    every = intervals.block_tallies(evaluation.evaluator, (detected, reference), (0, 1), found)
    column = intervals.resampled_values(evaluation, every)["mobj0.paired"]
    low, high = intervals.interval_of(column, found.count, 95)
    return low <= 0.7 <= high


def coverage(scenes=60):
    print("| most blocks | 100 independent buildings | 400 in runs of five |\n| --: | --: | --: |")
    for most in (20, 32, 64, 128):
        hits = [0, 0]
        for seed in range(scenes):
            rng = np.random.default_rng(seed)
            few, many = houses(100), houses(400)
            hits[0] += covers(few, few.take(rng.random(100) < 0.7), most)
            hits[1] += covers(many, many.take(np.repeat(rng.random(80) < 0.7, 5)), most)
        print(f"| {most} | {hits[0]} | {hits[1]} |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
