"""Speed and memory of the detector ndsm.

Run by hand on scene folders: ``python tests/performance/bench_ndsm.py delft ign [--repeats 5] [--tiled 4e6]``.

Each scene is measured in a process of its own: points, image and DEM are in memory, kernels are compiled by a first
run. Reported are the medians of the CPU seconds of all threads, and by how much the detection raised the process's
peak memory above that of loading the scene. With a DEM the ground is read from it, without it is filtered from the
points. The tiled cloud repeats the first scene side by side until it has as many points as asked for.
"""

from __future__ import annotations

import argparse
import json
import math
import resource
import statistics
import subprocess
import sys
import time


def tiled(scene, count):
    """Return the scene repeated on a square lattice until it has `count` points; it keeps no DEM and no image."""
    import dataclasses

    import numpy as np

    import roofbench as rb

    points = scene.points
    side = math.ceil(math.sqrt(count / len(points)))
    copies = math.ceil(count / len(points))
    xmin, ymin, xmax, ymax = scene.extent
    offsets = [((i % side) * (xmax - xmin), (i // side) * (ymax - ymin)) for i in range(copies)]
    columns = {}
    for field in dataclasses.fields(points):
        column = getattr(points, field.name)
        columns[field.name] = None if column is None else np.concatenate([column] * copies)
    columns["x"] = np.concatenate([points.x + dx for dx, _ in offsets])
    columns["y"] = np.concatenate([points.y + dy for _, dy in offsets])
    height = math.ceil(copies / side) * (ymax - ymin)
    extent = (xmin, ymin, xmin + side * (xmax - xmin), ymin + height)
    return rb.Scene(f"{scene.name} x {copies}", extent, crs=scene.crs, points=rb.PointCloud(**columns))


def measure(folder, repeats, count, dem):
    import numpy as np

    import roofbench as rb
    from roofbench.detectors.ndsm.ndsm_detector import NDSM

    rng = np.random.default_rng(0)
    scene = rb.open_scene(folder)
    NDSM(dem=dem).detect(scene, rng)
    if count:
        scene = tiled(scene, count)
    scene = scene.for_detection()
    loaded = (scene.points, scene.image, scene.dem)
    held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    seconds = []
    for _ in range(repeats):
        clock = time.process_time()
        found = NDSM(dem=dem).detect(scene, rng)
        seconds.append(time.process_time() - clock)
    return {
        "scene": scene.name,
        "points": len(loaded[0]),
        "found": len(found),
        "seconds": statistics.median(seconds),
        "megabytes": (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - held) / 1024,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", help="scene folders")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--tiled", type=float, default=4e6, help="points of the tiled cloud; 0 for none")
    parser.add_argument("--one", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(*json.loads(options.one))))
        return
    tasks = [(folder, options.repeats, 0, dem) for folder in options.folders for dem in (True, False)]
    if options.tiled and options.folders:
        tasks.append((options.folders[0], options.repeats, int(options.tiled), False))
    print("| scene | ground | points | footprints | CPU s | CPU s per million points | MB above loading |")
    print("|---|---|---|---|---|---|---|")
    for task in tasks:
        process = subprocess.run(
            [sys.executable, __file__, "--one", json.dumps(task)], capture_output=True, text=True, check=True
        )
        row = json.loads(process.stdout)
        million = row["points"] / 1e6
        ground = "DEM" if task[3] else "from the points"
        print(
            f"| {row['scene']} | {ground} | {million:.2f} M | {row['found']} | {row['seconds']:.2f} "
            f"| {row['seconds'] / million:.2f} | {row['megabytes']:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
