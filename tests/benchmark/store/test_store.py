import shutil
import sqlite3
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from roofbench.benchmark.execution.runner import score_stored
from roofbench.benchmark.execution.worker import execute
from roofbench.benchmark.identity.keys import SourceClosure
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe
from roofbench.benchmark.plan import KeyedEvaluator
from roofbench.benchmark.store.outcomes import Outcome, Score
from roofbench.benchmark.store.records import RunIdentity, evaluation_key
from roofbench.benchmark.store.schema import MIGRATIONS, VERSION
from roofbench.benchmark.store.writer import Store
from roofbench.core.errors import InputError, RoofbenchError, UnknownNameError
from roofbench.evaluators.registry import make_evaluator
from roofbench.scenes.builtin import hamlet

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture
def store(tmp_path):
    with Store(tmp_path / "runs.sqlite") as opened:
        yield opened


@pytest.fixture
def keyed():
    return KeyedEvaluator.of(make_evaluator("threshold-free"))


def identity(seed=0, **parameters):
    recipe = SceneRecipe.of_preset("hamlet", seed=0)
    return RunIdentity(
        detector=PluginRecipe("misbehaving.py:Misbehaving", parameters),
        label="misbehaving",
        fingerprint="",
        code=SourceClosure({"m": "1"}, {"numpy": "2"}),
        scene=recipe,
        scene_key=recipe.key,
        seed=seed,
    )


@pytest.fixture
def outcome(task_of, keyed):
    task = replace(task_of(), evaluators=(keyed.recipe,), describe_scene=True)
    return execute(task)


def test_an_outcome_is_unchanged_by_the_transfer_between_processes(outcome):
    assert Outcome.from_bytes(outcome.to_bytes()) == outcome


def test_raw_detections_reference_and_indices_come_back_as_they_were(store, outcome, keyed):
    run_id = store.record(identity(), outcome, version="1")
    scene, drawn = store.scene(store.run(run_id).scene_id), hamlet(0)
    assert shapely.equals_identical(scene.reference.polygons, drawn.reference.polygons).all()
    assert np.array_equal(scene.reference.building_codes, drawn.reference.building_codes)
    assert scene.grid == drawn.image.grid
    assert scene.content_hash == drawn.content_hash
    detected = store.detections(run_id)
    assert [shapely.to_wkb(polygon) for polygon in detected.polygons] == list(outcome.detections)
    rebuilt = store.evaluation(run_id, keyed.evaluator, keyed.key)
    direct = keyed.evaluator.evaluate(detected, scene.reference, grid=scene.grid)
    assert dict(rebuilt.values) == dict(direct.values)
    stored = store.verdict_tables(run_id, keyed.key)
    for table, direct_table in zip(
        stored, (direct.verdicts.detection_table, direct.verdicts.reference_table), strict=True
    ):
        assert table.to_bytes() == direct_table.to_bytes()


def test_an_error_before_the_first_run_leaves_no_new_store_behind(tmp_path, outcome):
    def fail(error, *, records):
        with Store(tmp_path / "runs.sqlite") as opened:
            if records:
                opened.record(identity(), outcome, version="1")
            raise error

    for error in (InputError("mistyped"), KeyboardInterrupt()):
        with pytest.raises(type(error)):
            fail(error, records=False)
        assert (tmp_path / "runs.sqlite").exists() is isinstance(error, KeyboardInterrupt)
    (tmp_path / "runs.sqlite").unlink()
    for records in (True, False):
        with pytest.raises(InputError):
            fail(InputError("later"), records=records)
        assert (tmp_path / "runs.sqlite").exists()


def test_a_new_store_without_run_and_plan_is_removed_unless_another_process_has_it_open(tmp_path, outcome):
    path = tmp_path / "runs.sqlite"
    with Store(path):
        pass
    assert list(tmp_path.iterdir()) == []
    with Store(path) as opened:
        opened.save_plan("little", "roofbench run", {})
    assert path.exists()
    path.unlink()
    with Store(path):
        other = Store(path)
    other.record(identity(), outcome, version="1")
    other.close()
    with Store(path) as opened:
        assert len(list(opened.runs())) == 1


def test_a_good_result_is_not_replaced_unless_asked(store, outcome):
    first = store.record(identity(), outcome, version="1")
    assert store.record(identity(), outcome, version="2") == first
    assert store.run(first).version == "1"
    second = store.record(identity(), outcome, version="3", replace=True)
    assert [row.version for row in store.runs()] == ["3"]
    assert len(store.detections(second)) == len(outcome.detections)


