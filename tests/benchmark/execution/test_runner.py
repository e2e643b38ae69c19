import re
from dataclasses import dataclass, replace

import numpy as np
import pytest

import roofbench as rb
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.execution.runner import run_plan
from roofbench.benchmark.identity import keys
from roofbench.benchmark.identity.keys import source_closure
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.benchmark.plan import make_plan, plan_content, suite_from_content
from roofbench.benchmark.store.writer import Store
from roofbench.benchmark.suite import DetectorEntry, Suite
from roofbench.core.processes import Limits
from roofbench.detectors.registry import make_detector
from roofbench.evaluators.registry import make_evaluator
from roofbench.scenes.builtin import hamlet


@pytest.fixture
def suite(misbehaving):
    """Two scenes; a detector with two seeds that fails on the second scene, and one that is good."""
    fails = make_detector(misbehaving, {"mode": "raises", "only_on": "hamlet-2"})
    good = make_detector(misbehaving, {"side": 9.0})
    return Suite(
        "pair",
        tuple(SceneRecipe.of_preset("hamlet", seed=seed) for seed in (1, 2)),
        (DetectorEntry(fails, (0, 1)), DetectorEntry(good)),
        (make_evaluator("threshold-free"),),
    )


def run(suite, path, *, jobs=0, rerun="missing", only_failed=False, **limits):
    with Store(path) as store:
        plan = make_plan(suite, store, rerun=rerun, only_failed=only_failed)
        result = run_plan(plan, store, execution=Execution(jobs=jobs, limits=Limits(**limits)))
        return plan, result, store.index_values([row.id for row in result.ok], plan.evaluators[0].key)


def test_failures_are_rows_and_the_rest_completes(suite, tmp_path):
    plan, result, values = run(suite, tmp_path / "a.sqlite")
    assert len(plan.runs) == result.done == len(result.rows) == 6
    assert [(row.scene, row.seed, row.reason) for row in result.failed] == [
        ("hamlet-2", 0, "ZeroDivisionError: no houses at all"),
        ("hamlet-2", 1, "ZeroDivisionError: no houses at all"),
    ]
    assert len(values) == 4


def test_what_is_stored_is_not_run_again_but_failures_are(suite, tmp_path):
    run(suite, tmp_path / "a.sqlite")
    plan, result, _ = run(suite, tmp_path / "a.sqlite")
    assert plan.counts() == {"nothing": 4, "detect": 2}
    assert result.done == 2
    plan, _, _ = run(suite, tmp_path / "a.sqlite", rerun="never")
    assert plan.counts() == {"nothing": 6}
    plan, _, _ = run(suite, tmp_path / "a.sqlite", rerun="always")
    assert plan.counts() == {"detect": 6}


def test_retry_failed_leaves_new_runs_alone(suite, tmp_path):
    run(replace(suite, scenes=suite.scenes[1:]), tmp_path / "a.sqlite")
    plan, _, _ = run(suite, tmp_path / "a.sqlite", only_failed=True)
    assert {(run.identity.scene.name, run.todo) for run in plan.runs} == {
        ("hamlet-1", "nothing"),
        ("hamlet-2", "detect"),
        ("hamlet-2", "nothing"),
    }


def test_retry_failed_evaluates_what_is_stored_and_names_what_it_leaves_out(suite, tmp_path):
    run(replace(suite, scenes=suite.scenes[1:]), tmp_path / "a.sqlite")
    corrected = replace(suite, evaluators=(make_evaluator("threshold-free[matching=overlap]"),))
    plan, result, _ = run(corrected, tmp_path / "a.sqlite", only_failed=True)
    assert {run.identity.scene.name for run in plan.left_out} == {"hamlet-1"}
    assert all("left out" in run.why for run in plan.left_out)
    good = {row.id for row in result.rows if row.status == "ok"}
    assert result.evaluated == len(good) > 0


def test_a_run_that_will_be_skipped_is_foreseen_without_reading_the_scene(tmp_path):
    bare = rb.Scene("bare", (0, 0, 50, 50), points=rb.PointCloud(*np.zeros((3, 4))))
    rb.save_scene(bare, tmp_path / "bare")
    scenes = (bare, SceneRecipe.of_folder(tmp_path / "bare"), SceneRecipe.of_preset("hamlet", seed=1))
    suite = Suite("s", scenes, (DetectorEntry(make_detector("original")),), (make_evaluator("threshold-free"),))
    with Store(tmp_path / "a.sqlite") as store:
        plan = make_plan(suite, store)
    assert [run.skip for run in plan.runs[:-1]] == [bare.lacks(("brightness",))] * (len(plan.runs) - 1)
    assert plan.runs[-1].skip == ""


