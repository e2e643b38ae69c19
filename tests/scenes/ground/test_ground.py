import numpy as np
import pytest
from naive import ground as naive_ground
from shapely import box, contains_xy
from shapely.affinity import rotate

from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid
from roofbench.scenes.ground.filling import fill_unknown
from roofbench.scenes.ground.filter import elevation_from_points, ground_surface
from roofbench.scenes.ground.lowest_points import default_cell, lowest_surface, mean_above

EXTENT = (1000.0, 2000.0, 1160.0, 2120.0)


def town(terrain, roofs=(), *, density=4.0, extent=EXTENT, seed=0):
    """Points on a terrain z(x, y) with flat roofs (xmin, ymin, xmax, ymax, height above their centre's ground)."""
    rng = np.random.default_rng(seed)
    xmin, ymin, xmax, ymax = extent
    n = int((xmax - xmin) * (ymax - ymin) * density)
    x, y = rng.uniform(xmin, xmax, n), rng.uniform(ymin, ymax, n)
    truth = terrain(x, y)
    z = truth.copy()
    for west, south, east, north, height in roofs:
        inside = (x > west) & (x < east) & (y > south) & (y < north)
        z[inside] = terrain(np.array((west + east) / 2), np.array((south + north) / 2)) + height
    return PointCloud(x, y, z + rng.normal(0, 0.03, n)), truth


def flat(x, y):
    return 5.0 + 0.0 * x


def steep(x, y):
    return 100 + 0.364 * (x - 1000)


def hill(x, y):
    return 30 * np.exp(-((x - 1080) ** 2 + (y - 2060) ** 2) / (2 * 40.0**2))


HOUSES = [(1020, 2020, 1032, 2030, 6.0), (1060, 2050, 1072, 2080, 9.0), (1000, 2090, 1015, 2105, 5.0)]


@pytest.mark.parametrize("density", [1.0, 4.0])
@pytest.mark.parametrize(("terrain", "worst"), [(flat, 0.2), (steep, 0.4), (hill, 1.2)])
def test_houses_are_removed_from_any_terrain(terrain, worst, density):
    points, truth = town(terrain, HOUSES, density=density)
    error = ground_surface(points, EXTENT).sample(points.x, points.y) - truth
    # Below the house on the hill top the ground is interpolated through a bend.
    assert np.abs(error).max() < worst
    assert np.percentile(np.abs(error), 97) < 0.15


def test_a_hall_as_wide_as_the_largest_object_is_removed_whole():
    points, truth = town(flat, [(1030, 2015, 1120, 2105, 9.0)])
    error = ground_surface(points, EXTENT, largest_object=100).sample(points.x, points.y) - truth
    assert np.abs(error).max() < 0.3


@pytest.mark.parametrize("terrain", [flat, steep])
def test_a_house_at_the_slanting_edge_of_the_coverage_is_removed_and_the_ground_beyond_it_is_kept(terrain):
    # Flight strips do not end parallel to the grid: the house's side towards the gap has no wall and no ground.
    points, truth = town(terrain, [(1010, 2030, 1045, 2065, 8.0)])
    covered = points.x - 1000 > 0.7 * (points.y - 2000)
    ground = ground_surface(points.take(covered), EXTENT)
    error = ground.sample(points.x[covered], points.y[covered]) - truth[covered]
    # At the very edge the slope below the house is a guess.
    assert np.percentile(np.abs(error), 99) < 0.2
    assert ground.values.min() > truth.min() - 5
    assert ground.values.max() < truth.max() + 5


def test_a_large_building_at_an_angle_is_removed_although_windows_fit_its_middle_first():
    # A tower block of 52 x 40 m turned by 27 degrees: each window reaches further into its corners.
    points, truth = town(flat)
    block = rotate(box(1050, 2040, 1102, 2080), 27)
    inside = contains_xy(block, points.x, points.y)
    points.z[inside] += 17
    error = ground_surface(points, EXTENT).sample(points.x, points.y) - truth
    assert np.abs(error).max() < 0.3


