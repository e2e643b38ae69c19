"""Footprints made elsewhere: blind scenes out, one file a scene in, the same store and leaderboard."""

import json
import shutil

import numpy as np
import pytest
import shapely
from harness.command_line import roofbench

import roofbench as rb
from roofbench.benchmark.suite import read_suite
from roofbench.detectors.external.precomputed import Precomputed, file_stem
from roofbench.scenes.builtin import hamlet

SUITE = """
[[scenes]]
preset = "hamlet"
seeds = [1, 2]

[[scenes]]
path = "village"

[[detectors]]
use = "ndsm"
"""


@pytest.fixture
def place(tmp_path):
    """A suite of three scenes, and a contribution that finds everything, one metre too far east."""
    (tmp_path / "my.toml").write_text(SUITE)
    rb.save_scene(hamlet(3), tmp_path / "village")
    (tmp_path / "mine").mkdir()
    for seed in (1, 2, 3):
        reference = hamlet(seed).reference
        moved = rb.Footprints.of(
            shapely.transform(reference.polygons, lambda xy: xy + np.array([1, 0])), crs=reference.crs
        )
        rb.write_footprints(moved, tmp_path / "mine" / f"hamlet-{seed}.gpkg")
    return tmp_path


def rows(answer):
    (board,) = json.loads(answer.stdout)["leaderboards"]
    return {entry["detector"]: entry for entry in board["entries"] if entry["pooling"] == "pooled"}


def test_the_scenes_of_a_suite_are_written_without_what_is_true_of_them(place):
    printed = roofbench("scenes", "make", "--suite", "my.toml", "-o", "blind", folder=place).stdout
    assert sorted(folder.name for folder in (place / "blind").iterdir()) == ["hamlet-1", "hamlet-2", "hamlet-3"]
    assert printed.splitlines()[0] == "blind/hamlet-1: points, image, dem, without reference"
    for seed in (1, 2, 3):
        scene = rb.open_scene(place / "blind" / f"hamlet-{seed}")
        assert (scene.name, scene.reference, scene.area, scene.facts) == (f"hamlet-{seed}", None, None, {})
        assert len(scene.points) == len(hamlet(seed).points)
    again = roofbench("scenes", "make", "--suite", "my.toml", "-o", "blind", folder=place, expect=2)
    assert "exists already" in again.stderr
    roofbench("scenes", "make", "--suite", "my.toml", "-o", "blind", "--overwrite", folder=place)


def test_footprints_enter_the_same_store_and_leaderboard(place):
    roofbench("run", "my.toml", "-q", folder=place)
    board = rows(roofbench("score", "--footprints", "mine", "--suite", "my.toml", "-f", "json", folder=place))
    assert set(board) == {"ndsm", "precomputed:mine"}
    assert board["precomputed:mine"]["scenes"] == 3
    assert board["precomputed:mine"]["object.quality"] == 1.0
    listed = roofbench("ls", folder=place).stdout
    assert "precomputed:mine" in listed
    (place / "mine" / "hamlet-1.gpkg").unlink()
    failed = roofbench("score", "--footprints", "mine", "--suite", "my.toml", folder=place, expect=3)
    assert "has no footprints of the scene 'hamlet-1': add hamlet-1.gpkg or .geojson" in " ".join(failed.stderr.split())


def test_a_changed_file_is_scored_again_and_the_others_are_not(place):
    def done():
        roofbench("score", "--footprints", "mine", "--suite", "my.toml", "--label", "us", folder=place)
        return len(roofbench("ls", folder=place).stdout.splitlines())

    first = done()
    assert done() == first
    rb.write_footprints(rb.Footprints.empty(crs=hamlet(1).crs), place / "mine" / "hamlet-1.gpkg", overwrite=True)
    assert done() == first + 1


def test_check_says_what_is_missing_and_stores_nothing(place):
    complete = roofbench("score", "--footprints", "mine", "--suite", "my.toml", "--check", folder=place)
    assert complete.stdout.splitlines()[-1] == "3 scenes, 0 problems"
    (place / "mine" / "hamlet-2.gpkg").rename(place / "mine" / "hamlet_2.gpkg")
    (place / "mine" / "hamlet-1.gpkg").write_text("nonsense")
    other = rb.Footprints.of([shapely.box(0, 0, 9, 9)], crs=hamlet(3).crs)
    rb.write_footprints(other, place / "mine" / "hamlet-3.gpkg", overwrite=True)
    answer = roofbench("score", "--footprints", "mine", "--suite", "my.toml", "--check", folder=place, expect=2)
    lines = dict(line.split(": ", 1) for line in answer.stdout.splitlines()[:-1])
    assert lines["hamlet-1"].startswith("hamlet-1.gpkg cannot be read as a vector file")
    assert "has no footprints of the scene 'hamlet-2'" in lines["hamlet-2"]
    assert "outside the extent" in lines["hamlet-3"]
    assert lines["hamlet_2.gpkg"] == "belongs to no scene of 'my' (did you mean 'hamlet-2'?)"
    assert answer.stdout.splitlines()[-1] == "3 scenes, 4 problems"
    assert not (place / "roofbench.sqlite").exists()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--footprints", "mine"), "needs a --suite"),
        (("--suite", "my.toml"), "name the folder with the files"),
        ((), "name an evaluator"),
        (("--footprints", "absent", "--suite", "my.toml"), "is not a folder"),
    ],
)
def test_incomplete_requests_are_refused(place, words, reason):
    assert reason in " ".join(roofbench("score", *words, folder=place, expect=2).stderr.split())


