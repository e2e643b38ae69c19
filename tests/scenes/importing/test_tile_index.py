"""Folders of tiles: an index of bounds makes them a scene that is read by window, whatever single files are like."""

import tomllib

import numpy as np
import pytest
from builders.small_scenes import CRS, SOUTH, WEST, cloud, image, scene

from roofbench.core.errors import CRSError, InputError
from roofbench.scenes.checking import check_scene
from roofbench.scenes.folder import changed_files, open_scene, save_scene
from roofbench.scenes.geodata.las_files import read_points, write_points
from roofbench.scenes.geodata.point_chunks import read_chunk_index, write_chunk_index
from roofbench.scenes.geodata.raster_files import write_elevation, write_image
from roofbench.scenes.importing import tile_index
from roofbench.scenes.importing.tile_index import index_folder

WHOLE = (WEST, SOUTH, WEST + 40, SOUTH + 40)
QUARTERS = [(WEST + x, SOUTH + y, WEST + x + 20, SOUTH + y + 20) for y in (0, 20) for x in (0, 20)]


@pytest.fixture
def tiles(tmp_path):
    """Four quarters of a small scene that overlap by 2 m."""
    folder, whole = tmp_path / "tiles", scene()
    for layer in ("points", "ortho", "dem"):
        (folder / layer).mkdir(parents=True)
    for number, quarter in enumerate(QUARTERS):
        part = whole.window(quarter, halo=1)
        write_points(part.points, folder / "points" / f"{number}.laz", crs=CRS)
        write_image(part.image, folder / "ortho" / f"{number}.tif", crs=CRS)
        write_elevation(part.dem, folder / "dem" / f"{number}.tif", crs=CRS)
    return folder


def ordered(points):
    return np.sort(points.x + 1j * points.y)


def test_an_indexed_folder_is_the_scene_of_its_tiles(tiles):
    found, whole = index_folder(tiles), scene()
    assert found.problems == ()
    assert found.scene.contents == ("points", "image", "dem")
    assert found.scene.extent == WHOLE
    assert check_scene(tiles).problems == ()
    assert np.array_equal(ordered(found.scene.points), ordered(whole.points))
    assert np.array_equal(found.scene.image.values, whole.image.values)
    assert found.scene.image.grid == whole.image.grid
    assert np.array_equal(found.scene.dem.values, whole.dem.values, equal_nan=True)


def test_a_window_opens_only_the_files_that_it_meets(tiles):
    opened = index_folder(tiles).scene
    extent = (WEST + 3, SOUTH + 3, WEST + 12, SOUTH + 12)
    for layer in ("points", "ortho", "dem"):
        for number in (1, 2, 3):
            next((tiles / layer).glob(f"{number}.*")).unlink()
    part, whole = opened.window(extent), scene().window(extent)
    assert np.array_equal(ordered(part.points), ordered(whole.points))
    assert np.array_equal(part.image.values, whole.image.values)
    assert part.image.grid == whole.image.grid
    with pytest.raises(InputError, match=r"3\.laz: no such file"):
        _ = opened.window((WEST + 30, SOUTH + 30, WEST + 39, SOUTH + 39)).points


def test_a_file_that_changed_since_the_index_is_refused_and_changes_the_hash_of_its_windows_alone(tiles):
    opened = index_folder(tiles).scene
    west, east = (WEST, SOUTH, WEST + 10, SOUTH + 10), (WEST + 30, SOUTH, WEST + 40, SOUTH + 10)
    before = [opened.window(extent).content_hash for extent in (west, east)]
    write_points(cloud(seed=9).window(QUARTERS[1]), tiles / "points" / "1.laz", crs=CRS)
    assert changed_files(tiles) == ["points/1.laz"]
    with pytest.raises(InputError, match="changed since the scene was indexed"):
        _ = opened.window(east).points
    again = index_folder(tiles).scene
    after = [again.window(extent).content_hash for extent in (west, east)]
    assert after[0] == before[0]
    assert after[1] != before[1]


