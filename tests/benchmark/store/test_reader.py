"""Queries of the results store, on outcomes made by hand."""

import numpy as np
import pytest
import shapely

from roofbench.benchmark.identity.keys import SourceClosure
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe
from roofbench.benchmark.plan import KeyedEvaluator
from roofbench.benchmark.store.outcomes import Cost, Outcome, SceneRecord, Score
from roofbench.benchmark.store.reader import StoreReader
from roofbench.benchmark.store.records import RunIdentity
from roofbench.benchmark.store.writer import Store
from roofbench.core.errors import InputError, UnknownNameError
from roofbench.evaluators.registry import make_evaluator
from roofbench.scenes.geodata.footprints import Footprints

REFERENCE = Footprints.of([shapely.box(0, 0, 10, 10), shapely.box(20, 0, 30, 10)], crs="EPSG:25832")
DETECTED = Footprints.of([shapely.box(1, 0, 11, 10)], crs="EPSG:25832")
KEYED = KeyedEvaluator.of(make_evaluator("threshold-free"))
OTHER = KeyedEvaluator.of(make_evaluator("threshold-free[matching=overlap]"))


def identity(label="one", scene=1, seed=0):
    recipe = SceneRecipe.of_preset("hamlet", seed=scene)
    return RunIdentity(
        detector=PluginRecipe("ndsm", {"height": 2.5}),
        label=label,
        fingerprint=label,
        code=SourceClosure({"module": "digest"}, {"numpy": "2"}),
        scene=recipe,
        scene_key=recipe.key,
        seed=seed,
    )


def record(**changes):
    facts = {
        "content_hash": "hash",
        "crs": "EPSG:25832",
        "extent": (0.0, 0.0, 100.0, 50.0),
        "grid": (0.0, 50.0, 0.5, 100, 200),
        "area": shapely.to_wkb(shapely.box(0, 0, 50, 50)),
        "reference": tuple(shapely.to_wkb(REFERENCE.polygons).tolist()),
        "reference_ids": (4, 7),
        "building_ids": ("a", "b"),
        "point_count": 1200,
        "picture": b"webp",
    }
    return SceneRecord(**{**facts, **changes})


def good(*evaluators, scene=None):
    scores = (Score.of(keyed.evaluator.evaluate(DETECTED, REFERENCE), keyed.recipe, keyed.code) for keyed in evaluators)
    return Outcome(
        status="ok",
        cost=Cost(seconds=2.0, cpu_seconds=1.5, peak_memory=10**8),
        detections=tuple(shapely.to_wkb(DETECTED.polygons).tolist()),
        attributes={"height": [7.5]},
        metadata={"ground": "DEM"},
        scores=tuple(scores),
        scene=scene,
        machine={"host": "here"},
    )


@pytest.fixture
def store(tmp_path):
    with Store(tmp_path / "runs.sqlite") as opened:
        opened.record(identity(), good(KEYED, OTHER, scene=record()), version="1")
        opened.record(identity("two", scene=2), good(KEYED, scene=record(reference=None, area=None)), version="1")
        opened.record(identity("one", seed=1), Outcome(status="failed", reason="no roof"), version="2")
        yield opened


def test_a_store_is_a_reader(store):
    assert isinstance(store, StoreReader)
    assert store.count_runs() == 3


def test_runs_come_the_newest_first_and_are_filtered(store):
    assert [row.id for row in store.runs()] == [3, 2, 1]
    assert [row.id for row in store.runs(limit=2)] == [3, 2]
    assert [row.id for row in store.runs(status="ok", detector="t*")] == [2]
    assert [row.id for row in store.runs(scene="hamlet-1")] == [3, 1]
    assert store.runs(detector="TWO") == []


def test_a_row_holds_what_was_recorded(store):
    row = store.run(1)
    assert (row.label, row.scene, row.seed, row.status, row.detected) == ("one", "hamlet-1", 0, "ok", 1)
    assert (row.seconds, row.cpu_seconds, row.peak_memory) == (2.0, 1.5, 10**8)
    assert row.parameters == {"height": 2.5}
    assert row.recipe == SceneRecipe.of_preset("hamlet", seed=1)
    assert store.run(3).detected is None


