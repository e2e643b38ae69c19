import json

import numpy as np
import pytest
import shapely
from builders import small_scenes
from harness.command_line import run

import roofbench as rb
from roofbench.scenes.checking import check_scene
from roofbench.scenes.geodata.las_files import write_points
from roofbench.scenes.geodata.raster_files import write_elevation, write_image


@pytest.fixture
def saved(tmp_path):
    rb.save_scene(small_scenes.scene(), tmp_path / "small")
    return tmp_path / "small"


@pytest.fixture
def check(saved):
    return lambda *more: run("scenes", "check", saved, *more)


def test_a_sound_scene_has_no_problems(check):
    code, out, err = check()
    assert (code, err) == (0, "")
    assert "count                  4000" in out
    assert "bands          red, green, blue" in out


def test_facts_are_those_of_the_scene(saved):
    report = check_scene(saved)
    truth = small_scenes.scene()
    assert report.problems == ()
    points = report.facts["points"]
    assert points["count"] == 4000
    assert points["density"] == points["first_return_density"] == 4000 / 1600
    assert points["multiple_return_share"] == np.mean(truth.points.number_of_returns > 1)
    assert points["classes"] == {
        "2": int((truth.points.classification == 2).sum()),
        "6": int((truth.points.classification == 6).sum()),
    }
    assert report.facts["image"]["gsd"] == 0.5
    assert report.facts["dem"]["height"] == [100.0, 100.0]
    assert report.facts["dem"]["unknown_share"] == pytest.approx(1 / 1600)
    assert report.facts["dem"]["derived"] == "by hand"
    reference = report.facts["reference"]
    assert (reference["footprints"], reference["buildings"], reference["area"]) == (2, 1, 150 + 84)
    assert report.facts["area"]["share"] == pytest.approx(38**2 / 1600)


def test_facts_are_printed_as_json(check):
    code, out, _ = check("--format", "json")
    assert code == 0
    message = json.loads(out)
    assert message["problems"] == []
    assert message["facts"]["points"]["count"] == 4000


def test_an_edited_file_is_reported_until_its_checksum_is_updated(saved, check):
    write_points(small_scenes.cloud(50), saved / "points.laz", crs=small_scenes.CRS)
    code, _, err = check()
    assert code == 2
    assert "points.laz changed since the manifest was written: if that is intended, run" in err
    assert "--update-checksums" in err
    code, _, err = check("--update-checksums")
    assert (code, err) == (0, "- points.laz was edited; its new checksum is in the manifest\n")
    assert check()[0] == 0


def _shifted_image(saved):
    write_image(small_scenes.image(west=small_scenes.WEST + 30), saved / "ortho.tif", crs=small_scenes.CRS)


def _far_points(saved):
    write_points(small_scenes.cloud(west=0.0), saved / "points.laz", crs=small_scenes.CRS)


def _empty_dem(saved):
    grid = small_scenes.scene().dem.grid
    write_elevation(
        rb.Elevation(np.full(grid.shape, np.nan, np.float32), grid), saved / "dem.tif", crs=small_scenes.CRS
    )


def _other_crs(saved):
    write_image(small_scenes.image(), saved / "ortho.tif", crs="EPSG:25833")


def _far_reference(saved):
    far = rb.Footprints.of([shapely.box(0, 0, 9, 9)], crs=small_scenes.CRS)
    rb.write_footprints(far, saved / "reference.gpkg", overwrite=True)


def _broken_points(saved):
    (saved / "points.laz").write_bytes((saved / "points.laz").read_bytes()[:-500])


@pytest.mark.parametrize(
    ("spoil", "problem"),
    [
        (_shifted_image, "ortho.tif covers only 25% of the extent"),
        (_far_points, "points.laz: 100% of the points lie outside"),
        (_empty_dem, "dem.tif holds no height (all NaN)"),
        (_other_crs, "ortho.tif is in EPSG:25833, but the scene in EPSG:25832"),
        (_far_reference, "reference.gpkg lies outside the extent"),
        (_broken_points, "points.laz is truncated or broken"),
    ],
)
def test_what_does_not_fit_is_reported(saved, check, spoil, problem):
    spoil(saved)
    code, _, err = check("--update-checksums")
    assert code == 2
    assert problem in err


def test_a_folder_that_is_no_scene_is_refused(tmp_path):
    code, out, err = run("scenes", "check", tmp_path)
    assert (code, out) == (2, "")
    assert "there is no scene.toml in it" in err


def test_references_that_overlap_are_warnings_and_no_problem(tmp_path):
    house = small_scenes.scene().reference.polygons[0]
    twice = rb.Footprints.of([house, house], crs=small_scenes.CRS)
    rb.save_scene(small_scenes.scene(reference=twice), tmp_path / "twice")
    code, _, err = run("scenes", "check", tmp_path / "twice")
    assert (code, err.strip()) == (
        0,
        "Warning: 1 pair of references of different buildings, duplicates of each other: 0 and 1",
    )
    content = json.loads(run("scenes", "check", tmp_path / "twice", "-f", "json")[1])
    assert (content["problems"], len(content["warnings"])) == ([], 1)