@pytest.mark.parametrize("spacing", [1.0, 2.0])
@pytest.mark.parametrize(("width", "depth"), [(220, 85), (120, 100)])
def test_a_hall_that_the_border_of_the_scene_cuts_is_removed_and_the_upper_side_of_a_cliff_stays(spacing, width, depth):
    extent, west = (0.0, 0.0, 320.0, 240.0), 0.0 if width == 120 else 50.0
    x, y = (axis.ravel() for axis in np.meshgrid(*(np.arange(spacing / 2, end, spacing) for end in extent[2:])))
    hall = (x > west) & (x < west + width) & (y < depth)
    truth = 0.05 * y
    ground = ground_surface(PointCloud(x, y, truth + np.where(hall, 9.0, 0.0)), extent)
    assert np.percentile(np.abs(ground.sample(x, y) - truth)[hall], 90) < 2.0
    upper = y < 100
    ground = ground_surface(PointCloud(x, y, np.where(upper, 12.0, 0.0)), extent)
    assert ground.sample(x[upper], y[upper]).mean() > 11


@pytest.mark.parametrize("spacing", [0.5, 1.0, 2.0])
def test_an_embankment_is_no_wall_at_any_cell_size(spacing):
    extent = (0.0, 0.0, 300.0, 300.0)
    x, y = (axis.ravel() for axis in np.meshgrid(*(np.arange(spacing / 2, 300, spacing),) * 2))
    truth = np.clip(15 - np.maximum(np.hypot(x - 150, y - 150) - 70, 0) * 0.7, 0, 15)
    error = ground_surface(PointCloud(x, y, truth), extent).sample(x, y) - truth
    assert np.abs(error).max() < 2.0


def test_steep_wooded_hills_are_not_cut_off():
    def hills(x, y):
        return 10 * np.sin(x / 18) * np.cos(y / 22)

    points, truth = town(hills, density=2)
    rng = np.random.default_rng(5)
    crowns = rng.uniform([1000, 2000], [1160, 2120], (150, 2))
    near = np.min((points.x[:, None] - crowns[:, 0]) ** 2 + (points.y[:, None] - crowns[:, 1]) ** 2, axis=1) < 9
    points.z[near] += rng.uniform(0, 12, near.sum())
    error = np.abs(ground_surface(points, EXTENT).sample(points.x, points.y) - truth)
    assert np.mean(error > 1) < 0.05


def test_low_outliers_and_birds_do_not_move_the_ground():
    points, truth = town(flat, HOUSES)
    z = points.z.copy()
    z[::397] = -999.0
    z[5::1499] = 180.0
    z[7] = np.nan
    error = ground_surface(PointCloud(points.x, points.y, z), EXTENT).sample(points.x, points.y) - truth
    assert np.abs(error).max() < 0.3


def test_without_points_the_ground_is_unknown():
    none = np.empty(0)
    assert np.isnan(ground_surface(PointCloud(none, none, none), EXTENT).values).all()
    assert np.isnan(elevation_from_points(PointCloud(none, none, none), EXTENT).values).all()


def test_the_lowest_surface_equals_the_oracle():
    rng = np.random.default_rng(1)
    grid = Grid.covering((0, 0, 12, 9), 1.0)
    x, y = rng.uniform(-1, 13, 600), rng.uniform(-1, 10, 600)
    z = rng.choice([0.0, 0.5, 3.0, -40.0], 600, p=[0.2, 0.1, 0.65, 0.05]) + rng.normal(0, 0.01, 600)
    # Heights are compared as float32, so the oracle gets the same.
    z = z.astype(np.float32).astype(np.float64)
    np.testing.assert_array_equal(lowest_surface(x, y, z, grid), naive_ground.lowest_surface(x, y, z, grid))


def test_the_default_cell_holds_two_points_where_there_are_any():
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0, 200, 10_000), rng.uniform(0, 100, 10_000)
    assert default_cell(x, y, (0, 0, 200, 100)) == pytest.approx(2.0, abs=0.15)
    assert default_cell(x, y, (0, 0, 2000, 1000)) == default_cell(x, y, (0, 0, 200, 100))
    assert default_cell(np.repeat(x, 20), np.repeat(y, 20), (0, 0, 200, 100)) == 1.0
    assert default_cell(x, y, (500, 500, 600, 600)) == 1.0


