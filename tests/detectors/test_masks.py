"""Masks and ground heights: what each point marks, and which height is its ground."""

import numpy as np
import pytest

from roofbench.detectors.lines.masks import build_masks, ground_heights, point_spacing
from roofbench.scenes.points import PointCloud
from roofbench.scenes.raster import Elevation, Grid

GRID = Grid(0.0, 30.0, 0.15, 200, 200)


def cloud(x, y, z, **more):
    return PointCloud(*(np.asarray(values, dtype=np.float64) for values in (x, y, z)), **more)


def test_a_low_point_marks_five_by_five_pixels_white_and_a_high_one_black():
    x, y = (values.ravel() for values in np.meshgrid(np.arange(1.0, 30, 2), np.arange(1.0, 30, 2)))
    level = np.full(len(x), 2.5)  # At the threshold: covers the scene and marks nothing.
    points = cloud([15.0, 7.575, *x], [15.0, 22.425, *y], [0.0, 5.0, *level])
    masks = build_masks(points, np.full(len(points), 2.5), GRID, neighbourhood=0.75)
    assert masks.neighbourhood == 5
    white = np.argwhere((masks.primary == 0) & (masks.coverage == 1))
    assert len(white) == 25
    black = np.argwhere(masks.secondary == 1)
    assert black.min(axis=0).tolist() == [48, 48]
    assert black.max(axis=0).tolist() == [52, 52]


def test_a_point_at_the_threshold_marks_nothing():
    masks = build_masks(cloud([15.0], [15.0], [2.5]), np.array([2.5]), GRID, neighbourhood=0.75)
    assert masks.secondary.sum() == 0
    assert (masks.primary == masks.coverage).all()


def test_beyond_the_points_nothing_is_black_but_a_void_within_them_is():
    x, y = (values.ravel() for values in np.meshgrid(np.arange(0.25, 15, 0.5), np.arange(0.25, 30, 0.5)))
    void = (abs(x - 7) < 4) & (abs(y - 15) < 4)
    points = cloud(x[~void], y[~void], np.zeros((~void).sum()))
    masks = build_masks(points, np.full(len(points), 2.5), GRID, neighbourhood=0.75)
    assert masks.primary[:, 120:].sum() == 0
    assert masks.primary[90:110, 35:58].all()


def test_the_neighbourhood_is_an_odd_number_of_pixels_at_any_ground_sampling_distance():
    for gsd, side in ((0.15, 5), (0.1, 7), (0.5, 1), (0.05, 15)):
        grid = Grid(0.0, 30.0, gsd, 60, 60)
        assert build_masks(cloud([1.0], [29.0], [0.0]), np.array([2.5]), grid, neighbourhood=0.75).neighbourhood == side


def test_point_spacing_counts_pulses_and_not_returns():
    x, y = (values.ravel() for values in np.meshgrid(np.arange(0.25, 30, 0.5), np.arange(0.25, 30, 0.5)))
    once = cloud(x, y, np.zeros_like(x))
    assert point_spacing(once, GRID) == pytest.approx(0.5)
    numbers = np.repeat(np.array([1, 2], dtype=np.uint8), len(x))
    twice = cloud(np.tile(x, 2), np.tile(y, 2), np.zeros(2 * len(x)), return_number=numbers)
    assert point_spacing(twice, GRID) == pytest.approx(0.5)


def test_the_ground_of_a_tile_is_the_mean_of_its_elevation():
    grid = Grid(0.0, 20.0, 1.0, 20, 20)
    x = grid.to_world(0, np.arange(20) + 0.5)[0]
    dem = Elevation(np.tile(x.astype(np.float32), (20, 1)), grid)
    ground = ground_heights(cloud([1, 9, 11], [5, 5, 5], [0, 0, 0]), dem, method="tile-dem", tile_side=10.0)
    assert ground.tolist() == [5.0, 5.0, 15.0]


def test_the_mode_of_a_tile_is_the_middle_of_its_fullest_two_metre_bin():
    points = cloud([1, 2, 3, 4], [1, 2, 3, 4], [10.1, 10.9, 11.5, 17.0])
    assert ground_heights(points, None, method="tile-mode", tile_side=10.0).tolist() == [11.0] * 4


def test_where_the_elevation_is_unknown_its_neighbourhood_stands_in():
    values = np.full((20, 20), 7.0, np.float32)
    values[8:12, 8:12] = np.nan
    dem = Elevation(values, Grid(0.0, 20.0, 1.0, 20, 20))
    assert ground_heights(cloud([10], [10], [0]), dem, method="point-dem", tile_side=1.0) == pytest.approx([7.0])