def test_a_run_is_found_by_number_or_by_enough_of_its_key(store):
    key = identity().key
    assert store.run(key).id == store.run(key[:8]).id == store.run("1").id == 1
    for wrong in (key[:3], "99", "zzzz"):
        with pytest.raises(UnknownNameError, match="no run named"):
            store.run(wrong)


def test_statuses_and_rows_of_more_keys_than_a_query_takes(store):
    keys = [*(f"absent{number}" for number in range(1200)), identity().key, identity("one", seed=1).key]
    assert store.statuses(keys) == {keys[-2]: (1, "ok", ""), keys[-1]: (3, "failed", "no roof")}
    assert {key: row.id for key, row in store.runs_of(keys).items()} == {keys[-2]: 1, keys[-1]: 3}


def test_the_latest_run_like_another(store):
    assert store.latest_like("one", "hamlet-1", 1) == 3
    assert store.latest_like("one", "hamlet-2", 1) is None


def test_evaluations_of_one_evaluator_only_and_of_the_runs_asked_for(store):
    assert store.evaluated([1, 2, 3], KEYED.key) == {1, 2}
    assert store.evaluated([1, 2, 3], OTHER.key) == {1}
    assert store.evaluations([2], KEYED.evaluator, KEYED.key).keys() == {2}
    direct = KEYED.evaluator.evaluate(DETECTED, REFERENCE)
    assert dict(store.evaluation(1, KEYED.evaluator, KEYED.key).values) == dict(direct.values)
    assert store.evaluation(3, KEYED.evaluator, KEYED.key) is None
    assert store.index_values([1, 3], KEYED.key) == {1: dict(direct.values)}


def test_evaluators_in_the_order_of_their_first_evaluation(store):
    assert [key for key, _ in store.evaluators()] == [KEYED.key, OTHER.key]
    assert [key for key, _ in store.evaluators_of(2)] == [KEYED.key]
    assert store.evaluators_of(3) == []


def test_verdicts_are_those_of_the_evaluation(store):
    detection, reference = store.verdict_tables(1, KEYED.key)
    direct = KEYED.evaluator.evaluate(DETECTED, REFERENCE).verdicts
    assert detection.to_bytes() == direct.detection_table.to_bytes()
    assert reference.to_bytes() == direct.reference_table.to_bytes()
    assert store.verdict_tables(3, KEYED.key) is None


def test_detections_keep_geometry_attributes_and_crs(store):
    detected = store.detections(1)
    assert shapely.equals_identical(detected.polygons, DETECTED.polygons).all()
    assert detected.attributes["height"].tolist() == [7.5]
    assert detected.crs == "EPSG:25832"
    assert len(store.detections(3)) == 0


def test_a_scene_comes_back_with_reference_area_and_grid(store):
    scene = store.scene(store.run(1).scene_id)
    assert shapely.equals_identical(scene.reference.polygons, REFERENCE.polygons).all()
    assert scene.reference.ids.tolist() == [4, 7]
    assert scene.reference.building_ids.tolist() == ["a", "b"]
    assert scene.area.equals(shapely.box(0, 0, 50, 50))
    assert (scene.grid.gsd, scene.grid.shape, scene.point_count) == (0.5, (100, 200), 1200)
    assert store.scene_picture(scene.id) == b"webp"
    bare = store.scene(store.run(2).scene_id)
    assert (bare.reference, bare.area) == (None, None)
    with pytest.raises(UnknownNameError, match="no scene 99"):
        store.scene(99)


def test_facts_of_all_scenes_at_once(store):
    first, second = store.run(1).scene_id, store.run(2).scene_id
    assert store.described_scenes() == {identity().scene_key, identity(scene=2).scene_key}
    assert store.scene_sizes() == {first: (1200, 0.5), second: (1200, 0.5)}
    assert store.scene_hashes() == {first: "hash", second: "hash"}
    assert store.reference_counts() == {first: 2, second: None}


