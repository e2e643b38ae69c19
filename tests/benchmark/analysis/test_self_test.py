import numpy as np
import pytest

from roofbench.benchmark.analysis import self_test as under_test
from roofbench.benchmark.analysis.baseline import Baseline, BaselineScene, Measured
from roofbench.benchmark.analysis.gate import margins_of
from roofbench.benchmark.analysis.results import GateResult
from roofbench.benchmark.analysis.self_test import ALL_DETECTORS, self_test
from roofbench.benchmark.identity.provenance import CodeVersion
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe
from roofbench.evaluators.registry import make_evaluator
from roofbench.reports.self_test_text import format_self_test

EVALUATOR = make_evaluator("threshold-free")
INDICES = EVALUATOR.gated_indices()[:2]
MARGINS = margins_of([], INDICES)


def measurement(noise, rng, *, scenes=10, seeds=(0,)):
    """A detector ``steady`` without any scatter and one, ``chain``, whose runs scatter."""
    detectors = {}
    for label, spread in (("steady", 0.0), ("chain", noise)):
        runs = {
            (f"s-{number}", seed): {
                index.key: 0.5 + number / 100 + rng.normal(0, spread or 1e-300) for index in INDICES
            }
            for number in range(scenes)
            for seed in seeds
        }
        detectors[label] = Measured(PluginRecipe(label, {}), seeds, runs)
    return Baseline(
        suite="gate",
        version=CodeVersion("1", "abcdef", False),
        created="2026-01-01T00:00:00+00:00",
        evaluator=PluginRecipe("threshold-free", EVALUATOR.values()),
        scenes={f"s-{n}": BaselineScene(SceneRecipe.of_preset("hamlet", seed=n), f"hash{n}") for n in range(scenes)},
        detectors=detectors,
    )


def self_tested(noise, *, comparisons=400, level=0.2, margins=MARGINS, **more):
    rng = np.random.default_rng(5)
    sides = (measurement(noise, rng, **more) for _ in range(2))
    return self_test(*sides, indices=INDICES, margins=margins, level=level, comparisons=comparisons)


def rows(result):
    return {(row.detector, row.margins): row for row in result.rows}


def test_the_measured_rate_is_near_the_bound_without_margins_and_lower_with_them():
    found = rows(self_tested(0.005))
    assert found["chain", "none"].bound == 0.1
    assert found["chain", "none"].rate > 0.02
    assert found["chain", "none"].interval[0] <= 0.1
    assert found["chain", "gated"].rate < found["chain", "none"].rate
    assert found[ALL_DETECTORS, "none"].alarms == found["chain", "none"].alarms


def test_runs_that_do_not_differ_are_never_called_worse():
    row = rows(self_tested(0.005, comparisons=5))["steady", "gated"]
    assert (row.differ, row.rate, row.interval, row.bound) == (False, 0.0, (0.0, 0.0), 0.0)
    result = self_tested(0.0, comparisons=5)
    assert result.exit_code == 0
    assert not any(row.differ for row in result.rows)


def test_a_gate_that_believes_every_difference_fails_its_self_test(monkeypatch):
    def gullible(before, after, **_):
        (old,), (new,) = before.detectors.values(), after.detectors.values()
        mean = [np.mean([run[INDICES[0].key] for run in side.runs.values()]) for side in (old, new)]
        failures = ("worse",) if mean[1] < mean[0] else ()
        return GateResult(baseline="a", candidate="b", evaluator="e", conclusions=(), failures=failures, level=0.01)

    sound = under_test.compare
    monkeypatch.setattr(
        under_test, "compare", lambda a, b, **how: (gullible if len(a.detectors) == 1 else sound)(a, b, **how)
    )
    result = self_tested(0.005, comparisons=100)
    assert result.exit_code == 1
    assert rows(result)["chain", "gated"].rate == pytest.approx(0.5, abs=0.2)
    assert "Self-test failed" in format_self_test(result, "table")


def test_too_few_scenes_are_not_measurable():
    result = self_tested(0.005, comparisons=3, scenes=3, level=0.01)
    assert result.exit_code == 4
    assert "too few scenes" in format_self_test(result, "md")


def test_the_same_numbers_give_the_same_rates():
    assert self_tested(0.005, comparisons=20) == self_tested(0.005, comparisons=20)