def test_a_scene_name_becomes_a_file_name():
    assert file_stem("knox-small-3[tree_density=40]") == "knox-small-3_tree_density=40"
    assert file_stem("Straße 5/B") == "Straße_5_B"


def test_two_files_for_a_scene_are_refused(place):
    shutil.copy(place / "mine" / "hamlet-1.gpkg", place / "mine" / "hamlet-1.fgb")
    with pytest.raises(Exception, match=r"hamlet-1.fgb and hamlet-1.gpkg for the scene 'hamlet-1': keep one"):
        Precomputed(folder=str(place / "mine")).file_of("hamlet-1")


def test_a_subclass_does_not_learn_the_name_of_the_scene(place):
    class Sly(Precomputed):
        def footprints_of(self, scene, seen):
            raise AssertionError("the name reached a plugin")

    with pytest.raises(rb.RoofbenchError, match="found by the name of a scene"):
        rb.detect(hamlet(1), Sly(folder=str(place / "mine")))


@pytest.mark.parametrize("axis", ["tree_density = [0, 7.5]", "width = 60"])
def test_files_are_found_by_the_name_of_a_generated_scene_in_tables(tmp_path, axis):
    """The scene itself is called otherwise: ``tree_density=0.0``, and without the mark of ``fairfield@1``."""
    preset = "fairfield" if axis.startswith("width") else "fairfield-1-small"
    (tmp_path / "my.toml").write_text(
        f'[[scenes]]\npreset = "{preset}"\nseeds = [1]\nbuildings = 1\nheight = 60\n{axis}\n'
    )
    suite = read_suite(tmp_path / "my.toml")
    (tmp_path / "mine").mkdir()
    for recipe in suite.scenes:
        place = recipe.open()
        rb.write_footprints(place.reference, tmp_path / "mine" / f"{file_stem(recipe.name)}.gpkg")
        found = rb.detect(recipe.word, f"precomputed[folder={tmp_path / 'mine'}]")
        assert found.areas.tolist() == place.reference.areas.tolist()
        if "@" not in recipe.name:
            assert len(rb.detect(place, f"precomputed[folder={tmp_path / 'mine'}]")) == len(found)
    answer = roofbench("score", "--footprints", "mine", "--suite", "my.toml", "-f", "json", folder=tmp_path)
    assert rows(answer)["precomputed:mine"]["scenes"] == len(suite.scenes)


def test_check_and_score_refuse_the_same_files(place):
    """Of generated and of real scenes: the CRS and the extent of the scene count in both."""
    own = hamlet(1).reference
    elsewhere = rb.Footprints.of(own.polygons, crs="EPSG:25833")
    rb.write_footprints(elsewhere, place / "mine" / "hamlet-1.gpkg", overwrite=True)
    far = rb.Footprints.of(shapely.transform(own.polygons, lambda xy: xy + 5000.0), crs=own.crs)
    rb.write_footprints(far, place / "mine" / "hamlet-2.gpkg", overwrite=True)
    (place / "mine" / "hamlet-3.gpkg").rename(place / "mine" / "hamlet-3.kml")
    answer = roofbench("score", "--footprints", "mine", "--suite", "my.toml", "--check", folder=place, expect=2)
    lines = dict(line.split(": ", 1) for line in answer.stdout.splitlines()[:-1])
    assert "hamlet-1.gpkg holds polygons in EPSG:25833, but the scene is in EPSG:25832" in lines["hamlet-1"]
    assert "outside the extent" in lines["hamlet-2"]
    assert "hamlet-3.kml is not a vector file that roofbench reads" in lines["hamlet-3"]
    roofbench("score", "--footprints", "mine", "--suite", "my.toml", folder=place, expect=3)


def test_a_choice_of_scenes_and_detectors_is_no_problem_for_the_others(place):
    only = ("--footprints", "mine", "--suite", "my.toml", "--scenes", "hamlet-1")
    checked = roofbench("score", *only, "--check", folder=place)
    assert checked.stdout.splitlines() == ["hamlet-1: ok", "1 scene, 0 problems"]
    for detectors, shown in (("mpp*", {"precomputed:mine"}), ("nd*", {"precomputed:mine", "ndsm"})):
        roofbench("run", "my.toml", "--scenes", "hamlet-1", "-q", "-j", "0", folder=place)
        board = rows(roofbench("score", *only, "--detectors", detectors, "-f", "json", folder=place))
        assert set(board) == shown


def test_footprints_of_a_scene_in_tiles_are_read_whole(place):
    (place / "my.toml").write_text('[[scenes]]\npath = "village"\ntile = 64\n')
    answer = roofbench("score", "--footprints", "mine", "--suite", "my.toml", "-f", "json", folder=place)
    assert rows(answer)["precomputed:mine"]["object.quality"] == 1.0
    tiled = ("detect", "precomputed[folder=mine]", "village", "--tile", "64", "-o", "out.gpkg", "-j", "0")
    refused = roofbench(*tiled, folder=place, expect=3)
    assert "detect without tiles" in " ".join(refused.stderr.split())
