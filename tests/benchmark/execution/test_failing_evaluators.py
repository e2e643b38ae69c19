"""Each evaluator fails alone: detections and the scores of other evaluators are kept."""

import re
from pathlib import Path

import pytest

import roofbench as rb
from roofbench.benchmark.analysis.leaderboard import make_leaderboard
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.execution.runner import run_plan, score_stored
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.benchmark.plan import make_plan
from roofbench.benchmark.store.writer import Store
from roofbench.benchmark.suite import DetectorEntry, Suite
from roofbench.detectors.registry import make_detector
from roofbench.evaluators.registry import make_evaluator
from roofbench.reports.run_text import format_run
from roofbench.scenes.builtin import hamlet

FAILING = f"{Path(__file__).parents[2] / 'plugins' / 'failing_evaluator.py'}:Failing"


def suite_of(misbehaving, *evaluators, scene=None):
    scene = SceneRecipe.of_preset("hamlet", seed=1) if scene is None else scene
    entries = (DetectorEntry(make_detector(misbehaving)),)
    return Suite("s", (scene,), entries, tuple(map(make_evaluator, evaluators)))


def run(suite, path, jobs=0):
    with Store(path) as store:
        plan = make_plan(suite, store)
        result = run_plan(plan, store, execution=Execution(jobs=jobs))
        boards = [make_leaderboard(result.rows, store, keyed, title="t") for keyed in plan.evaluators]
    return plan, result, boards


@pytest.mark.parametrize("jobs", [0, 1])
def test_an_evaluator_that_raises_costs_no_detection_and_no_other_score(misbehaving, tmp_path, jobs):
    suite = suite_of(misbehaving, "threshold-free", FAILING)
    _, result, (good, bad) = run(suite, tmp_path / "a.sqlite", jobs)
    assert [row.status for row in result.rows] == ["ok"]
    assert good.entries[0].rank == 1
    assert (bad.entries[0].rank, bad.entries[0].scenes) == (None, 0)
    (unsuccessful,) = bad.unsuccessful
    assert unsuccessful.status == "not evaluated"
    assert unsuccessful.reason == "failing: ZeroDivisionError: no roof at all"
    assert unsuccessful.command == f"roofbench score -e {FAILING}"
    with Store(tmp_path / "a.sqlite") as store:
        text = format_run(store, result.rows[0])
    assert re.search(r"  evaluator  .*failing_evaluator\.py:Failing  \{.*\} failed: ZeroDivisionError: no roof", text)
    assert text.count("  evaluator  ") == 1


def test_a_crash_during_the_evaluation_costs_no_detection(misbehaving, tmp_path):
    _, result, (board,) = run(suite_of(misbehaving, f"{FAILING}[mode=crashes]"), tmp_path / "a.sqlite", jobs=1)
    assert [(row.status, row.detected) for row in result.rows] == [("ok", 25)]
    assert board.unsuccessful[0].reason == "failing[mode=crashes]: the worker process exited with code 7"


def test_a_repaired_evaluator_evaluates_what_is_stored(misbehaving, tmp_path, monkeypatch):
    suite = suite_of(misbehaving, FAILING)
    run(suite, tmp_path / "a.sqlite")
    monkeypatch.setenv("ROOFBENCH_REPAIRED", "yes")
    plan, result, (board,) = run(suite, tmp_path / "a.sqlite")
    assert plan.runs[0].todo == "evaluate"
    assert plan.runs[0].why.endswith("(failed before: ZeroDivisionError: no roof at all)")
    assert (result.done, result.evaluated, board.unsuccessful) == (0, 1, ())
    assert board.entries[0].rank == 1


def test_score_repairs_what_an_evaluator_cannot_evaluate(misbehaving, tmp_path):
    """The suite in the docs asks for areas in pixels, which a scene without an image does not have."""
    village = hamlet(1)
    scene = rb.Scene("bare", village.extent, crs=village.crs, points=village.points, reference=village.reference)
    suite = suite_of(misbehaving, "threshold-free[area=pixels]", scene=scene)
    plan, result, (board,) = run(suite, tmp_path / "a.sqlite")
    (warning,) = plan.warnings
    assert warning.startswith(
        "threshold-free[area=pixels] cannot evaluate on bare (no orthoimage): area by pixels needs"
    )
    assert "needs a ground sampling distance" in board.unsuccessful[0].reason
    exact = suite_of(misbehaving, "threshold-free[area=exact]", scene=scene)
    with Store(tmp_path / "a.sqlite") as store:
        plan = make_plan(exact, store)
        assert plan.runs[0].todo == "evaluate"
        assert score_stored(store, result.rows[0].id, plan.evaluators) == 1
