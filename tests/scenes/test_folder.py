import shutil

import numpy as np
import pytest
import shapely
from builders import small_scenes

import roofbench as rb
from roofbench.core.errors import InputError, OutputError
from roofbench.scenes import folder


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenes") / "small"
    rb.save_scene(small_scenes.scene(), path)
    return path


def test_a_saved_scene_opens_as_it_was(saved):
    before, after = small_scenes.scene(), rb.open_scene(saved)
    assert (after.name, after.extent, after.crs) == (before.name, before.extent, before.crs)
    assert after.facts == before.facts
    for column in ("x", "y", "z"):
        np.testing.assert_allclose(getattr(after.points, column), getattr(before.points, column), atol=1e-9, rtol=1e-14)
    for column in ("return_number", "number_of_returns", "intensity", "classification"):
        np.testing.assert_array_equal(getattr(after.points, column), getattr(before.points, column))
    assert after.points.colour is None
    np.testing.assert_array_equal(after.image.values, before.image.values)
    assert (after.image.bands, after.image.grid, after.image.valid) == (before.image.bands, before.image.grid, None)
    np.testing.assert_array_equal(after.dem.values, before.dem.values)
    assert after.dem.grid == before.dem.grid
    assert shapely.equals_exact(after.reference.polygons, before.reference.polygons, 1e-9).all()
    assert after.reference.building_ids.tolist() == ["a", "a"]
    assert shapely.equals(after.area, before.area)


def test_the_same_scene_gives_the_same_bytes_and_the_same_hash(saved, tmp_path):
    rb.save_scene(small_scenes.scene(), tmp_path / "again")
    for file in sorted(saved.iterdir()):
        assert file.read_bytes() == (tmp_path / "again" / file.name).read_bytes(), file.name
    assert rb.open_scene(saved).content_hash == rb.open_scene(tmp_path / "again").content_hash


@pytest.mark.parametrize(
    "change",
    [
        {"points": small_scenes.cloud(seed=1)},
        {"image": small_scenes.image(seed=1)},
        {"dem": None},
        {"reference": rb.Footprints.empty(crs=small_scenes.CRS)},
        {"area": None},
        {"crs": "EPSG:25833"},
    ],
    ids=lambda change: next(iter(change)),
)
def test_the_hash_changes_with_everything_the_scene_holds(saved, tmp_path, change):
    rb.save_scene(small_scenes.scene(**change), tmp_path / "other")
    assert rb.open_scene(saved).content_hash != rb.open_scene(tmp_path / "other").content_hash


def test_nothing_is_read_before_it_is_asked_for(saved, tmp_path):
    broken = tmp_path / "broken"
    shutil.copytree(saved, broken)
    (broken / "points.laz").write_bytes(b"nonsense")
    opened = rb.open_scene(broken)
    assert opened.image.is_colour
    with pytest.raises(InputError, match=r"points\.laz is not a LAS file"):
        _ = opened.points


def test_a_scene_for_detection_shows_neither_reference_nor_classes(saved):
    seen = rb.open_scene(saved / "scene.toml").for_detection()
    assert seen.points.classification is None
    assert seen.points.intensity is not None
    assert (seen.reference, seen.area, seen.facts) == (None, None, {})


def test_a_scene_of_points_alone_has_nothing_else(tmp_path):
    bare = small_scenes.scene(image=None, dem=None, reference=None, area=None, crs=None, facts={})
    rb.save_scene(bare, tmp_path / "bare")
    after = rb.open_scene(tmp_path / "bare")
    assert sorted(file.name for file in (tmp_path / "bare").iterdir()) == ["points.laz", "scene.toml"]
    assert (after.image, after.dem, after.reference, after.area, after.crs) == (None,) * 5


def test_coloured_points_and_masked_four_band_images_come_back(tmp_path):
    image = small_scenes.image(bands=("red", "green", "blue", "nir"), dtype=np.uint16)
    valid = np.ones(image.grid.shape, bool)
    valid[:10] = False
    image = rb.Image(image.values, image.bands, image.grid, valid)
    before = small_scenes.scene(points=small_scenes.cloud(colour=True), image=image)
    rb.save_scene(before, tmp_path / "colour")
    after = rb.open_scene(tmp_path / "colour")
    np.testing.assert_array_equal(after.points.colour, before.points.colour)
    np.testing.assert_array_equal(after.image.values, image.values)
    np.testing.assert_array_equal(after.image.valid, valid)
    assert after.image.bands == image.bands


