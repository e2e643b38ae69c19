"""CPU time of the marked point process on the presets, JIT compilation excluded.

Run by hand: ``python tests/benchmarks/bench_mpp.py``.

The median of three runs with one worker, from arrays in memory to rectangles, and the proposals of the chains.
"""

import statistics
import sys
import time

import numpy as np

import roofbench as rb


def main() -> None:
    names = sys.argv[1:] or ["toronto-a", "vaihingen-a"]
    rb.make_detector("mpp").detect(rb.make_scene("fairfield-small", seed=1), np.random.default_rng(0))
    print("preset          points  CPU s  proposals  rectangles")
    for name in names:
        scene = rb.make_scene(name, seed=1)
        points = scene.points
        assert points is not None
        scene = rb.Scene(name, scene.extent, crs=scene.crs, points=points, dem=scene.dem)
        seconds = []
        for _ in range(3):
            began = time.process_time()
            found = rb.make_detector("mpp").detect(scene, np.random.default_rng(0))
            seconds.append(time.process_time() - began)
        proposals = found.metadata["trace"]["proposals"][-1]
        print(f"{name:14s} {len(points):8d} {statistics.median(seconds):6.2f} {proposals:10.0f} {len(found):11d}")


if __name__ == "__main__":
    main()
