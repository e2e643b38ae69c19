"""Speed and memory of the threshold-free evaluator, beside the bare search and intersection of shapely.

Run by hand: ``python tests/performance/bench_evaluate.py [--sizes 1000,100000,1000000] [--repeats 3]``.

Each size is a city of that many references (rectangles of 8 to 14 m at random angles on a 20 m lattice, one in ten
with a wing under the same building id) against as many detections, shifted by 1 m on average, one in twenty missing
or false. ``--shape notched`` cuts three corners off each rectangle: outlines of 10 vertices.

Measured in a process of its own, one after the other:

- *bare*: ``STRtree(reference).query(detected)``, then ``area(intersection(...))`` of the pairs found;
- *verdicts*: from the same arrays of polygons to all indices and to the verdict of each object;
- *work*: the ratio of processor seconds, which other programs disturb less; two threads use more of them at a time;
- *frames*: from there to the two data frames, with the reason of each verdict in words.

The whole-process rows time ``roofbench evaluate`` on GeoJSON files, interpreter start and imports included, and the
imports of the libraries alone that it needs to read them.
"""

from __future__ import annotations

import argparse
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def city(count, seed=1, shape="rectangles"):
    import numpy as np
    import shapely

    rng = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(count)))
    centre = np.stack([np.arange(count) % side, np.arange(count) // side], axis=1) * 20.0 + 5e5
    building = np.arange(count)
    wing = rng.random(count) < 0.1
    wing[0] = False
    centre[wing] = centre[np.flatnonzero(wing) - 1] + 4.0
    building[wing] = building[np.flatnonzero(wing) - 1]

    if shape == "notched":
        outline = np.array([[-1, -1], [1, -1], [1, 0.2], [0.6, 0.2], [0.6, 1], [-0.3, 1], [-0.3, 0.5], [-1, 0.5]])
        outline = np.array([*outline[:7], [-0.8, 0.5], [-0.8, -0.4], [-1, -0.4], [-1, -1]])
    else:
        outline = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])

    def rectangles(middle, angle, size):
        corners = outline * size[:, None, :] / 2
        c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
        x, y = corners[..., 0] * c - corners[..., 1] * s, corners[..., 0] * s + corners[..., 1] * c
        return shapely.polygons(np.stack([x, y], axis=2) + middle[:, None, :])

    angle, size = rng.uniform(0, np.pi, count), rng.uniform(8, 14, (count, 2))
    reference = rectangles(centre, angle, size)
    moved = centre + rng.normal(0, 0.8, (count, 2))
    gone = rng.random(count) < 0.05
    moved[gone] += 1e6
    detected = rectangles(moved, angle + rng.normal(0, 0.02, count), size * rng.uniform(0.85, 1.15, (count, 2)))
    return detected, reference, building


def measure(count, shape):
    import shapely

    import roofbench as rb

    detected, reference, building = city(count, shape=shape)
    small = city(1000, shape=shape)
    assert rb.evaluate(rb.Footprints.of(small[0]), rb.Footprints.of(small[1])).verdicts  # imports are not timed
    clock, work = time.perf_counter(), time.process_time()
    found, wanted = shapely.STRtree(reference).query(detected)
    shapely.area(shapely.intersection(detected[found], reference[wanted])).sum()
    bare, bare_work = time.perf_counter() - clock, time.process_time() - work
    clock, work = time.perf_counter(), time.process_time()
    evaluation = rb.evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference, building_ids=building))
    verdicts = evaluation.verdicts
    seconds, own_work = time.perf_counter() - clock, time.process_time() - work
    assert len(verdicts.detection_table) == count
    frames = verdicts.detections, verdicts.references
    total = time.perf_counter() - clock
    assert len(frames[0]) == count
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return {"bare": bare, "verdicts": seconds, "ratio": seconds / bare, "work": own_work / bare_work} | {
        "frames": total,
        "peak": peak,
    }


def in_own_process(*arguments):
    run = subprocess.run([sys.executable, __file__, *arguments], capture_output=True, text=True, check=True)
    return json.loads(run.stdout)


def whole_process(count, folder):
    """Return seconds of ``roofbench evaluate`` on two GeoJSON files."""
    import roofbench as rb

    detected, reference, building = city(count)
    rb.write_footprints(rb.Footprints.of(detected, crs="EPSG:25832"), folder / "d.geojson", overwrite=True)
    truth = rb.Footprints.of(reference, building_ids=building, crs="EPSG:25832")
    rb.write_footprints(truth, folder / "r.geojson", overwrite=True)
    command = [sys.executable, "-m", "roofbench", "evaluate", str(folder / "d.geojson"), str(folder / "r.geojson")]
    clock = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - clock


def imports():
    """Return seconds of a process that only imports the libraries which reading two files needs."""
    clock = time.perf_counter()
    subprocess.run([sys.executable, "-c", "import numpy, shapely, pyogrio, pyproj, typer, rich"], check=True)
    return time.perf_counter() - clock


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="1000,100000,1000000")
    parser.add_argument("--shape", choices=("rectangles", "notched"), default="rectangles")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(options.one, options.shape)))
        return
    columns = ("bare", "verdicts", "ratio", "work", "frames", "peak")
    print(f"{options.shape}, seconds and GB, median of {options.repeats}")
    print(" ".join(f"{name:>10}" for name in ("size", *columns)))
    for size in options.sizes.split(","):
        runs = [in_own_process("--one", size, "--shape", options.shape) for _ in range(options.repeats)]
        median = {key: statistics.median(run[key] for run in runs) for key in runs[0]}
        print(f"{int(size):>10,} " + " ".join(f"{median[name]:>10.2f}" for name in columns), flush=True)
    with tempfile.TemporaryDirectory() as folder:
        seconds = statistics.median(whole_process(1000, Path(folder)) for _ in range(5))
    start = statistics.median(imports() for _ in range(5))
    print(f"roofbench evaluate, 1 000 x 1 000 GeoJSON, whole process: {seconds:.2f} s; imports alone: {start:.2f} s")


if __name__ == "__main__":
    main()
