"""Cities of suites: computed by all workers, resumed tile by tile, evaluated in parts with the numbers of the whole."""

import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack

import numpy as np
import pytest
import shapely
from builders.town import HOUSES, town
from harness.command_line import run

import roofbench as rb
from roofbench.benchmark.execution import city_runs, worker
from roofbench.benchmark.execution.city import remove_tiles
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.execution.runner import run_plan
from roofbench.benchmark.plan import make_plan
from roofbench.benchmark.store.writer import Store
from roofbench.benchmark.suite import read_suite
from roofbench.core.output import is_scratch, whole_file
from roofbench.detectors.tiling import tiles_over
from roofbench.evaluators.verdict_table import VerdictTable
from roofbench.scenes.folder import save_scene, write_reference
from roofbench.scenes.geodata.las_files import write_points
from roofbench.scenes.importing.tile_index import index_folder

SUITE = """
[[scenes]]
path = "town"
tile = 64
[[detectors]]
use = "ndsm"
cell = 0.5
[[evaluators]]
use = "threshold-free"
[[evaluators]]
use = "rutzinger"
"""


def city_with_reference(folder):
    """The town with a reference of which one house is missing and one is moved."""
    whole = town()
    boxes = [shapely.box(*box) for name, box in list(HOUSES.items())[1:]]
    boxes[0] = shapely.affinity.translate(boxes[0], 2.5, 1.0)
    layers = {"points": whole.points, "dem": whole.dem, "reference": rb.Footprints.of(boxes, crs=whole.crs)}
    save_scene(rb.Scene(whole.name, whole.extent, crs=whole.crs, **layers), folder)
    return folder


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("suite")
    city_with_reference(folder / "town")
    (folder / "suite.toml").write_text(SUITE)
    return folder


def measured(suite, store, execution, **options):
    """Run a suite, and return the detections of its run, values and verdict tables."""
    with Store(store) as opened:
        plan = make_plan(read_suite(suite), opened, **options)
        (row,) = run_plan(plan, opened, execution=execution).rows
        assert row.status == "ok", row.reason
        detected = shapely.to_wkb(opened.detections(row.id).polygons).tolist()
        values = [opened.index_values([row.id], keyed.key)[row.id] for keyed in plan.evaluators]
        found = opened._db.execute("SELECT * FROM verdict_tables ORDER BY 1, 2")
        tables = [VerdictTable.from_bytes(table) for _, _, table in found]
        return detected, values, [(list(table.reasons), table.measures) for table in tables]


def assert_same(one, two):
    """The same detections and indices to the last bit; measures of objects to the order of their vertices."""
    assert one[:2] == two[:2]
    for (reasons, measures), (other_reasons, other) in zip(one[2], two[2], strict=True):
        assert reasons == other_reasons
        for name in measures:
            np.testing.assert_allclose(measures[name], other[name], rtol=1e-12, atol=1e-15)