def test_a_failure_is_a_row_that_a_later_result_replaces(store, outcome):
    failed = Outcome(status="failed", reason="no", traceback="Traceback")
    store.record(identity(), failed, version="1")
    assert store.statuses([identity().key])[identity().key][1:] == ("failed", "no")
    store.record(identity(), outcome, version="1")
    assert [row.status for row in store.runs()] == ["ok"]


def test_every_part_of_the_identity_changes_the_key():
    base = identity()
    others = [
        identity(seed=1),
        identity(side=9),
        replace(base, fingerprint="x"),
        replace(base, scene_key="other"),
        replace(base, code=SourceClosure({"m": "2"}, {"numpy": "2"})),
        replace(base, code=SourceClosure({"m": "1"}, {"numpy": "3"})),
    ]
    assert len({base.key, *(other.key for other in others)}) == 7
    assert replace(base, label="other name").key == base.key


def test_a_new_evaluator_uses_the_stored_detections(store, outcome):
    run_id = store.record(identity(), outcome, version="1")
    other = KeyedEvaluator.of(make_evaluator("threshold-free[matching=overlap]"))
    assert score_stored(store, run_id, (other,)) == 1
    assert store.evaluation(run_id, other.evaluator, other.key) is not None
    assert [recipe.parameters["matching"] for _, recipe in store.evaluators()] == ["nearest", "overlap"]


def test_runs_are_found_by_number_key_and_pattern(store, outcome):
    run_id = store.record(identity(), outcome, version="1")
    store.record(identity(seed=1), Outcome(status="failed", reason="no"), version="1")
    assert store.run(run_id).id == store.run(identity().key[:8]).id == run_id
    assert [row.seed for row in store.runs(status="failed")] == [1]
    assert len(store.runs(detector="mis*", scene="hamlet-?")) == 2
    assert store.runs(scene="knox*") == []
    with pytest.raises(UnknownNameError, match="no run named '99'"):
        store.run(99)


def test_a_file_that_is_no_store_or_a_newer_one_is_refused(tmp_path):
    (tmp_path / "text.sqlite").write_text("no database at all, but long enough to be taken for one" * 30)
    with pytest.raises(RoofbenchError, match="is not a results store"):
        Store(tmp_path / "text.sqlite")
    other = sqlite3.connect(tmp_path / "other.sqlite")
    other.execute("CREATE TABLE things (id)")
    other.close()
    with pytest.raises(InputError, match="a database of something else"):
        Store(tmp_path / "other.sqlite")
    other = sqlite3.connect(tmp_path / "other.sqlite")
    other.execute("PRAGMA user_version = 10400")  # as GeoPackages have it
    other.close()
    with pytest.raises(InputError, match="a database of something else"):
        Store(tmp_path / "other.sqlite")
    Store(tmp_path / "newer.sqlite").close()
    newer = sqlite3.connect(tmp_path / "newer.sqlite")
    newer.execute(f"PRAGMA user_version = {VERSION + 1}")
    newer.close()
    with pytest.raises(InputError, match="newer roofbench"):
        Store(tmp_path / "newer.sqlite")
    with pytest.raises(InputError, match="no such results store"):
        Store(tmp_path / "absent.sqlite", must_exist=True)


@pytest.mark.parametrize("size", [0, 1, 99])
def test_an_empty_file_is_no_store_and_is_not_filled(tmp_path, size):
    path = tmp_path / "cut.sqlite"
    path.write_bytes(bytes(size))
    with pytest.raises(InputError, match=rf"empty or cut off \({size} bytes\)"):
        Store(path, must_exist=True)
    assert path.read_bytes() == bytes(size)


def test_a_store_may_be_made_in_an_empty_file_as_mktemp_leaves_it(tmp_path):
    (tmp_path / "new.sqlite").touch()
    with Store(tmp_path / "new.sqlite") as store:
        assert store.count_runs() == 0