def test_a_new_evaluator_reruns_no_detector(suite, tmp_path):
    run(suite, tmp_path / "a.sqlite")
    evaluated_again = replace(suite, evaluators=(make_evaluator("threshold-free[matching=overlap]"),))
    plan, result, values = run(evaluated_again, tmp_path / "a.sqlite", rerun="never")
    assert plan.counts() == {"evaluate": 4, "nothing": 2}
    assert (result.done, result.evaluated, len(values)) == (0, 4, 4)


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_do_not_depend_on_the_executor(suite, tmp_path, jobs):
    _, here, values = run(suite, tmp_path / "here.sqlite")
    _, there, values_there = run(suite, tmp_path / "there.sqlite", jobs=jobs, seconds=60)
    assert [(row.key, row.status, row.detected) for row in here.rows] == [
        (row.key, row.status, row.detected) for row in there.rows
    ]
    by_key = {row.key: values[row.id] for row in here.ok}
    assert by_key == {row.key: values_there[row.id] for row in there.ok}


def test_a_suite_is_resumed_from_the_store(suite, tmp_path):
    restored = suite_from_content(plan_content(suite))
    assert restored.scenes == suite.scenes
    assert restored.detectors == suite.detectors
    assert restored.evaluators == suite.evaluators


def test_the_plan_says_what_differs_from_the_stored_run(suite, tmp_path, monkeypatch):
    run(suite, tmp_path / "a.sqlite")
    source_closure.cache_clear()
    monkeypatch.setattr(keys, "_version", lambda top: "0.0.1" if top == "numpy" else None)
    with Store(tmp_path / "a.sqlite") as store:
        why = {run.why for run in make_plan(replace(suite, detectors=suite.detectors[1:]), store).runs}
    source_closure.cache_clear()
    (first, _) = sorted(why)
    assert re.search(r"package numpy changed \([\d.]+ to 0\.0\.1\);.* package shapely removed.* since run \d", first)


@dataclass(frozen=True, kw_only=True)
class Blind(rb.Detector):
    """Needs near infrared, which the built-in scene has not."""

    name = "blind"
    requires = ("nir",)

    def detect(self, scene, rng):
        raise AssertionError


@dataclass(frozen=True, kw_only=True)
class Truthless(rb.Detector):
    """Fails if it can see the truth."""

    name = "truthless"
    requires = ("points", "image", "dem")

    def detect(self, scene, rng):
        assert scene.reference is None
        assert scene.points.classification is None
        return rb.Footprints.empty()


def test_a_missing_input_is_a_skip_and_an_empty_result_is_a_result(tmp_path):
    board = rb.run(scenes=[hamlet(1)], detectors=[Blind(), Truthless()], store=tmp_path / "a.sqlite")
    with Store(tmp_path / "a.sqlite") as store:
        assert {(row.label, row.status, row.reason) for row in store.runs()} == {
            ("blind", "skipped", "scene 'hamlet-1' has no orthoimage with a near-infrared band"),
            ("truthless", "ok", ""),
        }
    pooled = {entry.label: entry for entry in board.entries if entry.pooling == "pooled"}
    assert pooled["truthless"].cells["object.completeness"].value == 0
    assert pooled["truthless"].cells["object.correctness"].value is None
    assert pooled["blind"].rank is None


def test_a_class_of_this_process_cannot_go_to_a_worker():
    with pytest.raises(rb.RoofbenchError, match="put it into a file"):
        rb.run(scenes=[hamlet(1)], detectors=[Truthless()], jobs=1)


def test_a_scene_object_goes_to_workers_exactly(misbehaving, tmp_path):
    scene = hamlet(3)
    with_workers = rb.run(scenes=[scene], detectors=[misbehaving], jobs=1)
    here = rb.run(scenes=[scene], detectors=[misbehaving])
    assert [e.cells for e in with_workers.entries] == [e.cells for e in here.entries]


def test_detect_gives_what_a_run_stores(misbehaving, tmp_path):
    scene = hamlet(3)
    rb.run(scenes=[scene], detectors=[misbehaving], seeds=[5], store=tmp_path / "a.sqlite")
    detected = rb.detect(scene, misbehaving, seed=5)
    with Store(tmp_path / "a.sqlite") as store:
        stored = store.detections(store.runs()[0].id)
    assert [p.wkb for p in stored.polygons] == [p.wkb for p in detected.polygons]
    other = rb.detect(scene, misbehaving, seed=6)
    assert [p.wkb for p in other.polygons] != [p.wkb for p in detected.polygons]
