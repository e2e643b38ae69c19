"""The commands on runs, called as the command line calls them, but in this process."""

import json

import numpy as np
import pytest
import shapely
from typer.testing import CliRunner

import roofbench as rb
from roofbench.cli.main import app
from roofbench.scenes.builtin import hamlet


@pytest.fixture
def cli(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*words, code=0):
        result = CliRunner().invoke(app, [str(word) for word in words], prog_name="roofbench")
        if isinstance(result.exception, rb.RoofbenchError):
            assert code == 2, result.exception
            return str(result.exception)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        assert result.exit_code == code, result.output
        return result

    return call


def test_run_prints_a_leaderboard_and_writes_files(cli, misbehaving, tmp_path):
    result = cli("run", "hamlet[seed=1]", "-d", misbehaving, "-j", 0, "-o", "out")
    assert "misbehaving" in result.stdout
    assert "1 run done" in result.stderr
    assert (tmp_path / "out" / "leaderboard.csv").read_text().count("\n") == 3
    assert "| rank" in (tmp_path / "out" / "leaderboard.md").read_text().replace("|   rank", "| rank")
    again = cli("run", "hamlet[seed=1]", "-d", misbehaving, "-j", 0)
    assert "0 runs done, 1 stored before" in again.stderr
    assert again.stdout == result.stdout


def test_a_failing_detector_is_exit_code_3_with_reason_and_command(cli, misbehaving):
    result = cli("run", "hamlet", "-d", f"{misbehaving}[mode=leaves]", "-d", misbehaving, code=3)
    assert "failed misbehaving[mode=leaves] on hamlet-1, seed 0: the worker process exited" in result.stderr
    assert "repeat: roofbench detect" in result.stderr
    assert "misbehaving" in result.stdout


def test_the_next_command_repeats_what_failed_or_continues_with_the_own_detector(cli, misbehaving, tmp_path):
    def following(*words, code=0):
        return cli("run", "hamlet", "-j", 0, *words, code=code).stderr.splitlines()[-1]

    assert following("-d", f"{misbehaving}[mode=raises]", code=3) == "next: roofbench run --resume --retry-failed"
    assert following("-d", misbehaving) == f"next: roofbench baseline save -d {misbehaving} -o baseline.json"
    assert following("-d", "ndsm") == "next: roofbench new detector my-detector"
    broken = tmp_path / "broken.py"
    broken.write_text(
        "import roofbench as rb\n"
        "from roofbench.evaluators.iou import IoU\n"
        "class Broken(IoU):\n"
        "    name = 'broken'\n"
        "    def measured(self, sets):\n"
        "        raise ValueError('no tally today')\n"
    )
    words = ("-d", "ndsm", "-e", f"{broken}:Broken", "--store", "other.sqlite")
    assert following(*words, code=3) == "next: roofbench run --resume --store other.sqlite"


def test_nothing_measured_is_exit_code_4(cli, misbehaving, tmp_path):
    scene = rb.Scene("bare", (0, 0, 200, 200), points=rb.PointCloud(*np.ones((3, 4))))
    rb.save_scene(scene, tmp_path / "bare")
    result = cli("run", "bare", "-d", misbehaving, "-j", 0, code=4)
    assert "bare has no reference and is left out" in result.stdout


def test_a_dry_run_lists_what_would_run_and_why_the_rest_is_stored(cli, misbehaving, tmp_path):
    before = sorted(tmp_path.iterdir())
    assert "1 to run" in cli("run", "hamlet[seed=1]", "-d", misbehaving, "--dry-run").stdout
    assert sorted(tmp_path.iterdir()) == before
    cli("run", "hamlet[seed=1]", "-d", misbehaving, "-j", 0)
    listed = cli("run", "hamlet[seed=1]", "hamlet[seed=2]", "-d", misbehaving, "--dry-run").stdout
    assert "stored   misbehaving  hamlet-1  seed 0: stored as run 1" in listed
    assert "run      misbehaving  hamlet-2  seed 0: not run yet" in listed
    assert "2 runs: 1 to run, 0 to evaluate, 1 left as stored" in listed


def test_resume_needs_no_suite(cli, misbehaving):
    assert "no such results store" in cli("run", "--resume", code=2)
    cli("run", "hamlet[seed=1]", "-d", f"{misbehaving}[side=7]", "-j", 0)
    assert "misbehaving[side=7]" in cli("run", "--resume", "-j", 0).stdout


