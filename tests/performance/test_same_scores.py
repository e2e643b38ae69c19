"""The comparison of two stores finds a change of one bit."""

import math
import shutil
import sqlite3

import pytest
from performance.same_scores import differences, read_runs

import roofbench as rb


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    path = tmp_path_factory.mktemp("same_scores") / "old.sqlite"
    rb.run(scenes=["hamlet"], detectors=["ndsm"], store=path)
    return path


def changed(store, path, statement, *values):
    shutil.copy(store, path)
    connection = sqlite3.connect(path)
    with connection:
        assert connection.execute(statement, values).rowcount == 1
    connection.close()
    return differences(read_runs(store), read_runs(path))


def test_a_store_equals_itself(store):
    runs = read_runs(store)
    (run,) = runs.values()
    assert run.values["threshold-free", "object.quality"] > 0.5
    assert differences(runs, runs) == []


def test_the_last_bit_of_an_index_is_a_difference(store, tmp_path):
    (run,) = read_runs(store).values()
    other = math.nextafter(run.values["threshold-free", "object.quality"], 0)
    statement = "UPDATE index_values SET value = ? WHERE name = 'object.quality'"
    (line,) = changed(store, tmp_path / "new.sqlite", statement, other)
    assert repr(other) in line


def test_a_lost_detection_a_lost_index_and_a_lost_run_are_differences(store, tmp_path):
    statements = {
        "other footprints": "DELETE FROM detections WHERE id = (SELECT min(id) FROM detections)",
        "object.quality is only in OLD": "DELETE FROM index_values WHERE name = 'object.quality'",
        "only in OLD": "DELETE FROM runs",
    }
    for number, (what, statement) in enumerate(statements.items()):
        (line,) = changed(store, tmp_path / f"{number}.sqlite", statement)
        assert line.endswith(what)
