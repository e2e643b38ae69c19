"""Reports filled from a store, and the commands that write them."""

import re
import shutil
from pathlib import Path

import pytest
from harness.command_line import roofbench

import roofbench as rb
from roofbench.benchmark.analysis.published import PUBLISHED, PublishedRow
from roofbench.benchmark.analysis.report_contents import fill_report, newest_runs
from roofbench.benchmark.store.writer import Store
from roofbench.reports.html_report import html_report


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("store")
    scenes = ["hamlet[seed=1]", "hamlet[seed=2]"]
    rb.run(scenes=scenes, detectors=["ndsm", "ndsm[height=4]", "ndsm[height=6]"], store=place / "runs.sqlite")
    return place


@pytest.fixture(scope="module")
def filled(folder):
    with Store(folder / "runs.sqlite") as opened:
        return fill_report(opened, newest_runs(opened), title="two hamlets")


def test_every_scene_is_drawn_with_picture_and_every_detector(filled):
    assert [view.name for view in filled.scenes] == ["hamlet-1", "hamlet-2"]
    for view in filled.scenes:
        assert view.picture is not None
        assert {overlay.label for overlay in view.overlays} == {"ndsm", "ndsm[height=4]", "ndsm[height=6]"}
        for overlay in view.overlays:
            assert overlay.verdicts.reference is view.reference
            assert [len(table) for _, table, _ in overlay.verdicts.sides] == [
                len(footprints) for _, _, footprints in overlay.verdicts.sides
            ]
    assert filled.sampling == ()


def test_a_store_of_version_0_1_is_reported_and_its_maps_come_back_by_scoring_it_again(tmp_path):
    shutil.copy(Path(__file__).parents[1] / "data" / "store-0.1.db", tmp_path / "runs.sqlite")
    with Store(tmp_path / "runs.sqlite") as opened:
        old = fill_report(opened, newest_runs(opened), title="old")
    assert old.boards[0].entries[0].cells["object.quality"].value == 22 / 31
    assert old.scenes == ()
    roofbench("score", "-e", "threshold-free", "--store", "runs.sqlite", folder=tmp_path)
    with Store(tmp_path / "runs.sqlite") as opened:
        new = fill_report(opened, newest_runs(opened), title="new")
    assert new.boards[0].entries[0].cells["object.quality"].value == 22 / 31
    assert new.scenes[0].overlays[0].verdicts.reference_table.count("FN") == 9


def test_the_row_by_one_pass_stands_beside_ours_and_the_published(tmp_path, monkeypatch):
    rb.run(scenes=["moonee-ponds-small"], detectors=["ndsm"], store=tmp_path / "runs.sqlite")
    row = PublishedRow(
        detector="ndsm", scene="small", presets=("moonee-ponds-small",), source="2010", printed={"Q_l": "91.0"}
    )
    monkeypatch.setattr("roofbench.benchmark.analysis.report_contents.PUBLISHED", (row,))
    with Store(tmp_path / "runs.sqlite") as opened:
        rows = newest_runs(opened, detector="ndsm")
        filled = fill_report(opened, rows, title="published")
        one_pass = [
            rb.evaluate(
                opened.detections(run.id),
                (scene := opened.scene(run.scene_id)).reference,
                grid=scene.grid,
                matching="one-pass",
            ).object.quality
            for run in rows
        ]
    ((_, (ours,)),) = filled.comparison.rows
    assert ours.one_pass["object.quality"] == pytest.approx(sum(one_pass) / len(one_pass))
    page = html_report(filled)
    assert "ours, 1 scene, one-pass" in page
    assert "91.0" in page


def test_published_rows_of_parts_stand_beside_the_level_of_parts(tmp_path, monkeypatch):
    entries = {row.detector: row.entries for row in PUBLISHED}
    assert entries["mpp"] == ("mpp[least_height=2.5,level=part]", "mpp[level=part]", "mpp-printed")
    assert entries["original"][0] == "original"
    assert entries["dempster-shafer"] == ("dempster-shafer",)
    monkeypatch.setattr("roofbench.benchmark.analysis.published._ENTRIES", {"ndsm": ("ndsm[height=4]", "ndsm[dem=no]")})
    rb.run(scenes=["moonee-ponds-small"], detectors=["ndsm", "ndsm[height=4]"], store=tmp_path / "runs.sqlite")
    row = PublishedRow(
        detector="ndsm", scene="small", presets=("moonee-ponds-small",), source="2010", printed={"Q_l": "91.0"}
    )
    monkeypatch.setattr("roofbench.benchmark.analysis.report_contents.PUBLISHED", (row,))
    with Store(tmp_path / "runs.sqlite") as opened:
        filled = fill_report(opened, newest_runs(opened), title="published")
        without = fill_report(opened, newest_runs(opened, detector="ndsm"), title="only the default")
    assert [index.symbol for index in filled.comparison.indices] == ["Q_l"]
    ((_, ours),) = filled.comparison.rows
    assert [entry.label for entry in ours] == ["ndsm[height=4]"]
    assert "ndsm[height=4], moonee-ponds-small" in html_report(filled)
    assert without.comparison is None


