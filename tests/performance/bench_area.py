"""Speed per point on growing areas: ``python tests/performance/bench_area.py TOWN WIDTH HEIGHT --detectors mpp ndsm``.

TOWN is a folder of tiles, for instance the mirrored town of `bench_city`; WIDTH and HEIGHT, metres, are those of one
copy. Windows of 1 x 1, 2 x 2, ... copies are read and detected as a whole, in one process. Printed: processor seconds
of the detector for a million points, the median of the repeats.
"""

import argparse
import statistics
import time

import pandas as pd

from roofbench.detectors.registry import make_detector
from roofbench.scenes.folder import open_scene


def seconds_of(detector, scene, repeats):
    """Return the median of the processor seconds of a detection."""
    seconds = []
    for _ in range(repeats):
        started = time.process_time()
        detector.detect(scene)
        seconds.append(time.process_time() - started)
    return statistics.median(seconds)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("town")
    parser.add_argument("width", type=float)
    parser.add_argument("height", type=float)
    parser.add_argument("--detectors", nargs="+", default=["mpp", "ndsm"])
    parser.add_argument("--sides", nargs="+", type=int, default=[1, 2, 4])
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    town = open_scene(options.town)
    west, south = town.extent[:2]
    rows = []
    for side in options.sides:
        extent = (west, south, west + side * options.width, south + side * options.height)
        scene = town.window(extent).for_detection()
        row = {"copies": side * side, "million points": round(len(scene.points) / 1e6, 2)}
        for name in options.detectors:
            detector = make_detector(name)
            if not rows:
                detector.detect(scene)  # compiles
            row[name] = round(seconds_of(detector, scene, options.repeats) / (len(scene.points) / 1e6), 2)
        rows.append(row)
        print(pd.DataFrame(rows).to_markdown(index=False), flush=True)


if __name__ == "__main__":
    main()
