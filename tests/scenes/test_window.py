"""Windows: the part of a scene, from memory or from files, is what lies inside."""

import numpy as np
import pytest
from builders.copc_files import write_copc
from builders.small_scenes import CRS, SOUTH, WEST, cloud, image, scene

import roofbench as rb
from roofbench.core.errors import InputError
from roofbench.scenes.folder import open_scene, save_scene
from roofbench.scenes.geodata.density import point_counts
from roofbench.scenes.geodata.las_files import read_points

EXTENT = (WEST + 12.25, SOUTH + 5.5, WEST + 25.0, SOUTH + 20.0)


def inside(points):
    x, y = points.x, points.y
    return points.take((x >= EXTENT[0]) & (x <= EXTENT[2]) & (y >= EXTENT[1]) & (y <= EXTENT[3]))


def assert_part_of(part, whole):
    assert part.extent == EXTENT
    assert np.array_equal(part.points.x, inside(whole.points).x)
    assert np.array_equal(part.points.classification, inside(whole.points).classification)
    for raster, of in ((part.image, whole.image), (part.dem, whole.dem)):
        west, _, _, north = raster.grid.extent
        assert west <= EXTENT[0] < west + raster.grid.gsd
        assert north - raster.grid.gsd < EXTENT[3] <= north
        row, column = round((of.grid.north - north) / of.grid.gsd), round((west - of.grid.west) / of.grid.gsd)
        rows, columns = raster.values.shape[-2:]
        same = of.values[..., row : row + rows, column : column + columns]
        assert np.array_equal(raster.values, same, equal_nan=True)
    assert len(part.reference) == 2
    assert part.area.bounds == EXTENT


def test_a_window_of_a_scene_in_memory_is_what_lies_inside():
    whole = scene()
    assert_part_of(whole.window(EXTENT), whole)


def test_a_window_of_a_folder_is_read_without_the_whole(tmp_path, monkeypatch):
    save_scene(scene(), tmp_path / "small")
    whole, opened = open_scene(tmp_path / "small"), open_scene(tmp_path / "small")
    monkeypatch.setattr(opened, "_get", pytest.fail)
    assert_part_of(opened.window(EXTENT), whole)


def test_a_halo_widens_a_window_up_to_the_border_of_the_scene():
    part = scene().window((WEST, SOUTH + 10, WEST + 10, SOUTH + 20), halo=5)
    assert part.extent == (WEST, SOUTH + 5, WEST + 15, SOUTH + 25)


def test_a_window_beside_the_scene_is_refused():
    with pytest.raises(InputError, match="does not meet"):
        scene().window((0, 0, 10, 10))


def test_the_hash_of_a_window_follows_extent_and_content(tmp_path):
    save_scene(scene(), tmp_path / "one")
    save_scene(scene(points=cloud(seed=1)), tmp_path / "two")
    one, two = open_scene(tmp_path / "one"), open_scene(tmp_path / "two")
    assert one.window(EXTENT).content_hash == open_scene(tmp_path / "one").window(EXTENT).content_hash
    assert one.window(EXTENT).content_hash != two.window(EXTENT).content_hash
    assert one.window(EXTENT).content_hash != one.window(EXTENT, halo=1).content_hash


def test_a_window_of_a_copc_file_holds_the_same_points(tmp_path):
    points = cloud()
    write_copc(tmp_path / "a.copc.laz", points, crs=CRS)
    read = read_points(tmp_path / "a.copc.laz", window=EXTENT)
    assert np.array_equal(np.sort(read.x), np.sort(inside(points).x))


def test_the_ground_of_a_window_is_that_of_the_scene_away_from_its_border():
    """Without a DEM the filter sees less in a window; a halo wider than the largest object makes up for it."""
    rng = np.random.default_rng(5)
    x, y = rng.uniform(0, 600, 200_000), rng.uniform(0, 600, 200_000)
    ground = 40 + 8 * np.sin(x / 90) + 6 * np.cos(y / 120) + 0.02 * x
    house = (x % 40 < 12) & (y % 40 < 15)
    points = rb.PointCloud(x=x, y=y, z=ground + 6 * house + rng.normal(0, 0.02, len(x)))
    whole = rb.Scene("hills", (0, 0, 600, 600), points=points)
    whole.ground_cell = 2.0
    core = (200, 200, 400, 400)
    part = whole.window(core, halo=150)
    assert part.heights.ground.grid.gsd == whole.heights.ground.grid.gsd
    at_x, at_y = (values.ravel() for values in np.meshgrid(np.arange(201, 400, 1.0), np.arange(201, 400, 1.0)))
    difference = np.abs(part.heights.ground.sample(at_x, at_y) - whole.heights.ground.sample(at_x, at_y))
    assert np.quantile(difference, 0.995) < 0.05
    assert difference.max() < 0.5


def test_an_image_window_keeps_its_mask():
    whole = image()
    masked = rb.Image(whole.values, whole.bands, whole.grid, np.arange(80 * 80).reshape(80, 80) % 2 == 0)
    part = scene(image=masked).window(EXTENT).image
    assert part.valid.shape == part.values.shape[1:]
    assert not part.valid.all()


def test_the_ground_of_a_complete_dem_is_the_same_in_a_window():
    dem = rb.Elevation(np.arange(1600, dtype=np.float32).reshape(40, 40), rb.Grid(WEST, SOUTH + 40, 1.0, 40, 40))
    whole = scene(dem=dem)
    part = whole.window((WEST + 10, SOUTH + 10, WEST + 20, SOUTH + 20), halo=2)
    assert part.heights.ground.sample(WEST + 15.3, SOUTH + 15.7) == dem.sample(WEST + 15.3, SOUTH + 15.7)


def test_the_density_of_a_window_is_that_of_the_scene_away_from_its_border():
    rng = np.random.default_rng(8)
    x, y = 84000 + rng.uniform(0, 300, 90_000), 447000 + 300 * rng.beta(2, 3, 90_000)
    whole = rb.Scene("density", (84000, 447000, 84300, 447300), points=rb.PointCloud(x=x, y=y, z=np.zeros(len(x))))
    core = (84100.0, 447100.0, 84200.0, 447180.0)
    part = whole.window(core, halo=8)
    grid, around = (rb.Grid.covering(extent, 4.0) for extent in (core, part.extent))
    counts = point_counts(x, y, grid)
    assert np.array_equal(point_counts(part.points.x, part.points.y, grid), counts)
    assert np.array_equal(point_counts(part.points.x, part.points.y, around)[2:-2, 2:-2], counts)
    assert counts.min() > 0
