"""Speed and memory of the line detectors.

Run by hand: ``python tests/performance/bench_lines.py [--scenes fairfield-1,fairfield] [--repeats 5]``.

Each detector runs on a synthetic scene that is already in memory, in one thread, after the kernels are compiled. CPU
seconds, the median and the least of the repeats, in all and by stage; a stage is a call of one of the functions below,
what remains is numpy between them. Memory: the highest resident set during a detection, less what the process held
before it had the scene, against the size of the image; it counts the scene itself.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections import defaultdict
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

STAGES = {
    "ground and masks": ("pulse_spacing", "ground_heights", "build_masks"),
    "prefix sums": ("prefix_sums", "vegetation_prefix"),
    "entropy": ("local_entropy", "grey_levels"),
    "contours and corners": ("trace_shapes", "find_corners", "fit_segments", "inside_first"),
    "lines: tests, adjustment, extension": (
        "mean_in_boxes", "adjust_to_neighbours", "adjust_to_shape", "extend_lines",
    ),
    "image edges": ("extract_edges",),
    "votes": ("longest_image_lines", "cast_votes"),
    "initial rectangles": ("initial_rectangles",),
    "final rectangles, duplicates": ("final_rectangles", "find_duplicates"),
    "orientation histograms": ("texture_of",),
}  # fmt: skip


def clocked(seconds):
    """Replace the stage functions, where the detectors look them up, by ones that add up their CPU seconds."""
    from roofbench.detectors.lines import improved, original
    from roofbench.detectors.lines import line_detector as detector

    def timed(function, stage):
        def call(*args, **named):
            start = time.process_time()
            result = function(*args, **named)
            seconds[stage] += time.process_time() - start
            return result

        return call

    for module in (detector, improved, original):
        for stage, names in STAGES.items():
            for name in names:
                if hasattr(module, name):
                    setattr(module, name, timed(getattr(module, name), stage))


def resident(key):
    """Return VmRSS or VmHWM of this process, bytes."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(key):
            return int(line.split()[1]) * 1024
    raise LookupError(key)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default="fairfield-1,fairfield")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()

    import cv2
    import numpy as np

    import roofbench as rb

    cv2.setNumThreads(1)
    seconds = defaultdict(float)
    clocked(seconds)
    folder = Path(os.environ.get("ROOFBENCH_BENCH_SCENES", "bench-scenes"))
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("fairfield-1-small", *options.scenes.split(",")):
        if not (folder / f"{name}-{options.seed}").exists():
            rb.save_scene(rb.make_scene(name, seed=options.seed), folder / f"{name}-{options.seed}")
    warm = rb.open_scene(folder / f"fairfield-1-small-{options.seed}").for_detection()
    detectors = {name: rb.make_detector(name) for name in ("original", "improved")}
    for detector in detectors.values():
        detector.detect(warm, np.random.default_rng(0))
    for scene_name in options.scenes.split(","):
        for name, detector in detectors.items():
            empty = resident("VmRSS")
            scene = rb.open_scene(folder / f"{scene_name}-{options.seed}").for_detection()
            image, points = scene.image, scene.points
            assert scene.dem is not None
            Path("/proc/self/clear_refs").write_text("5")
            runs, stages = [], []
            for _ in range(options.repeats):
                seconds.clear()
                start = time.process_time()
                found = detector.detect(scene, np.random.default_rng(0))
                runs.append(time.process_time() - start)
                stages.append(dict(seconds))
            held = resident("VmHWM") - empty
            megapixels = image.values[0].size / 1e6
            print(
                f"{name} on {scene_name}: {megapixels:.1f} Mpx, {len(points):,} points, {len(found)} found: "
                f"{statistics.median(runs):.3f} s (least {min(runs):.3f} s), "
                f"memory {held / 1e6:.0f} MB = {held / image.values.nbytes:.1f} x image"
            )
            for stage in STAGES:
                if any(stage in run for run in stages):
                    print(f"    {stage:<36s}{statistics.median(run.get(stage, 0.0) for run in stages) * 1e3:8.1f} ms")
            del scene, image, points, found


if __name__ == "__main__":
    main()
