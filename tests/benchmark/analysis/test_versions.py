"""Runs of different versions of the benchmark: stored, listed, and not ranked together."""

import csv
import shutil
import sqlite3
from pathlib import Path

import pytest
from typer.testing import CliRunner

from roofbench.benchmark.analysis.comparison import compare_stores
from roofbench.benchmark.analysis.report_contents import fill_report, newest_runs
from roofbench.benchmark.analysis.versions import UNKNOWN, version_names
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.benchmark.plan import make_plan
from roofbench.benchmark.store.writer import Store
from roofbench.benchmark.suite import suite_of_words
from roofbench.cli.main import app
from roofbench.core.package import BENCHMARK_VERSION

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture
def cli(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*words):
        result = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
        assert result.exit_code in (0, 3), result.output
        return result.stdout

    return call


@pytest.fixture
def mixed(tmp_path, cli, misbehaving):
    """Return a store of the old schema with its run of ndsm, to which a run of this version was added."""
    path = tmp_path / "mixed.sqlite"
    shutil.copy(DATA / "store-0.1.db", path)
    cli("run", "hamlet[seed=0]", "-d", misbehaving, "--store", path, "-j", 0, "--no-report", "-q")
    return path


def test_a_store_of_the_old_schema_gets_the_column_and_its_version_is_unknown(tmp_path, cli):
    path = tmp_path / "old.sqlite"
    shutil.copy(DATA / "store-0.1.db", path)
    with Store(path) as store:
        assert version_names(store.runs()) == [UNKNOWN]
        assert [row.benchmark for row in store.runs()] == [None]
    assert "not recorded" in cli("why", 1, "--store", path)
    assert next(csv.DictReader(cli("ls", "--store", path, "-f", "csv").splitlines()))["benchmark"] == ""
    assert '"benchmark": null' in cli("ls", "--store", path, "-f", "json")
    (entry, _) = csv.DictReader(cli("score", "-e", "threshold-free", "--store", path, "-f", "csv").splitlines())
    assert (entry["rank"], entry["benchmark"]) == ("1", UNKNOWN)
    db = sqlite3.connect(path)
    assert db.execute("SELECT benchmark FROM evaluations ORDER BY id").fetchall() == [(None,), (BENCHMARK_VERSION,)]
    db.close()


def test_runs_of_two_versions_are_not_ranked_together_unless_asked(mixed, cli):
    text = cli("score", "-e", "threshold-free", "--store", mixed)
    note = " ".join(text.split())
    assert "left out are those of other versions (version unknown: 1 of ndsm)" in note
    assert "rank all together by 'roofbench score --all-versions'" in note
    assert "1  ndsm" not in text
    (entry, _) = csv.DictReader(cli("score", "-e", "iou", "--store", mixed, "-f", "csv").splitlines())
    assert entry["benchmark"] == str(BENCHMARK_VERSION)
    every = cli("score", "-e", "threshold-free", "--store", mixed, "--all-versions")
    assert "1  ndsm" in every
    assert "are ranked together" in " ".join(every.split())


def test_a_report_shows_the_newest_version_and_names_the_others(mixed, cli):
    cli("score", "-e", "threshold-free", "--store", mixed)
    with Store(mixed) as store:
        report = fill_report(store, newest_runs(store), title="mixed")
    (board,) = report.boards
    assert {entry.detector for entry in board.entries} == {"misbehaving"}
    assert "version unknown: 1 of ndsm" in board.notes[0]
    assert dict(report.provenance.facts)["version of the benchmark"] == str(BENCHMARK_VERSION)


def test_a_comparison_of_stores_names_their_versions(mixed, tmp_path, cli):
    old = tmp_path / "old.sqlite"
    shutil.copy(DATA / "store-0.1.db", old)
    for path in (old, mixed):
        cli("score", "-e", "threshold-free", "--store", path)
    with Store(old) as one, Store(mixed) as two:
        notes = compare_stores(one, two).notes
    assert any(note.startswith("versions of the benchmark: A unknown, B 1") for note in notes)


def test_a_run_of_another_version_is_run_again_and_its_plan_says_why(mixed):
    suite = suite_of_words(["hamlet[seed=0]"], ["ndsm"])
    with Store(mixed) as store:
        (run,) = make_plan(suite, store).runs
    assert run.todo == "detect"
    assert f"the version of the benchmark is {BENCHMARK_VERSION}, was not recorded" in run.why
    assert run.identity.scene == SceneRecipe.of_preset("hamlet", seed=0)
