"""A store that several suites were run into is ranked by suite and on the scenes that all detectors ran on."""

from types import SimpleNamespace

import pytest
from harness.command_line import roofbench

from roofbench.benchmark.analysis.suite_parts import suite_parts


def rows(**scenes):
    """Return runs: detector to the scenes that it ran on, a letter each."""
    return [SimpleNamespace(label=label, scene=scene) for label, names in scenes.items() for scene in names]


def plan(name, scenes):
    return {"name": name, "scenes": [{"name": scene} for scene in scenes]}


def found(parts):
    return [(title, sorted({row.scene for row in own}), sorted({row.label for row in own})) for title, own in parts]


def test_nothing_is_parted_where_every_detector_ran_on_every_scene():
    assert suite_parts(rows(one="ab", two="ab"), [plan("x", "ab")]) == []
    assert suite_parts(rows(one="ab"), []) == []


def test_the_common_scenes_come_first_then_the_suites_with_most_runs():
    parts = suite_parts(rows(one="abcd", two="abc", three="cd"), [plan("last", "cd"), plan("first", "abc")])
    assert found(parts) == [
        ("Scenes that all detectors ran on", ["c"], ["one", "three", "two"]),
        ("Suite first", ["a", "b", "c"], ["one", "two"]),
        ("Suite last", ["c", "d"], ["one", "three"]),
    ]


def test_without_common_scenes_there_are_the_suites_alone():
    parts = suite_parts(
        rows(one="ab", two="cd"), [plan("scenes", "abz"), plan("run", "d"), plan("x", "ab"), {"name": ""}]
    )
    assert found(parts) == [("Scenes a, b", ["a", "b"], ["one"]), ("Scene d", ["d"], ["two"])]


@pytest.fixture
def page(tmp_path, misbehaving):
    small, middle, large = (word for side in (4, 6, 9) for word in [("-d", f"{misbehaving}[side={side}]")])
    options = ("-j", 0, "--no-report")
    roofbench("run", "hamlet", *small, *large, *options, folder=tmp_path)
    roofbench("run", "hamlet[seed=2]", "hamlet[seed=3]", *middle, *large, *options, folder=tmp_path)
    roofbench("report", "roofbench.sqlite", folder=tmp_path)
    return (tmp_path / "report.html").read_text(encoding="utf-8")


def test_the_report_ranks_each_part_and_leads_with_the_largest(page):
    assert "nothing is ranked" not in page
    assert "Scenes hamlet-2, hamlet-3: threshold-free" in page
    assert "Scene hamlet-1: threshold-free" in page
    assert "All scenes: threshold-free" in page
    assert "Scenes hamlet-2, hamlet-3: misbehaving" in page.partition('<p class="lead">')[2].partition("</p>")[0]
