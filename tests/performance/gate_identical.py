"""Gate detectors against themselves with fresh seeds: ``python tests/performance/gate_identical.py [STORE]``.

A stochastic detector (``mpp[optimiser=rjmcmc]``) on the scenes of the suite ``gate``: one baseline and fifty
candidates, no seed used twice, with one and with five chains a scene; and 2 000 random pairs of a baseline and a
candidate, for the share of false alarms. A deterministic one (``ndsm``): fifty times ten fresh scenes, each measured
twice, in one and in two workers.
"""

import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from roofbench.benchmark.analysis.baseline import Measured
from roofbench.benchmark.analysis.gate import compare_detector, margins_of
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.execution.runner import run_plan
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe
from roofbench.benchmark.plan import make_plan
from roofbench.benchmark.store.writer import Store
from roofbench.benchmark.suite import DetectorEntry, Suite, named_suite
from roofbench.detectors.registry import make_detector
from roofbench.evaluators.registry import make_evaluator

CANDIDATES, PAIRS, SCENES = 50, 2000, 10
SAMPLER = "mpp[optimiser=rjmcmc]"
EVALUATOR = make_evaluator("threshold-free")
INDICES = EVALUATOR.gated_indices()
MARGINS = margins_of([], INDICES)


def values_of(suite, store, jobs=1):
    """Run a suite and return its index values by scene and seed."""
    plan = make_plan(suite, store)
    rows = run_plan(plan, store, execution=Execution(jobs=jobs)).ok
    values = store.index_values([row.id for row in rows], plan.evaluators[0].key)
    return {(row.scene, row.seed): values[row.id] for row in rows}


def verdicts(before, after):
    sides = (Measured(PluginRecipe("detector", {}), (), runs) for runs in (before, after))
    return [found.conclusion for found in compare_detector("detector", *sides, indices=INDICES, margins=MARGINS)]


def stochastic(store):
    scenes = named_suite("gate").scenes
    seeds = tuple(range(5 * (CANDIDATES + 1)))
    found = values_of(Suite("mpp", scenes, (DetectorEntry(make_detector(SAMPLER), seeds),), (EVALUATOR,)), store)

    def chains(chosen):
        return {(scene.name, seed): found[scene.name, seed] for scene in scenes for seed in chosen}

    for count in (1, 5):
        starts = range(0, count * (CANDIDATES + 1), count)
        baseline, *candidates = (chains(seeds[start : start + count]) for start in starts)
        results = [verdicts(baseline, candidate) for candidate in candidates]
        passed = sum("worse" not in result for result in results)
        message = dict(Counter(verdict for result in results for verdict in result))
        print(f"{SAMPLER}, {count} chains a scene: {passed} of {CANDIDATES} passed; verdicts {message}")
        rng = np.random.default_rng(count)
        alarms = 0
        for _ in range(PAIRS):
            drawn = rng.permutation(seeds)[: 2 * count].tolist()
            alarms += "worse" in verdicts(chains(drawn[:count]), chains(drawn[count:]))
        print(f"  of {PAIRS} random pairs {alarms} are called worse", flush=True)


def deterministic(folder):
    recipes = tuple(SceneRecipe.of_preset("hamlet", seed=seed) for seed in range(CANDIDATES * SCENES))
    suite = Suite("ndsm", recipes, (DetectorEntry(make_detector("ndsm")),), (EVALUATOR,))
    sides = []
    for jobs in (1, 2):
        with Store(folder / f"{jobs}.sqlite") as store:
            sides.append(values_of(suite, store, jobs))
    passed = 0
    for start in range(0, len(recipes), SCENES):
        names = {recipe.name for recipe in recipes[start : start + SCENES]}
        before, after = ({run: values for run, values in side.items() if run[0] in names} for side in sides)
        passed += set(verdicts(before, after)) == {"equal"}
    print(f"ndsm, {SCENES} fresh scenes each time: {passed} of {CANDIDATES} passed, all indices equal")


def main():
    with tempfile.TemporaryDirectory() as name:
        with Store(sys.argv[1] if len(sys.argv) > 1 else Path(name) / "mpp.sqlite") as store:
            stochastic(store)
        deterministic(Path(name))


if __name__ == "__main__":
    main()