def test_a_scene_that_was_never_opened_has_no_facts(tmp_path):
    with Store(tmp_path / "a.sqlite") as store:
        store.record(identity(), Outcome(status="failed", reason="no file"), version="1")
        scene = store.scene(store.run(1).scene_id)
        assert (scene.content_hash, scene.reference, scene.extent) == (None, None, None)
        assert store.scene_picture(scene.id) is None
        assert store.described_scenes() == set()
        assert (store.reference_counts(), store.scene_sizes()) == ({}, {})


def test_code_machine_and_metadata_of_a_run(store):
    assert store.code(1) == SourceClosure({"module": "digest"}, {"numpy": "2"})
    assert (store.machine(1), store.machine(3)) == ({"host": "here"}, {})
    assert store.metadata(1) == {"ground": "DEM"}


def test_plans_are_kept_once_and_the_last_one_is_resumed(store):
    with pytest.raises(InputError, match="no plan to resume"):
        store.last_plan()
    store.save_plan("a", "roofbench run a", {"name": "a"})
    store.save_plan("b", "roofbench run b", {"name": "b"})
    store.save_plan("a", "roofbench run a -j 2", {"name": "a"})
    assert store.last_plan() == {"name": "a"}
    assert store.commands() == ["roofbench run b", "roofbench run a -j 2"]


def test_nan_in_attributes_is_none(tmp_path):
    from roofbench.core.plain_values import plain_value

    values = [plain_value(value) for value in (np.float32(0.5), np.int64(3), np.nan, None, "text", True)]
    assert values == [0.5, 3, None, None, "text", True]
    assert [type(value) for value in values[:2]] == [float, int]


def test_notes_of_runs_and_no_others(store):
    noted = Outcome(
        status="ok",
        cost=Cost(seconds=1.0, cpu_seconds=1.0, peak_memory=1),
        metadata={"notes": ["no DEM"], "cues": ["texture", "returns"]},
    )
    other = Outcome(status="ok", cost=Cost(seconds=1.0, cpu_seconds=1.0, peak_memory=1), metadata={"notes": "a text"})
    first = store.record(identity("noted"), noted, version="1")
    second = store.record(identity("other"), other, version="1")
    assert store.run_notes([1, 2, 3, first, second]) == {first: ("no DEM",)}
    assert store.run_notes([1]) == {}
    assert store.run_cues([1, 2, 3, first, second]) == {first: ("texture", "returns")}


@pytest.mark.parametrize(
    ("damage", "read"),
    [
        ("UPDATE scene_references SET wkb = x'0103'", lambda store: store.scene(1)),
        ("UPDATE scenes SET grid = '[1, 2,'", lambda store: store.scene(1)),
        ("UPDATE scenes SET grid = '[1, 2]'", lambda store: store.scene(1)),
        ("UPDATE scenes SET area = x'00'", lambda store: store.scene(1)),
        ("UPDATE scenes SET recipe = '[]'", lambda store: store.runs()[0].recipe),
        ("UPDATE scenes SET extent = '[]'", lambda store: store.scene_sizes()),
        ("UPDATE runs SET parameters = '{'", lambda store: store.runs()[0].parameters),
        ("UPDATE detections SET wkb = x'01'", lambda store: store.detections(1)),
        ("UPDATE evaluations SET tallies = '{'", lambda store: store.evaluation(1, KEYED.evaluator, KEYED.key)),
        ("UPDATE evaluations SET parameters = ''", lambda store: store.evaluators_of(1)),
        ("UPDATE codes SET modules = '{'", lambda store: store.code(1)),
    ],
)
def test_a_damaged_cell_is_named_in_one_sentence(store, damage, read):
    store._db.execute(damage)
    with pytest.raises(InputError, match="damaged"):
        read(store)
