"""The two real scenes inside the package: opened by name, whole, small, and in the wheel."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from builders import small_scenes

import roofbench as rb
from roofbench.core.errors import InputError
from roofbench.scenes.checking import check_scene
from roofbench.scenes.folder import save_scene
from roofbench.scenes.shipped import shipped_folder, shipped_names

PACKAGE = Path(rb.__file__).parent


def test_there_are_two_of_them():
    assert shipped_names() == ["delft", "ign"]
    assert shipped_folder("delf") is None


@pytest.mark.parametrize("name", shipped_names())
def test_each_is_small_unchanged_and_names_its_licence(name):
    folder = shipped_folder(name)
    assert sum(file.stat().st_size for file in folder.iterdir()) <= 1.5e6
    assert (folder / "LICENCE.txt").read_text().startswith(f"Scene {name}\n")
    scene = rb.open_scene(name)
    assert scene.name == name
    assert len(scene.content_hash) == 64  # reads every checksum
    assert scene.facts["source"]
    assert scene.facts["licence"] in ("CC0 1.0", "Licence Ouverte / Open Licence 2.0 (Etalab)")
    assert {"points", "dem", "reference"} <= set(scene.contents)
    assert not check_scene(folder).problems


def test_the_reference_of_delft_is_complete_inside_its_area():
    scene = rb.open_scene("delft")
    box = shapely.box(*scene.extent)
    inside = shapely.contains_xy(scene.area, *shapely.get_coordinates(shapely.centroid(scene.reference.polygons)).T)
    assert inside.sum() == 97
    assert shapely.covers(box, scene.reference.polygons[inside]).all()
    assert len(np.unique(scene.reference.building_ids)) == len(scene.reference)
    cloud = scene.points
    roof = (cloud.classification == 6) & shapely.contains_xy(scene.area, cloud.x, cloud.y)
    houses = shapely.union_all(shapely.buffer(scene.reference.polygons, 0.5))
    shapely.prepare(houses)
    assert shapely.contains_xy(houses, cloud.x[roof], cloud.y[roof]).mean() > 0.9


def test_the_image_of_ign_is_in_colour():
    scene = rb.open_scene("ign")
    assert scene.image.is_colour
    assert len(scene.reference) == 5


def test_a_scene_folder_in_the_working_directory_comes_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ign").mkdir()  # no scene, hence not meant
    assert rb.open_scene("ign").name == "ign"
    save_scene(small_scenes.scene(), tmp_path / "delft")
    assert rb.open_scene("delft").name == "small"
    assert rb.open_scene("./delft").name == "small"
    assert len(rb.detect("ign", "ndsm")) > 0


def test_a_mistyped_name_is_answered_with_the_nearest():
    with pytest.raises(InputError, match=r"delf: no such folder \(did you mean 'delft'\?\)"):
        rb.open_scene("delf")
