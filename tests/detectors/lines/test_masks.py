"""Masks and ground heights: what each point marks, and which height is its ground."""

import math

import numpy as np
import pytest
from naive import lines as naive_lines

from roofbench.detectors.lines.masks import (
    _lowest,
    build_masks,
    ground_correction,
    ground_heights,
    pulse_spacing,
)
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid

GRID = Grid(0.0, 30.0, 0.15, 200, 200)


def cloud(x, y, z, **more):
    return PointCloud(*(np.asarray(values, dtype=np.float64) for values in (x, y, z)), **more)


def test_a_low_point_marks_five_by_five_pixels_white_and_a_high_one_black():
    x, y = (values.ravel() for values in np.meshgrid(np.arange(1.0, 30, 2), np.arange(1.0, 30, 2)))
    level = np.full(len(x), 2.5)  # At the threshold: covers the scene and marks nothing.
    points = cloud([15.0, 7.575, *x], [15.0, 22.425, *y], [0.0, 5.0, *level])
    masks = build_masks(points, np.full(len(points), 2.5), GRID, neighbourhood=0.75, nearest=False)
    assert masks.neighbourhood == 5
    white = np.argwhere((masks.primary == 0) & (masks.coverage == 1))
    assert len(white) == 25
    black = np.argwhere(masks.secondary == 1)
    assert black.min(axis=0).tolist() == [48, 48]
    assert black.max(axis=0).tolist() == [52, 52]


def test_a_point_at_the_threshold_marks_nothing():
    masks = build_masks(cloud([15.0], [15.0], [2.5]), np.array([2.5]), GRID, neighbourhood=0.75, nearest=True)
    assert masks.secondary.sum() == 0
    # Nothing high is near, so nothing is a roof.
    assert masks.primary.sum() == 0
    printed = build_masks(cloud([15.0], [15.0], [2.5]), np.array([2.5]), GRID, neighbourhood=0.75, nearest=False)
    assert (printed.primary == printed.coverage).all()


def around_a_void(height):
    """Points every half metre of the western half, at a height above ground; none within 4 m of a place."""
    x, y = (values.ravel() for values in np.meshgrid(np.arange(0.25, 15, 0.5), np.arange(0.25, 30, 0.5)))
    void = (abs(x - 7) < 4) & (abs(y - 15) < 4)
    return cloud(x[~void], y[~void], np.full((~void).sum(), height))


@pytest.mark.parametrize(
    ("nearest", "height", "black"), [(False, 0.0, True), (False, 5.0, True), (True, 0.0, False), (True, 5.0, True)]
)
def test_a_void_is_black_where_something_high_is_near_and_in_print_anywhere_but_beyond_the_points(
    nearest, height, black
):
    points = around_a_void(height)
    masks = build_masks(points, np.full(len(points), 2.5), GRID, neighbourhood=1.5, nearest=nearest)
    assert masks.primary[:, 120:].sum() == 0
    assert (masks.primary[90:110, 35:58] == black).all()


def random_roof(seed, count):
    """Points at random places of 30 m x 30 m; those of a roof of 16 m x 8 m are 4 m high."""
    x, y = np.random.default_rng(seed).uniform(0, 30, (2, count))
    return cloud(x, y, np.where((abs(x - 15) < 8) & (abs(y - 15) < 4), 4.0, 0.0))


def test_each_place_is_what_the_nearest_point_is():
    points = random_roof(seed=8, count=500)
    masks = build_masks(points, np.full(500, 2.5), GRID, neighbourhood=1.5, nearest=True)
    squares = build_masks(points, np.full(500, 2.5), GRID, neighbourhood=1.5, nearest=False)
    to_low, to_high = (naive_lines.distances(points, chosen, GRID) for chosen in (points.z < 2.5, points.z > 2.5))
    far = np.minimum(to_low, to_high)
    clear = (abs(to_low - to_high) > 0.03 * far) & (abs(far - 1.5) > 0.05) & (masks.coverage == 1)
    clear &= abs(to_high - 6.0) > 0.15
    white = ((to_low < to_high) & (to_low < 1.5)) | (to_high > 6.0)
    assert (masks.primary[clear] == ~white[clear]).all()
    black = (squares.secondary == 1) | ((to_high < to_low) & (to_high < 1.5))
    assert (masks.secondary[clear] == black[clear]).all()
    assert clear.mean() > 0.9