def test_a_city_is_the_same_with_any_workers_and_evaluated_in_parts(place, tmp_path, monkeypatch):
    suite = place / "suite.toml"
    here = measured(suite, tmp_path / "here.sqlite", Execution(jobs=0))
    two = measured(suite, tmp_path / "two.sqlite", Execution(jobs=2))
    assert_same(here, two)
    assert len(here[0]) == len(HOUSES)
    assert 0.5 < here[1][0]["object.quality"] < 1
    parts = []
    evaluate = worker.evaluate_sets

    def seen(*arguments, **options):
        parts.append(options["parts"])
        return evaluate(*arguments, **options)

    monkeypatch.setattr(worker, "_MANY", 2)
    monkeypatch.setattr(worker, "_PART", 2)
    monkeypatch.setattr(worker, "evaluate_sets", seen)
    assert_same(measured(suite, tmp_path / "parts.sqlite", Execution(jobs=0)), here)
    assert parts == [1 + len(HOUSES) // 2]
    assert not (tmp_path / "here.sqlite.tiles").exists()


def command(suite, store):
    words = ["run", str(suite), "-j", "2", "--store", str(store), "-q"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.Popen([sys.executable, "-m", "roofbench", *words], env=environment, stderr=subprocess.PIPE)


def finished(store):
    return sorted(file.name for file in store.with_name(store.name + ".tiles").glob("*/[!.]*_*.*"))


def test_a_killed_city_run_resumes_with_the_tiles_that_are_missing(place, tmp_path, monkeypatch):
    store = tmp_path / "a.sqlite"
    process = command(place / "suite.toml", store)
    while len(finished(store)) < 3 and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    before = finished(store)
    assert len(before) >= 3
    waiting = []
    tiles = city_runs.run_tiles

    def counted(work, execution):
        waiting.extend(job.file.name for job in work.jobs if not job.file.exists())
        return tiles(work, execution)

    monkeypatch.setattr(city_runs, "run_tiles", counted)
    resumed = measured(place / "suite.toml", store, Execution(jobs=0))
    assert not set(waiting) & set(before)
    assert_same(resumed, measured(place / "suite.toml", tmp_path / "whole.sqlite", Execution(jobs=0)))
    assert not store.with_name(store.name + ".tiles").exists()


def test_what_a_killed_process_was_writing_goes_with_the_work_folder(tmp_path):
    """A process that is killed while it writes leaves a temporary folder; files of others stay."""
    folder = tmp_path / "city.fgb.tiles"
    folder.mkdir()
    with ExitStack() as killed:
        for name in ("15_32.3e2c8b6f18e547f309a66b8bc4e9a67d", "city.fgb"):
            scratch = killed.enter_context(whole_file(folder / name))
            scratch.write_bytes(b"half")
            assert is_scratch(scratch.parent)
        left = killed.pop_all()  # never ended while the test runs
    (folder / "15_33.3e2c8b6f18e547f309a66b8bc4e9a67d").write_bytes(b"tile")
    remove_tiles(folder)
    assert left is not None
    assert not folder.exists()
    folder.mkdir()
    (folder / "notes.txt").write_text("of a user")
    remove_tiles(folder)
    assert [file.name for file in folder.iterdir()] == ["notes.txt"]


def test_a_broken_file_fails_the_run_and_keeps_the_other_tiles(tmp_path):
    whole = town()
    folder, west, south = tmp_path / "town", whole.extent[0], whole.extent[1]
    folder.mkdir()
    for number in range(2):
        half = (west + 96 * number, south, west + 96 * number + 96, whole.extent[3])
        write_points(whole.window(half).points, folder / f"{number}.laz", crs=whole.crs)
    reference = rb.Footprints.of([shapely.box(*box) for box in HOUSES.values()], crs=whole.crs)
    write_reference(reference, folder / "reference.gpkg", whole.crs)
    index_folder(folder)
    (tmp_path / "suite.toml").write_text(SUITE)
    content = (folder / "1.laz").read_bytes()
    (folder / "1.laz").write_bytes(content[:3000] + bytes(len(content) - 3000))
    words = ("run", tmp_path / "suite.toml", "-j", 0, "--store", tmp_path / "a.sqlite")
    code, _, message = run(*words)
    assert code == 3, message
    assert "tiles failed, the first at" in message
    assert "1.laz" in message
    kept = finished(tmp_path / "a.sqlite")
    assert len(kept) == 4
    (folder / "1.laz").write_bytes(content)
    assert run(*words)[0] == 0
    assert not finished(tmp_path / "a.sqlite")


def test_a_file_of_another_zone_fails_the_run_and_is_named(tmp_path):
    whole = town()
    folder, (west, south, east, north) = tmp_path / "town", whole.extent
    folder.mkdir()
    for number, bounds in enumerate([(west, south, west + 128, north), (west + 128, south, east, north)]):
        write_points(whole.window(bounds).points, folder / f"{number}.laz", crs=whole.crs)
    content = (folder / "1.laz").read_bytes()
    write_points(whole.points, folder / "1.laz", crs="EPSG:25833")
    boxes = rb.Footprints.of([shapely.box(*box) for box in HOUSES.values()], crs=whole.crs)
    write_reference(boxes, folder / "reference.gpkg", whole.crs)
    assert run("scenes", "index", folder)[0] == 3
    (tmp_path / "suite.toml").write_text(SUITE)
    tiled = ("run", tmp_path / "suite.toml", "-j", 0, "--store", tmp_path / "a.sqlite")
    (tmp_path / "untiled.toml").write_text(SUITE.replace("tile = 64\n", ""))
    untiled = ("run", tmp_path / "untiled.toml", "-j", 0, "--store", tmp_path / "b.sqlite")
    for words in (tiled, untiled):
        code, _, message = run(*words)
        assert code == 3
        assert "1 file is not part of the scene, first 1.laz is left out" in message
    kept = finished(tmp_path / "a.sqlite")
    assert kept
    (folder / "1.laz").write_bytes(content)
    assert run("scenes", "index", folder)[0] == 0
    for words in (tiled, untiled):
        assert run(*words)[0] == 0
    assert not finished(tmp_path / "a.sqlite")


def test_the_next_window_is_read_while_a_tile_is_computed(place, tmp_path, monkeypatch):
    started, taken = [], []
    start, take = worker.ReadAhead.start, worker.ReadAhead.take
    monkeypatch.setattr(worker.ReadAhead, "start", lambda self, *given: started.append(given[0]) or start(self, *given))

    def seen(self, key):
        window = take(self, key)
        taken.append(window is not None)
        return window

    monkeypatch.setattr(worker.ReadAhead, "take", seen)
    measured(place / "suite.toml", tmp_path / "a.sqlite", Execution(jobs=0))
    tiles = len(tiles_over(town().extent, 64))
    assert len(started) == len(set(started)) == tiles - 1
    assert sum(taken) == tiles - 1


def test_a_window_that_cannot_be_read_ahead_is_read_again_when_its_turn_comes():
    ahead = worker.ReadAhead()
    ahead.start("a", lambda: 1 / 0)
    assert ahead.take("a") is None
    ahead.start("b", town)
    assert ahead.take("c") is None
    ahead.start("b", town)
    assert ahead.take("b").name == town().name
    assert ahead.take("b") is None