def test_files_that_cannot_be_used_are_named_and_the_others_are_indexed(tiles):
    (tiles / "points" / "0.laz").write_bytes(b"no points")
    write_points(cloud(), tiles / "points" / "other.laz", crs="EPSG:25833")
    write_points(cloud(), tiles / "points" / "feet.laz", crs="EPSG:2263")
    coarse = image(gsd=1.0)
    write_image(coarse, tiles / "ortho" / "coarse.tif", crs=CRS)
    found = index_folder(tiles, crs=CRS)
    named = sorted(problem.partition(" ")[0] for problem in found.problems)
    assert named == ["ortho/coarse.tif", "points/0.laz", "points/feet.laz", "points/other.laz"]
    assert len(found.scene.window((WEST + 25, SOUTH + 25, WEST + 35, SOUTH + 35)).points) > 0
    assert tomllib.loads((tiles / "scene.toml").read_text())["left_out"] == list(found.problems)


def test_a_large_file_with_broken_chunks_is_no_part_of_the_scene(tiles, monkeypatch):
    monkeypatch.setattr(tile_index, "_LARGE", 1)
    broken = sorted(tiles.rglob("*.laz"))[0]
    content = broken.read_bytes()
    broken.write_bytes(content[:2000] + bytes(len(content) - 2200) + content[-200:])
    indexed = index_folder(tiles)
    assert broken.name in indexed.problems[0]
    assert not [entry for entry in indexed.scene.left_out if broken.name not in entry]
    listed = (tiles / "scene.toml").read_text()
    assert f'file = "{broken.relative_to(tiles).as_posix()}"' not in listed


def test_points_of_noise_are_left_out(tmp_path):
    points = cloud()
    points.classification[:10] = 7
    (tmp_path / "tiles").mkdir()
    write_points(points, tmp_path / "tiles" / "a.laz", crs=CRS)
    assert len(index_folder(tmp_path / "tiles").scene.points) == len(points) - 10


def test_a_folder_without_tiles_or_crs_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no tiles"):
        index_folder(tmp_path)
    with pytest.raises(InputError, match="no such folder"):
        index_folder(tmp_path / "missing")
    write_points(cloud(), tmp_path / "a.laz")
    with pytest.raises(CRSError, match="crs="):
        index_folder(tmp_path)
    save_scene(scene(), tmp_path / "scene")
    with pytest.raises(InputError, match="single files"):
        index_folder(tmp_path / "scene")


@pytest.mark.parametrize("file", ["/etc/passwd", "../a.laz"])
def test_a_manifest_cannot_name_files_outside_its_folder(tiles, file):
    index_folder(tiles)
    manifest = tiles / "scene.toml"
    manifest.write_text(manifest.read_text().replace("points/0.laz", file))
    with pytest.raises(InputError, match="not below the folder"):
        open_scene(tiles)


def test_reference_and_area_belong_to_the_scene(tiles):
    save_scene(scene(), tiles.parent / "whole")
    for name in ("reference.gpkg", "area.gpkg"):
        (tiles.parent / "whole" / name).rename(tiles / name)
    found = index_folder(tiles).scene
    assert len(found.reference) == 2
    assert found.area is not None


@pytest.mark.parametrize("ending", ["laz", "las"])
def test_a_window_of_a_large_file_reads_the_chunks_that_it_meets(tmp_path, monkeypatch, ending):
    monkeypatch.setattr(tile_index, "_LARGE", 1)
    whole, file = cloud(160_000), tmp_path / f"a.{ending}"
    points = whole.take(np.argsort(whole.x, kind="stable"))
    write_points(points, file, crs=CRS)
    opened = index_folder(tmp_path).scene
    extent = (WEST + 30, SOUTH + 5, WEST + 36, SOUTH + 30)
    seen = []
    ((sha, bounds),) = read_chunk_index(tmp_path).items()
    assert len(bounds) == 4
    read_points(file, window=extent, chunks={file: bounds}, progress=lambda *counts: seen.append(counts))
    assert seen[-1] == (50_000, 160_000)
    part, same = opened.window(extent).points, points.window(extent)
    assert np.array_equal(part.x, same.x)
    assert np.array_equal(part.classification, same.classification)
    # An index that does not fit the file is not used.
    write_chunk_index(tmp_path, {sha: bounds[:1]})
    assert np.array_equal(open_scene(tmp_path).window(extent).points.x, same.x)