def test_masks_made_in_bands_have_no_seams():
    points = random_roof(seed=9, count=900)
    fine = Grid(0.0, 30.0, 30 / 1200, 1200, 1200)
    masks = build_masks(points, np.full(900, 2.5), fine, neighbourhood=1.5, nearest=True)
    upside_down = cloud(points.x, 30 - points.y, points.z)
    turned = build_masks(upside_down, np.full(900, 2.5), fine, neighbourhood=1.5, nearest=True)
    # Points on the border of two cells fall to one side or the other.
    assert (masks.primary != turned.primary[::-1]).mean() < 0.01
    assert np.abs((masks.primary != turned.primary[::-1]).mean(axis=1)).max() < 0.03


def test_squares_leave_holes_and_eat_into_a_roof_where_the_nearest_point_does_not():
    px, py = np.meshgrid((np.arange(200) + 0.5) * 0.15, 30 - (np.arange(200) + 0.5) * 0.15)
    roof = (abs(px - 15) < 8) & (abs(py - 15) < 4)
    column, row = np.mgrid[0:30, 0:30].reshape(2, -1)
    black: dict[bool, list[float]] = {True: [], False: []}
    wrong: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(20):
        x, y = np.array([column, row]) + np.random.default_rng(seed).uniform(0, 1, (2, 900))
        points = cloud(x, y, np.where((abs(x - 15) < 8) & (abs(y - 15) < 4), 4.0, 0.0))
        for nearest in (True, False):
            masks = build_masks(points, np.full(900, 2.5), GRID, neighbourhood=1.5, nearest=nearest)
            black[nearest].append(masks.primary[roof].mean())
            wrong[nearest].append((masks.primary != roof).sum() * GRID.gsd**2)
    assert np.mean(black[True]) > 0.94
    assert np.mean(black[False]) < 0.91
    assert np.mean(wrong[True]) < 0.5 * np.mean(wrong[False])


def test_the_neighbourhood_is_an_odd_number_of_pixels_at_any_ground_sampling_distance():
    for gsd, side in ((0.15, 5), (0.1, 7), (0.5, 1), (0.05, 15)):
        grid = Grid(0.0, 30.0, gsd, 60, 60)
        point = cloud([1.0], [29.0], [0.0])
        masks = build_masks(point, np.array([2.5]), grid, neighbourhood=0.75, nearest=False)
        assert masks.neighbourhood == side


def test_pulse_spacing_counts_pulses_and_not_returns():
    x, y = (values.ravel() for values in np.meshgrid(np.arange(0.25, 30, 0.5), np.arange(0.25, 30, 0.5)))
    once = cloud(x, y, np.zeros_like(x))
    assert pulse_spacing(once, GRID) == pytest.approx(0.5)
    numbers = np.repeat(np.array([1, 2], dtype=np.uint8), len(x))
    twice = cloud(np.tile(x, 2), np.tile(y, 2), np.zeros(2 * len(x)), return_number=numbers)
    assert pulse_spacing(twice, GRID) == pytest.approx(0.5)


def test_the_ground_of_a_tile_is_the_mean_of_its_elevation():
    grid = Grid(0.0, 20.0, 1.0, 20, 20)
    x = grid.to_world(0, np.arange(20) + 0.5)[0]
    dem = Elevation(np.tile(x.astype(np.float32), (20, 1)), grid)
    ground = ground_heights(cloud([1, 9, 11], [5, 5, 5], [0, 0, 0]), dem, method="tile-dem", tile_side=10.0)
    assert ground.tolist() == [5.0, 5.0, 15.0]


def test_the_mode_of_a_tile_is_the_middle_of_its_fullest_two_metre_bin():
    points = cloud([1, 2, 3, 4], [1, 2, 3, 4], [10.1, 10.9, 11.5, 17.0])
    assert ground_heights(points, None, method="tile-mode", tile_side=10.0).tolist() == [11.0] * 4


