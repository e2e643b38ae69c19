"""Time the synthetic scene generator: ``python tests/performance/bench_synthetic.py [PRESET ...]``.

CPU seconds of one process, the least of three repeats after one for the compiler, and the peak memory of the process
that makes everything once. Run it on an idle machine.
"""

import itertools
import resource
import subprocess
import sys
import time

import roofbench as rb

PRESETS = ("fairfield", "moonee-ponds", "knox", "toronto-a", "vaihingen-a", "fairfield-small", "knox-small")


def cpu_seconds(preset):
    """Return the CPU seconds of truth, DEM and points, and image."""
    scene = rb.make_scene(preset, seed=1)
    times = [time.process_time()]
    for piece in (lambda: scene.reference, lambda: (scene.dem, scene.points), lambda: scene.image):
        piece()
        times.append(time.process_time())
    return [after - before for before, after in itertools.pairwise(times)], scene


def _peak_memory(preset):
    words = [sys.executable, __file__, "--memory", preset]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()


def main(presets):
    # Before this process grows: a child's peak starts from its parent's.
    memory = {preset: _peak_memory(preset) for preset in presets}
    print("| preset | points | image, Mpx | truth, s | DEM and points, s | image, s | all, s | peak memory, MB |")
    print("|---|---|---|---|---|---|---|---|")
    for preset in presets:
        cpu_seconds(preset.removesuffix("-small") + "-small")
        runs = [cpu_seconds(preset) for _ in range(3)]
        best = [min(parts) for parts in zip(*(run[0] for run in runs), strict=True)]
        scene = runs[0][1]
        pixels = scene.image.grid.rows * scene.image.grid.columns / 1e6 if scene.image is not None else 0
        figures = " | ".join(f"{seconds:.2f}" for seconds in (*best, sum(best)))
        print(f"| {preset} | {len(scene.points)} | {pixels:.1f} | {figures} | {memory[preset]} |", flush=True)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--memory"]:
        cpu_seconds(sys.argv[2])
        print(round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024))
    else:
        main(sys.argv[1:] or PRESETS)
