"""rb.run with suites by file and as objects, and with its other arguments."""

import pytest

import roofbench as rb
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.execution.isolation import Limits
from roofbench.benchmark.suite import read_suite
from roofbench.core.errors import UnknownNameError


@pytest.fixture
def suite_file(misbehaving, tmp_path):
    file = tmp_path / "little.toml"
    file.write_text(
        f'name = "little"\n[[scenes]]\npreset = "hamlet"\nseeds = [1, 2]\n[[detectors]]\nuse = "{misbehaving}"\n'
        '[[evaluators]]\nuse = "threshold-free"\nmatching = "overlap"\n'
    )
    return file


def test_a_suite_by_file_brings_scenes_detectors_and_evaluator(suite_file):
    board = rb.run(str(suite_file))
    assert board.scenes == ("hamlet-1", "hamlet-2")
    assert {entry.detector for entry in board.entries} == {"misbehaving"}
    assert "matching overlap" in board.evaluator


def test_a_suite_object_and_arguments_that_replace_its_parts(suite_file):
    board = rb.run(read_suite(suite_file), ["ndsm"], evaluator="threshold-free[matching=nearest]", index="Q_lp")
    assert {entry.detector for entry in board.entries} == {"ndsm"}
    assert "matching nearest" in board.evaluator
    assert board.rank_by.key == "pixel.quality"


def test_a_name_that_no_suite_has_is_answered_with_the_nearest():
    with pytest.raises(UnknownNameError, match="quik"):
        rb.run("quik")


def test_limits_are_part_of_the_execution(misbehaving):
    execution = Execution(jobs=1, limits=Limits(seconds=3.0))
    board = rb.run(["hamlet"], [f"{misbehaving}[mode=hangs]"], jobs=execution)
    assert [run.reason for run in board.unsuccessful] == ["time limit of 3 s exceeded"]


def test_stored_results_are_reused_unless_asked(misbehaving, tmp_path):
    options = {"store": tmp_path / "a.sqlite"}
    rb.run(["hamlet"], [f"{misbehaving}[mode=raises]"], **options)
    kept = rb.run(["hamlet"], [f"{misbehaving}[mode=raises]"], rerun="never", **options)
    assert [run.status for run in kept.unsuccessful] == ["failed"]


def test_the_board_shows_itself(misbehaving):
    board = rb.run(["hamlet"], [misbehaving])
    assert any(line.startswith("rank  detector") for line in str(board).splitlines()[:5])
    assert board._repr_html_().count("<table>") == 1