def test_a_store_of_version_0_1_shows_its_scores_and_scores_its_detections_again(tmp_path):
    path = tmp_path / "old.sqlite"
    shutil.copy(DATA / "store-0.1.db", path)
    with Store(path) as store:
        assert store.count_runs() == 1
        (row,) = store.runs()
        ((key, recipe),) = store.evaluators()
        evaluator = recipe.evaluator()
        stored = store.index_values([row.id], key)[row.id]
        rebuilt = store.evaluation(row.id, evaluator, key)
        assert stored["object.quality"] == rebuilt.object.quality == 22 / 31
        # The median follows from bins of 0.001 now; all others are the same to the last bit.
        assert rebuilt.values["geometric.median_iou"] == pytest.approx(stored["geometric.median_iou"], abs=1e-3)
        new = {key: value for key, value in rebuilt.values.items() if key not in stored}
        assert {**rebuilt.values, "geometric.median_iou": 0} == {**stored, **new, "geometric.median_iou": 0}
        assert {key.partition(".")[0] for key in new} == {"pixel_literal"}
        assert set(new.values()) == {None}, "version 0.1 did not measure them"
        scene = store.scene(row.scene_id)
        detected = store.detections(row.id)
        assert store.verdict_tables(row.id, key) is None
        again = evaluator.evaluate(detected, scene.reference, grid=scene.grid)
        # Sums are exact since version 0.2, in any order.
        for name, value in rebuilt.values.items():
            expected = None if value is None else pytest.approx(value, rel=1e-8)
            assert name in new or again.values[name] == expected, name
        assert 0 < again.pixel_literal.quality <= again.pixel.quality
        store.add_score(row.id, Score.of(again, recipe, "new code"))
        new_key = evaluation_key(recipe, "new code")
        assert store.verdict_tables(row.id, new_key)[1].count("FN") == rebuilt.counts.false_negatives == 9
    db = sqlite3.connect(path)
    assert db.execute("PRAGMA user_version").fetchone() == (VERSION,)
    db.close()


def test_a_store_of_the_first_schema_is_migrated_with_its_content(tmp_path):
    path = tmp_path / "old.sqlite"
    shutil.copy(DATA / "store-0.1.db", path)
    old = sqlite3.connect(path)
    old.executescript("ALTER TABLE scenes DROP COLUMN point_count; DROP TABLE scene_pictures; PRAGMA user_version = 1")
    old.close()
    with Store(path) as store:
        (row,) = store.runs()
        scene = store.scene(row.scene_id)
        assert scene.point_count is None
        assert store.scene_picture(scene.id) is None
        assert len(store.detections(row.id)) == 22


def test_every_migration_leads_to_the_schema_of_a_new_store(tmp_path):
    def schema(path):
        db = sqlite3.connect(path)
        columns = {
            (table, *column[1:3])
            for (table,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
            for column in db.execute(f"PRAGMA table_info({table})").fetchall()
        }
        db.close()
        return columns

    Store(tmp_path / "new.sqlite").close()
    first = sqlite3.connect(tmp_path / "first.sqlite")
    first.executescript(MIGRATIONS[0] + "PRAGMA user_version = 1")
    first.close()
    Store(tmp_path / "first.sqlite").close()
    assert schema(tmp_path / "first.sqlite") == schema(tmp_path / "new.sqlite")


WRITE = """
import sys
from roofbench.benchmark.store.writer import Store
from roofbench.benchmark.store.outcomes import Outcome, Score
sys.path.insert(0, sys.argv[3])
from test_store import identity
with Store(sys.argv[1]) as store:
    for seed in range(int(sys.argv[2]), int(sys.argv[2]) + 60):
        store.record(identity(seed=seed), Outcome(status="failed", reason="no"), version="1")
"""


def test_two_processes_write_to_one_store_at_once(tmp_path):
    import os
    from pathlib import Path

    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    path = tmp_path / "shared.sqlite"
    writers = [
        subprocess.Popen(
            [sys.executable, "-c", WRITE, str(path), str(start), str(Path(__file__).parent)], env=environment
        )
        for start in (0, 30)
    ]
    assert [writer.wait() for writer in writers] == [0, 0]
    with Store(path) as store:
        assert sorted(row.seed for row in store.runs()) == list(range(90))


@pytest.mark.parametrize("name", ["runs.sqlite", "what? 50% #1.sqlite"])
def test_a_store_in_a_folder_that_cannot_be_written_is_read(tmp_path, monkeypatch, name):
    from roofbench.benchmark.store import database

    Store(tmp_path / name).close()
    monkeypatch.setattr(database.os, "access", lambda *_: False)
    with Store(tmp_path / name, must_exist=True) as store:
        assert store.count_runs() == 0
    assert [file.name for file in tmp_path.iterdir()] == [name]
    db = database.connect(tmp_path / name)
    with pytest.raises(sqlite3.OperationalError, match="readonly"):
        db.execute("CREATE TABLE more (id)")
    db.close()


def test_texts_of_a_plugin_that_are_not_utf_8_are_escaped():
    """File names that are not UTF-8 hold lone surrogates, which no file can store."""
    outcome = Outcome(
        status="failed", reason="no file a\udcff.tif", metadata={"files": ["b\udcfe"]}, attributes={"name": ["ü\ud800"]}
    )
    assert outcome.reason == "no file a\\udcff.tif"
    assert outcome.metadata == {"files": ["b\\udcfe"]}
    assert outcome.attributes == {"name": ["ü\\ud800"]}