def test_counts_by_size_are_those_of_the_leaderboard(filled):
    curve = next(curve for curve in filled.sizes if curve.label == "ndsm")
    entry = next(e for e in filled.boards[0].entries if e.label == "ndsm" and e.pooling == "pooled")
    found = sum(each.right for each in curve.found) / sum(each.count for each in curve.found)
    correct = sum(each.right for each in curve.correct) / sum(each.count for each in curve.correct)
    assert found == pytest.approx(entry.cells["object.completeness"].value)
    assert correct == pytest.approx(entry.cells["object.correctness"].value)


def test_the_worst_objects_are_wrong_by_what_their_verdict_says(filled):
    for error in filled.errors:
        view = filled.scenes[error.scene]
        verdicts = view.overlays[error.overlay].verdicts
        table, footprints = verdicts.table(error.side), verdicts.footprints(error.side)
        own, verdict = footprints.polygons[error.position], table.verdicts[error.position]
        if error.side == "reference":
            assert verdict == "FN"
        if verdict == "TP":
            partner = view.reference.polygons[view.reference.ids.tolist().index(table.partner[error.position])]
            assert error.wrong == pytest.approx(own.symmetric_difference(partner).area)
        else:
            assert error.wrong == pytest.approx(own.area)


def test_runs_that_differ_in_one_parameter_make_a_sensitivity_line(filled):
    quality = next(line for line in filled.sensitivities if line.index.key == "object.quality")
    assert (quality.detector, quality.axis, quality.unit) == ("ndsm", "height", "m")
    assert [point.value for point in quality.points] == [quality.default, 4, 6]
    assert all(point.scenes == 2 for point in quality.points)
    entries = {e.label: e for e in filled.boards[0].entries if e.pooling == "mean"}
    means = [entries[label].cells["object.quality"].value for label in ("ndsm", "ndsm[height=4]", "ndsm[height=6]")]
    assert [point.mean for point in quality.points] == pytest.approx(means)


def test_only_the_newest_run_of_a_detector_counts(folder):
    with Store(folder / "runs.sqlite") as opened:
        rows = newest_runs(opened, detector="ndsm", scene="*-1")
        assert [(row.label, row.scene) for row in rows] == [("ndsm", "hamlet-1")]


def test_the_page_is_the_same_for_the_same_store(filled):
    assert html_report(filled) == html_report(filled)


def test_report_writes_one_file_and_replaces_nothing_unasked(folder):
    answer = roofbench("report", "runs.sqlite", "-o", "report.html", folder=folder)
    assert "2 scenes drawn" in answer.stderr
    page = (folder / "report.html").read_text("utf-8")
    assert page.startswith("<!DOCTYPE html>")
    assert not re.search(r"(?:src|href)=\"(?!data:|#)", page)
    refused = roofbench("report", "runs.sqlite", "-o", "report.html", folder=folder, expect=2)
    assert "--overwrite" in refused.stderr
    roofbench("report", "runs.sqlite", "-o", "report.html", "--overwrite", folder=folder)


def test_run_writes_the_report_beside_its_leaderboard(folder):
    roofbench("run", "hamlet", "-d", "ndsm", "--store", "run.sqlite", "-o", "out", folder=folder)
    written = {path.name for path in (folder / "out").iterdir()}
    assert written == {"leaderboard.csv", "leaderboard.md", "report.html"}
    assert "<h1" in (folder / "out" / "report.html").read_text("utf-8")


def test_a_store_compared_with_itself_is_the_same(folder):
    answer = roofbench("report", "runs.sqlite", "--against", "runs.sqlite", "-o", "same.md", folder=folder)
    lines = [line for line in answer.stdout.splitlines() if line.startswith("ndsm")]
    assert len(lines) == 3 * 15
    assert all(line.endswith("same") for line in lines)
    assert "| same" in (folder / "same.md").read_text("utf-8")


def test_stores_without_common_scenes_are_not_comparable(folder):
    rb.run(scenes=["hamlet[seed=3]"], detectors=["ndsm"], store=folder / "other.sqlite")
    answer = roofbench("report", "runs.sqlite", "--against", "other.sqlite", folder=folder, expect=4)
    assert "only in B: 1 pair of" in answer.stdout


def test_plots_are_written(folder):
    roofbench("plot", "scene", "hamlet-1", "--store", "runs.sqlite", "-o", "scene.png", folder=folder)
    roofbench("plot", "sweep", "--store", "runs.sqlite", "-o", "sweep.svg", folder=folder)
    assert (folder / "scene.png").read_bytes().startswith(b"\x89PNG")
    assert "height [m]" in (folder / "sweep.svg").read_text("utf-8")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("report", "nothing.sqlite", "-o", "x.html"), "no such results store"),
        (("plot", "scene", "castle", "-o", "x.png", "--store", "runs.sqlite"), "no run on 'castle'"),
        (("plot", "scene", "hamlet-*", "-o", "x.png", "--store", "runs.sqlite"), "several scenes match"),
        (("plot", "sweep", "missing.csv", "-o", "x.png"), "no such sweep table"),
        (("plot", "gate", "runs.sqlite", "-o", "x.png"), "not a result of the gate"),
        (("plot", "sweep", "--axis", "width", "-o", "x.png", "--store", "runs.sqlite"), "no axis 'width'"),
    ],
)
def test_a_mistake_gets_one_sentence(folder, arguments, message):
    answer = roofbench(*arguments, folder=folder, expect=2)
    assert message in answer.stderr
    assert len(answer.stderr.strip().splitlines()) == 1
    assert not (folder / "x.png").exists()