def test_ls_filters_and_shows_reasons(cli, misbehaving):
    cli("run", "hamlet", "-d", f"{misbehaving}[mode=raises]", "-d", misbehaving, "-j", 0, code=3)
    assert "ZeroDivisionError: no houses at all" in cli("ls").stdout
    (row,) = json.loads(cli("ls", "--status", "ok", "-f", "json").stdout)
    assert (row["label"], row["detected"]) == ("misbehaving", 25)
    assert cli("ls", "--detectors", "misbehaving", "-f", "csv").stdout.count("\n") == 2
    assert "0 of 2 runs" in cli("ls", "--scenes", "knox*").stdout


def test_why_says_what_a_run_depends_on(cli, misbehaving):
    cli("run", "hamlet", "-d", f"{misbehaving}[mode=raises]", "-d", misbehaving, "-j", 0, code=3)
    failed = cli("why", 1).stdout
    assert "ZeroDivisionError: no houses at all" in failed
    assert "Traceback" in failed
    assert "failures are tried again" in failed
    assert "Nothing that it depends on has changed: it would not be run again." in cli("why", 2).stdout
    assert "no run named '77'" in cli("why", 77, code=2)
    cli("run", "hamlet", "-d", "ndsm", "-j", 0)
    assert "  cues       multiple returns, roughness" in cli("why", 3).stdout


def test_score_evaluates_stored_detections_again(cli, misbehaving):
    cli("run", "hamlet", "-d", misbehaving, "-j", 0)
    assert "matching overlap" in cli("score", "-e", "threshold-free[matching=overlap]").stdout


def test_export_writes_verdict_layers(cli, misbehaving, tmp_path):
    cli("run", "hamlet", "-d", misbehaving, "-d", f"{misbehaving}[mode=raises]", "-j", 0, code=3)
    cli("export", 1, "-o", "run.gpkg")
    layer = rb.read_footprints("run.gpkg|layername=references")
    assert len(layer) == len(hamlet(1).reference)
    assert {"verdict", "reason"} <= set(layer.attributes)
    assert "has no footprints to export" in cli("export", 2, "-o", "other.gpkg", code=2)
    assert "exists already" in cli("export", 1, "-o", "run.gpkg", code=2)


def test_detect_writes_what_a_run_stores(cli, misbehaving):
    cli("detect", misbehaving, "hamlet[seed=2]", "-o", "out.gpkg", "-p", "side=7", "--seed", 3)
    written = rb.read_footprints("out.gpkg")
    here = rb.detect(hamlet(2), misbehaving, side=7, seed=3)
    assert shapely.equals_exact(written.polygons, here.polygons, 1e-9).all()
    assert "exists already" in cli("detect", misbehaving, "hamlet", "-o", "out.gpkg", code=2)
    assert "shows no intermediate steps" in cli("detect", misbehaving, "hamlet", "--steps", "steps", code=2)
    assert "name what to write" in cli("detect", misbehaving, "hamlet", code=2)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("run", "nosuch.toml"), "nosuch.toml: no such file"),
        (("run", "nosuch"), "is not a scene, preset or suite"),
        (("run", "quik"), "did you mean 'quick'"),
        (("run", "villag"), "did you mean 'village'"),
        (("detect", "ndsm", "fairfeild", "-o", "x.gpkg"), "did you mean 'fairfield'"),
        (("detect", "ndsm", "tile.laz", "-o", "x.gpkg"), "roofbench scenes import"),
        (("scenes", "make", "hamlt", "-o", "x"), "did you mean 'hamlet'"),
        (("run", "hamlet", "--index", "Q_ll"), "did you mean 'Q_l'"),
        (("run", "hamlet", "-d", "ndms"), "did you mean 'ndsm'"),
        (("run", "hamlet", "-j", 0, "--time-limit", 3), "limits need a worker process"),
        (("run", "hamlet", "--index", "quality"), "has no index 'quality'"),
        (("run", "hamlet", "--store", "no/where.sqlite"), "there is no folder no"),
        (("run", "hamlet", "--scenes", "x*"), "no scene matches 'x*'"),
        (("run", "hamlet", "--plugin", "absent.py"), "absent.py: no such file"),
        (("ls",), "no such results store"),
        (("check-plugin", "ndms"), "did you mean 'ndsm'"),
        (("check-plugin", "absent.py"), "absent.py: no such file"),
        (("plot", "gate", "empty.json", "-o", "x.png"), "it has no 'baseline'"),
        (("gate", "empty.json"), "it has no 'format'"),
    ],
)
def test_a_wrong_word_is_one_sentence_and_exit_code_2(cli, words, message, tmp_path):
    (tmp_path / "empty.json").write_text("{}")
    (tmp_path / "village").mkdir()
    (tmp_path / "village" / "scene.toml").touch()
    printed = cli(*words, code=2)
    assert message in printed
    assert "\n" not in printed


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("run", "hamlet", "--memory-limit", "much"), "--memory-limit cannot be used: 'much' is not a size"),
        (("scenes", "make", "hamlet", "-o", "x", "-p", "slope"), "'slope': write NAME=VALUE"),
        (("plot", "scene", "x", "-o", "x.png", "--window", "1,2"), "write X,Y,WIDTH,HEIGHT"),
        (("run", "--rerun", "sometimes"), "--rerun must be one of missing, never, always, not 'sometimes'"),
    ],
)
def test_a_value_that_cannot_be_read_is_refused_by_the_name_of_its_option(cli, words, message):
    assert message in cli(*words, code=2)


