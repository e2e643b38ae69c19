"""Measure what the framework adds to the detectors' time: ``python tests/performance/bench_overhead.py [SECONDS]``.

A sweep of 5 parameters x 5 values x 10 scenes (250 runs) on two workers with a detector that computes for so many
seconds (0.5). Counted in processor time, so that other work on the machine matters little: everything that this process
and its workers use beyond the detections, and what of it goes where. Opening the ten scenes and evaluating 250 results
are work that any script would do; they are measured apart in this process.
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import shapely

import roofbench as rb
from roofbench.benchmark.analysis.sweep import axis_of, make_sweep, sweep_table
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.execution.runner import run_plan
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.benchmark.store.writer import Store
from roofbench.benchmark.suite import DetectorEntry, Suite
from roofbench.detectors.registry import make_detector
from roofbench.evaluators.registry import make_evaluator

DETECTOR = '''
import time
from dataclasses import dataclass
import numpy as np
import roofbench as rb

@dataclass(frozen=True, kw_only=True)
class Busy(rb.Detector):
    """Computes for some seconds and finds squares on a lattice."""

    name = "busy"
    seconds: float = rb.parameter(0.5)
    a: int = rb.parameter(0)
    b: int = rb.parameter(0)
    c: int = rb.parameter(0)
    d: int = rb.parameter(0)
    e: int = rb.parameter(0)

    def detect(self, scene, rng):
        end = time.process_time() + self.seconds
        while time.process_time() < end:
            sum(range(1000))
        x, y = np.meshgrid(np.arange(12, 120, 24.0), np.arange(12, 120, 24.0))
        centres = np.stack([x.ravel(), y.ravel()], -1) + scene.extent[:2]
        return rb.Footprints.from_rectangles(centres[:, None] + np.array([(-4, -4), (4, -4), (4, 4), (-4, 4)]))
'''


def cpu_seconds():
    return sum(
        usage.ru_utime + usage.ru_stime
        for usage in (resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN))
    )


def work_of_any_script(scenes, runs):
    """Return the processor seconds of opening the scenes and of that many evaluations."""
    started = time.process_time()
    opened = [scene.open() for scene in scenes]
    opening = time.process_time() - started
    evaluator = make_evaluator("threshold-free")
    place = opened[0]
    detected = rb.Footprints.of(shapely.buffer(place.reference.polygons[:25], -0.5), crs=place.crs)
    started = time.process_time()
    for _ in range(runs):
        _ = evaluator.evaluate(detected, place.reference, grid=place.evaluation_grid).verdicts.detections
    return opening, time.process_time() - started


def start_of_a_worker():
    """Return the processor seconds of a fresh Python that imports what a worker needs."""
    before = cpu_seconds()
    subprocess.run([sys.executable, "-c", "import roofbench.benchmark.execution.worker"], check=True)
    return cpu_seconds() - before


def main():
    seconds = sys.argv[1] if len(sys.argv) > 1 else "0.5"
    own = time.process_time
    with tempfile.TemporaryDirectory() as folder:
        plugin = Path(folder) / "busy.py"
        plugin.write_text(DETECTOR)
        detector = make_detector(f"{plugin}:Busy", {"seconds": seconds})
        scenes = tuple(SceneRecipe.of_preset("hamlet", seed=seed) for seed in range(10))
        suite = Suite("overhead", scenes, (DetectorEntry(detector),), (make_evaluator("threshold-free"),))
        with Store(Path(folder) / "a.sqlite") as store:
            wall, cpu, started = time.perf_counter(), cpu_seconds(), own()
            sweep = make_sweep(suite, [axis_of(f"{name}=1,2,3,4,5") for name in "abcde"], store)
            planned = own()
            result = run_plan(sweep.plan, store, execution=Execution(jobs=2))
            stored = own()
            sweep_table(sweep, store, {row.key: row for row in result.rows})
            wall, cpu, ended = time.perf_counter() - wall, cpu_seconds() - cpu, own()
    rows = result.rows
    detecting = sum(row.cpu_seconds for row in rows)
    opening, evaluating = work_of_any_script(scenes, len(rows))
    table = {
        "planning: keys of code, scenes and runs": planned - started,
        "main process: handing out, reading outcomes, storing": stored - planned,
        "table with intervals (pandas and scipy are imported)": ended - stored,
        "start of two workers": 2 * start_of_a_worker(),
    }
    table["workers: the rest (scene pictures, checks, messages)"] = (
        cpu - detecting - opening - evaluating - sum(table.values())
    )
    framework = sum(table.values())
    print(f"{len(rows)} runs, {wall:.1f} s wall on 2 workers (ideal {sum(row.seconds for row in rows) / 2:.1f} s)\n")
    print("| what | s CPU | % of the detectors' time |\n|---|--:|--:|")
    for name, used in {
        "detectors": detecting,
        **table,
        "**framework**": framework,
        "opening ten scenes": opening,
        "evaluating, verdicts included": evaluating,
        "**framework, scenes and evaluation**": framework + opening + evaluating,
    }.items():
        print(f"| {name} | {used:.2f} | {used / detecting * 100:.1f} |")
    print(f"\nframework: {framework / len(rows) * 1e3:.1f} ms a run")


if __name__ == "__main__":
    main()