def test_the_mean_near_a_surface_equals_the_oracle():
    rng = np.random.default_rng(4)
    grid = Grid.covering((0, 0, 12, 9), 1.0)
    surface = Elevation(rng.normal(300, 0.2, grid.shape).astype(np.float32), grid)
    x, y = rng.uniform(-1, 13, 400_000), rng.uniform(-1, 10, 400_000)
    x[:200_000], y[:200_000] = rng.uniform(0, 11, 200_000), rng.uniform(3, 9, 200_000)
    x[-1], y[-2] = np.nan, np.inf
    z = surface.sample(x, y) + rng.choice([-2.0, 0.1, 5.0], len(x)) + rng.normal(0, 0.3, len(x))
    z[(y < 2) & (x < 3)] = 350.0
    mean = naive_ground.mean_above(x, y, z, surface, 0.4)
    assert np.isnan(mean).any()
    np.testing.assert_allclose(mean_above(x, y, z, surface, tolerance=0.4), mean, rtol=0, atol=1e-6)


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (31, 50), (64, 33)])
def test_filling_keeps_known_cells_and_fills_all_others(shape):
    values = np.random.default_rng(2).normal(300, 5, shape).astype(np.float32)
    holes = values.copy()
    holes.flat[1::2] = np.nan
    filled = fill_unknown(holes)
    assert np.isfinite(filled).all()
    np.testing.assert_array_equal(filled[np.isfinite(holes)], holes[np.isfinite(holes)])


def test_a_gap_in_a_slope_is_filled_along_the_slope():
    row, column = np.indices((60, 80), dtype=np.float32)
    slope = 0.3 * column - 0.1 * row
    holes = slope.copy()
    holes[20:40, 30:55] = np.nan
    assert np.abs(fill_unknown(holes) - slope).max() < 0.15


def test_ground_points_give_their_mean_per_cell():
    points = PointCloud(np.array([0.2, 0.8, 1.5]), np.array([0.5, 0.5, 0.5]), np.array([1.0, 2.0, 7.0]))
    dem = elevation_from_points(points, (0, 0, 3, 1), cell=1.0)
    np.testing.assert_allclose(dem.values[0, :2], [1.5, 7.0])
    assert 1.5 <= dem.values[0, 2] <= 7.0


def closed_surface(size, roofs, *, smooth=0.0, relief=0.0):
    """One point a square metre on a closed surface: no point lies on a wall, and `smooth` (m) blurs the steps."""
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(7)
    y, x = np.mgrid[:size, :size] + 0.5
    truth = relief * np.sin(x / 60) * np.cos(y / 75)
    surface = truth.copy()
    inside = np.zeros(truth.shape, dtype=bool)
    for left, bottom, right, top, height in roofs:
        roof = (x >= left) & (x < right) & (y >= bottom) & (y < top)
        surface[roof] += height
        inside |= roof
    if smooth:
        surface = gaussian_filter(surface, smooth)
    surface += rng.normal(0, 0.05, surface.shape)
    points = PointCloud(x.ravel(), y.ravel(), surface.ravel())
    error = ground_surface(points, (0, 0, size, size)).sample(x.ravel(), y.ravel()) - truth.ravel()
    return error[inside.ravel()], error[~inside.ravel()]


BLOCKS = [(20 + 110 * i, 20 + 110 * j, 118 + 110 * i, 118 + 110 * j, 18) for i in range(3) for j in range(3)]


@pytest.mark.parametrize("smooth", [0.0, 1.0, 2.0])
@pytest.mark.parametrize(
    ("size", "roofs", "relief"),
    [
        (360, [(30, 120, 330, 220, 12)], 0.0),
        (250, [(80, 80, 165, 160, 12)], 0.0),
        (250, [(80, 80, 165, 160, 12)], 2.0),
        (370, BLOCKS, 0.0),
    ],
    ids=["hall of 300 m x 100 m", "roof of 6 800 m2", "the same on relief", "city blocks on two thirds of the land"],
)
def test_wide_roofs_of_closed_surfaces_are_removed(size, roofs, relief, smooth):
    below_roofs, elsewhere = closed_surface(size, roofs, smooth=smooth, relief=relief)
    assert np.median(below_roofs) < 0.9
    assert np.abs(below_roofs).max() < 2.5
    if smooth < 2:
        assert np.mean(np.abs(elsewhere) > 0.5) < 0.02 + 0.03 * smooth


def test_hills_of_closed_surfaces_stay_ground():
    _, error = closed_surface(400, [], relief=25.0)
    assert np.abs(error).max() < 0.5
