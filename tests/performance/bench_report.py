"""How long a report takes: of the papers suite, and of a store of 10 000 runs.

Run by hand::

    roofbench run papers --store papers.sqlite
    python tests/performance/bench_report.py papers.sqlite

Prints processor and wall clock seconds of filling and of writing the page, and the page's size. Without a store it
measures the large one alone, which is made here: scenes of a hamlet under changed names, detections of random boxes,
evaluated as in a real run.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import shapely

import roofbench as rb
from roofbench.benchmark.analysis.report_contents import fill_report, newest_runs
from roofbench.benchmark.execution.worker import describe, machine_facts
from roofbench.benchmark.identity.keys import SourceClosure
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe
from roofbench.benchmark.plan import KeyedEvaluator
from roofbench.benchmark.store.outcomes import Cost, Outcome, Score
from roofbench.benchmark.store.records import RunIdentity
from roofbench.benchmark.store.writer import Store
from roofbench.reports.html_report import html_report
from roofbench.scenes.builtin import hamlet

RUNS, DETECTORS, VARIANTS = 10_000, 10, 7


def outcomes(scene, number):
    """Return what one detector finds, in a few variants that the scenes take in turns."""
    keyed = KeyedEvaluator.of(rb.make_evaluator("threshold-free"))
    rng = np.random.default_rng(number)
    found = []
    for _ in range(VARIANTS):
        kept = scene.reference.polygons[rng.random(len(scene.reference)) < 0.5 + 0.05 * number]
        moved = [shapely.affinity.translate(polygon, *rng.normal(0, 0.7, 2)) for polygon in kept]
        detected = rb.Footprints.of(moved, crs=scene.crs)
        evaluation = keyed.evaluator.evaluate(detected, scene.reference)
        found.append(
            Outcome(
                status="ok",
                cost=Cost(seconds=1.0, cpu_seconds=float(rng.gamma(2)), peak_memory=int(2e8)),
                detections=tuple(shapely.to_wkb(detected.polygons).tolist()),
                scores=(Score.of(evaluation, keyed.recipe, "benchmark"),),
                scene=describe(scene),
                machine=machine_facts(),
            )
        )
    return found


def large_store(path):
    """Write a store of many runs: every scene a hamlet of its own name."""
    scene = hamlet(1)
    found = [outcomes(scene, number) for number in range(DETECTORS)]
    with Store(path) as store:
        for place in range(RUNS // DETECTORS):
            name = f"hamlet-{place}"
            for number in range(DETECTORS):
                identity = RunIdentity(
                    detector=PluginRecipe(f"detector-{number}", {}),
                    label=f"detector-{number}",
                    fingerprint="",
                    code=SourceClosure({}, {}),
                    scene=SceneRecipe("builtin", name, "hamlet", place),
                    scene_key=name,
                    seed=0,
                )
                store.record(identity, found[number][place % VARIANTS], version="benchmark")


def measure(path):
    """Print the time of a report."""
    started = time.perf_counter(), time.process_time()
    with Store(path, must_exist=True) as store:
        rows = newest_runs(store)
        report = fill_report(store, rows, title="measured")
    filled = time.process_time()
    page = html_report(report)
    ended = time.perf_counter(), time.process_time()
    print(
        f"{len(rows):>6} runs, {len(report.scenes):>3} scenes drawn: CPU {ended[1] - started[1]:5.1f} s "
        f"(fill {filled - started[1]:.1f}, page {ended[1] - filled:.1f}), wall {ended[0] - started[0]:5.1f} s, "
        f"{len(page.encode()) / 1e6:.1f} MB"
    )
    for note in report.sampling:
        print(f"       {note}")


def main():
    for path in sys.argv[1:]:
        measure(path)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.sqlite"
        large_store(path)
        measure(path)


if __name__ == "__main__":
    main()