def house_on_a_pad(seed=3):
    """A slope of 12 % with a level pad cut into it; a DEM that knows only the slope; points 1 m apart, and a house."""
    rng = np.random.default_rng(seed)
    column, row = np.mgrid[0:60, 0:60].reshape(2, -1)
    x, y = np.array([column, row]) + rng.uniform(0.1, 0.9, (2, 3600))
    slope = 0.12 * x
    on_pad = (abs(x - 30) < 8) & (abs(y - 30) < 9)
    earth = np.where(on_pad, 0.12 * 22, slope)
    roof = (abs(x - 30) < 6) & (abs(y - 30) < 7)
    return cloud(x, y, np.where(roof, earth + 3.2, earth) + rng.normal(0, 0.05, 3600)), slope, roof


def test_the_ground_is_lowered_to_a_pad_that_the_elevation_cuts_through():
    points, slope, roof = house_on_a_pad()
    uphill = roof & (points.x > 31)
    assert (points.z > slope + 2.5)[uphill].mean() < 0.2
    ground = slope + ground_correction(points, slope, 0.1)
    assert (points.z > ground + 2.5)[roof].mean() > 0.9
    assert not (points.z > ground + 2.5)[~roof].any()
    far = (abs(points.x - 30) > 20) | (abs(points.y - 30) > 20)
    assert np.abs(ground - slope)[far].max() < 0.2


def test_the_ground_never_rises_and_one_stray_point_does_not_lower_it():
    points = house_on_a_pad()[0]
    level = np.full(len(points), 3.0)
    above = cloud(points.x, points.y, level + 1.0)
    assert ground_correction(above, level, 0.1).tolist() == [0.0] * len(points)
    stray = above.z.copy()
    stray[1830] = -20.0
    assert ground_correction(cloud(points.x, points.y, stray), level, 0.1).tolist() == [0.0] * len(points)
    assert ground_correction(above, np.full(len(points), np.nan), 0.1).tolist() == [0.0] * len(points)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
def test_no_more_than_the_share_of_the_points_of_a_cell_lie_below_the_corrected_ground(share):
    rng = np.random.default_rng(12)
    points = cloud(*rng.uniform(0, 40, (2, 3000)), rng.normal(0, 1, 3000))
    step = naive_lines.ground_correction(points.x, points.y, points.z, share, cell=4.0)
    centre = cloud(*(np.mgrid[0:9, 0:9].reshape(2, -1) * 4.0 + 4.0 - 2.0), np.zeros(81))
    both = cloud(*(np.concatenate(pair) for pair in ((points.x, centre.x), (points.y, centre.y), (points.z, centre.z))))
    ground = np.zeros(len(both))
    ground[3000:] = np.nan
    found = ground_correction(both, ground, share)[3000:]
    for x, y, value in zip(centre.x, centre.y, found, strict=True):
        assert value == pytest.approx(step[int(y // 4), int(x // 4)], abs=1e-5)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.35, 1.0])
def test_the_lowest_heights_of_cells_are_those_of_sorted_ones(share):
    rng = np.random.default_rng(3)
    heights = np.concatenate([rng.normal(0, 3, 400), rng.integers(-3, 3, 60), [0.0, -0.0, 1e-8, -1e-8]])
    cell = rng.integers(0, 12, len(heights))  # two cells are empty
    expected = []
    for number in range(14):
        own = np.sort(heights[cell == number].astype(np.float32))
        expected.append(min([*own, 0.0][math.floor(share * len(own))], 0.0))
    wanted = np.ones(14, dtype=np.uint8)
    wanted[[3, 12]] = expected[3] = 0
    np.testing.assert_array_equal(_lowest(heights, cell, share, wanted), np.array(expected, dtype=np.float32))


@pytest.mark.parametrize("height", [0.0, 2.5, 3.0])
def test_corrections_that_decide_give_the_same_points_above_as_all_corrections(height):
    points, slope, _ = house_on_a_pad()
    slope[::97] = np.nan
    every, deciding = ground_correction(points, slope, 0.1), ground_correction(points, slope, 0.1, deciding=height)
    for is_beyond in (np.less, np.greater):
        expected = is_beyond(points.z, slope + every + height)
        np.testing.assert_array_equal(is_beyond(points.z, slope + deciding + height), expected)
    computed = deciding != 0
    assert 0 < computed.sum() < 0.6 * len(points)
    np.testing.assert_array_equal(deciding[computed], every[computed])