def test_check_plugin_accepts_an_honest_detector_and_names_broken_rules(cli, misbehaving, tmp_path):
    assert "13 of 13 rules followed" in cli("check-plugin", misbehaving).stdout
    (tmp_path / "bad.py").write_text(
        "from dataclasses import dataclass\nimport numpy as np\nimport roofbench as rb\n\n"
        "@dataclass(frozen=True, kw_only=True)\nclass Bad(rb.Detector):\n"
        '    """Draws from numpy\'s own stream and changes the scene."""\n\n    name = "bad"\n'
        "    limit: float = rb.parameter(1.0)\n\n"
        "    def detect(self, scene, rng):\n"
        "        scene.points.z[:] += 1\n"
        "        x, y = scene.extent[:2] + np.random.default_rng().random(2)\n"
        "        return rb.Footprints.from_rectangles([[(x, y), (x + 9, y), (x + 9, y + 9), (x, y + 9)]])\n"
    )
    printed = cli("check-plugin", "bad.py", code=3).stdout
    assert "FAILED  the same seed gives the same footprints: draw random numbers from rng only" in printed
    assert "FAILED  leaves the scene as it was" in printed
    assert "FAILED  documents its parameters: no doc= for limit" in printed


def test_check_plugin_accepts_the_built_in_evaluator(cli):
    assert "rules followed" in cli("check-plugin", "threshold-free").stdout


BAD_PLUGINS = """
import os
import sys
from dataclasses import dataclass

import numpy as np

import roofbench as rb

print("printed while it is imported")


@dataclass(frozen=True, kw_only=True)
class Leaves(rb.Detector):
    \"\"\"Exits the interpreter.\"\"\"

    name = "leaves"

    def detect(self, scene, rng):
        print("printed while it runs")
        sys.exit(0)


@dataclass(frozen=True, kw_only=True)
class Crashes(Leaves):
    \"\"\"Takes its process with it.\"\"\"

    name = "crashes"

    def detect(self, scene, rng):
        os.kill(os.getpid(), 9)


@dataclass(frozen=True, kw_only=True)
class Stumbles(Leaves):
    \"\"\"Raises.\"\"\"

    name = "stumbles"

    def detect(self, scene, rng):
        raise ZeroDivisionError("no houses\\nat all")
"""


@pytest.fixture(scope="module")
def bad_plugins(tmp_path_factory):
    """Return one file for all tests: names of plugins are taken once in a process."""
    file = tmp_path_factory.mktemp("plugins") / "bad.py"
    file.write_text(BAD_PLUGINS)
    return file


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("Leaves", "exited with code 0"),
        ("Crashes", "killed by signal 9"),
        ("Stumbles", "ZeroDivisionError: no houses at all"),
    ],
)
def test_check_plugin_survives_a_detector_that_ends_its_process(cli, bad_plugins, name, problem):
    result = cli("check-plugin", f"{bad_plugins}:{name}", code=3)
    assert problem in result.stdout
    assert "rules followed" in result.stdout.splitlines()[-1]
    assert "printed while" not in result.stdout


@pytest.mark.parametrize(("name", "problem"), [("Leaves", "SystemExit: 0"), ("Stumbles", "no houses at all")])
def test_detect_prints_an_error_of_the_detector_after_its_traceback(cli, bad_plugins, tmp_path, name, problem):
    result = cli("detect", f"{bad_plugins}:{name}", "hamlet", "-o", "out.gpkg", code=3)
    assert result.stdout == ""
    *before, last = result.stderr.strip().splitlines()
    assert last.startswith(f"Error: {name.lower()} failed on hamlet-1: ")
    assert problem in last
    assert any(line.startswith("Traceback") for line in before)
    assert not (tmp_path / "out.gpkg").exists()


def test_detect_notices_a_file_that_was_replaced(cli, misbehaving, tmp_path):
    rb.save_scene(hamlet(1), tmp_path / "one")
    rb.save_scene(hamlet(2), tmp_path / "two")
    (tmp_path / "two" / "dem.tif").replace(tmp_path / "one" / "dem.tif")
    assert "dem.tif changed since scene.toml was written" in cli("detect", "ndsm", "one", "-o", "out.gpkg", code=2)