def test_a_file_edited_later_is_noticed_and_can_be_sealed(saved, tmp_path):
    edited = tmp_path / "edited"
    shutil.copytree(saved, edited)
    rb.write_footprints(
        rb.Footprints.of([shapely.box(0, 0, 1, 1)], crs=small_scenes.CRS), edited / "reference.gpkg", overwrite=True
    )
    with pytest.raises(InputError, match=r"reference\.gpkg changed since .*--update-checksums"):
        _ = rb.open_scene(edited).content_hash
    assert folder.update_checksums(edited) == ["reference.gpkg"]
    assert folder.changed_files(edited) == []
    assert rb.open_scene(edited).content_hash != rb.open_scene(saved).content_hash


def test_an_existing_folder_is_replaced_only_on_request(saved, tmp_path):
    target = tmp_path / "target"
    shutil.copytree(saved, target)
    with pytest.raises(OutputError, match="exists already: set overwrite=True"):
        rb.save_scene(small_scenes.scene(), target)
    rb.save_scene(small_scenes.scene(dem=None), target, overwrite=True)
    assert not (target / "dem.tif").exists()


def test_a_failure_half_way_leaves_nothing(tmp_path):
    def unreadable():
        raise InputError("no more")

    with pytest.raises(InputError, match="no more"):
        rb.save_scene(small_scenes.scene(reference=unreadable), tmp_path / "never")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("format = ", "is not valid TOML"),
        ('format = 99\nname = "a"\nextent = [0, 0, 1, 1]', "format 99 is not 1"),
        ("format = 1\nextent = [0, 0, 1, 1]", "it needs a name"),
        ('format = 1\nname = "a"\nextent = [0, 0, 0, 1]', r"must be \[xmin"),
        ('format = 1\nname = "a"\nextent = [0, 0, nan, 1]', r"must be \[xmin"),
        ('format = 1\nname = "a"\nextent = "all"', r"must be \[xmin"),
        ('format = 1\nname = "a"\ncrs = 4\nextent = [0, 0, 1, 1]', "must be a text such as"),
        ('format = 1\nname = "a"\nunits = "foot"\nextent = [0, 0, 1, 1]', "must be metre"),
        ('format = 1\nname = "a"\nextent = [0, 0, 1, 1]\n[files.dsm]\nsha256 = "0"', "is none of points"),
        ('format = 1\nname = "a"\nextent = [0, 0, 1, 1]\n[files.dem]\nsha256 = 0', "needs its sha256"),
        (
            'format = 1\nname = "a"\nextent = [0, 0, 1, 1]\n[files.dem]\nsha256 = "0"\nfile="../dem.tif"',
            "always dem.tif",
        ),
        ('format = 1\nname = "a"\nextent = [0, 0, 1, 1]\n[files.dem]\nsha256 = "0"', "dem.tif: no such file"),
    ],
)
def test_a_wrong_manifest_is_answered_in_words(tmp_path, text, message):
    (tmp_path / "scene.toml").write_text(text)
    with pytest.raises(InputError, match=message):
        rb.open_scene(tmp_path)


def test_a_folder_that_is_no_scene_is_answered_in_words(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        rb.open_scene(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"there is no scene\.toml in it"):
        rb.open_scene(tmp_path)


def test_a_scene_never_replaces_a_folder_with_other_files(saved, tmp_path):
    shutil.copytree(saved, tmp_path / "own")
    (tmp_path / "own" / "reference.qmd").write_text("left by a GIS")
    rb.save_scene(small_scenes.scene(), tmp_path / "own", overwrite=True)
    (tmp_path / "own" / "project.qgz").write_text("hours of work")
    with pytest.raises(OutputError, match=r"own holds project\.qgz, which replacing it would delete"):
        rb.save_scene(small_scenes.scene(), tmp_path / "own", overwrite=True)


@pytest.mark.parametrize(("crs", "message"), [("EPSG:4326", "geographic"), ("EPSG:1", "not a coordinate reference")])
def test_a_manifest_with_a_crs_that_cannot_be_is_refused(saved, tmp_path, crs, message):
    shutil.copytree(saved, tmp_path / "wrong")
    file = tmp_path / "wrong" / "scene.toml"
    file.write_text(file.read_text().replace(small_scenes.CRS, crs))
    with pytest.raises(InputError, match=rf"scene\.toml: .*{message}"):
        rb.open_scene(tmp_path / "wrong")