def test_pictures_of_steps_never_replace_a_folder_of_something_else(cli, tmp_path):
    rb.save_scene(hamlet(1), tmp_path / "one")
    printed = cli("detect", "ndsm", "hamlet", "--steps", "one", "--overwrite", code=2)
    assert "one holds" in printed
    cli("detect", "ndsm", "hamlet", "--steps", "steps")
    cli("detect", "ndsm", "hamlet", "--steps", "steps", "--overwrite")


def test_the_folder_for_results_is_checked_before_the_runs(cli, misbehaving, tmp_path):
    (tmp_path / "out").write_text("a file")
    printed = cli("run", "hamlet", "-d", misbehaving, "-j", 0, "-o", "out", code=2)
    assert "out cannot be made: it is a file" in printed
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_files_are_written_before_a_table_whose_reader_has_gone(cli, misbehaving, tmp_path, monkeypatch):
    from roofbench.cli import sweep
    from roofbench.reports import leaderboard_text

    def closed(*_, **__):
        raise BrokenPipeError

    monkeypatch.setattr(leaderboard_text, "print_leaderboard", closed)
    monkeypatch.setattr(sweep, "_print", closed)
    for words in (
        ("run", "hamlet", "-d", misbehaving, "-j", 0, "-o", "out"),
        ("sweep", misbehaving, "hamlet", "--vary", "side=7,9", "-j", 0, "-o", "sweep.csv"),
    ):
        with pytest.raises(BrokenPipeError):
            cli(*words)
    assert (tmp_path / "out" / "leaderboard.csv").exists()
    assert (tmp_path / "out" / "report.html").exists()
    assert (tmp_path / "sweep.csv").exists()


def test_a_store_without_room_is_one_sentence(monkeypatch, tmp_path):
    import sqlite3

    from harness.command_line import roofbench

    def full(*_):
        raise sqlite3.OperationalError("database or disk is full")

    monkeypatch.setattr("roofbench.benchmark.store.writer.Store.save_plan", full)
    printed = roofbench("run", "hamlet", "-d", "ndsm", "-j", 0, folder=tmp_path, expect=2).stderr
    assert printed == "Error: the results store cannot be written or read: database or disk is full\n"


def test_run_writes_a_report_beside_the_store_and_names_its_files(cli, misbehaving, tmp_path):
    answer = cli("run", "hamlet", "-d", misbehaving, "-j", 0)
    assert answer.exit_code == 0
    assert "written: roofbench.sqlite, report.html\nnext: roofbench " in answer.stderr
    assert (tmp_path / "report.html").exists()


def test_a_report_replaces_reports_only(cli, misbehaving, tmp_path):
    (tmp_path / "report.html").write_text("<p>of somebody</p>")
    answer = cli("run", "hamlet", "-d", misbehaving, "-j", 0)
    assert "report.html is not a report of roofbench and was not replaced" in answer.stderr
    assert (tmp_path / "report.html").read_text() == "<p>of somebody</p>"
    (tmp_path / "report.html").unlink()
    cli("run", "hamlet", "-d", misbehaving, "-j", 0, "--no-report")
    assert not (tmp_path / "report.html").exists()
    for _ in range(2):
        assert "written: roofbench.sqlite, report.html" in cli("run", "hamlet", "-d", misbehaving, "-j", 0).stderr


@pytest.mark.parametrize("form", ["csv", "json"])
def test_tables_for_programs_are_all_that_is_on_standard_output(cli, misbehaving, form):
    run = cli("run", "hamlet", "-d", misbehaving, "-j", 0, "--format", form).stdout
    swept = cli("sweep", misbehaving, "hamlet", "--vary", "side=7,9", "-j", 0, "--format", form).stdout
    if form == "json":
        (board,) = json.loads(run)["leaderboards"]
        assert board["entries"][0]["detector"] == "misbehaving"
        assert {row["side"] for row in json.loads(swept)} == {7, 9}
    else:
        assert run.startswith("rank,group,detector,")
        assert "detector" in swept.splitlines()[0].split(",")
        assert len(swept.splitlines()) > 2


def test_a_published_figure_is_drawn_and_its_text_checked(cli, tmp_path):
    result = cli("sweep", "original", "fairfield-1-small", "--figure", 8, "--seeds", 1, "-j", 0, "--format", "md")
    assert "| reduction | 0.15 |" in " ".join(result.stdout.replace("|  ", "| ").split())
    assert "of 10 statements of the text reproduced" in result.stdout
    assert (tmp_path / "original-figure-8.png").stat().st_size > 10_000
    assert "leave out --vary" in cli("sweep", "original", "--figure", 8, "--vary", "rise=0", code=2)
    assert "exists" in cli("sweep", "original", "fairfield-1-small", "--figure", 8, "--seeds", 1, "-j", 0, code=2)
