"""The smoothness of the laser points in boxes: windows about planes, on level and sloping roofs and on crowns."""

import numpy as np
import pytest

from roofbench.detectors.lines.box_smoothness import mean_smoothness, smoothness_sums
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Grid

GRID = Grid(500.0, 700.0, 0.25, 160, 160)


def cloud(height, seed=0):
    """Return 1,600 points on 40 x 40 m whose heights are a function of x and y."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 40, (2, 1600))
    z = height(x, y, rng)
    return PointCloud(x + 500, y + 660, z), z


def box(x, y, half):
    return np.array([[x / 0.25, (40 - y) / 0.25, 1.0, 0.0, -half / 0.25, half / 0.25, -half / 0.25, half / 0.25]])


def test_planes_are_smooth_whatever_their_slope_and_crowns_are_rough():
    def height(x, y, rng):
        return np.where(x < 20, 4 + 0.5 * x + 0.3 * y, rng.uniform(3, 9, len(x))) + rng.normal(0, 0.03, len(x))

    points, z = cloud(height)
    smooth = smoothness_sums(points, z, GRID, spacing=1.0, threshold=2.5)
    assert smooth.pixels == 4
    roof, crown = mean_smoothness(smooth, np.concatenate([box(9, 20, 6), box(31, 20, 6)]))
    assert roof == pytest.approx(1.0)
    assert crown < 0.1


def test_low_points_have_none_and_outside_the_grid_there_is_none():
    points, z = cloud(lambda x, y, rng: np.where(x < 20, 5.0, 0.5))
    smooth = smoothness_sums(points, z, GRID, spacing=1.0, threshold=2.5)
    assert mean_smoothness(smooth, box(10, 20, 5)) == pytest.approx([1.0], abs=1e-3)
    assert np.isnan(mean_smoothness(smooth, np.concatenate([box(33, 20, 5), box(90, 20, 5)]))).all()


def test_the_mean_is_that_over_the_cells_with_a_value():
    points, z = cloud(lambda x, y, rng: 5 + rng.normal(0, 0.1 + x / 100, len(x)), seed=3)
    smooth = smoothness_sums(points, z, GRID, spacing=1.0, threshold=2.5)
    values, known = np.diff(smooth.total, axis=1) / 1000, np.diff(smooth.known, axis=1) > 0
    rows, columns = np.mgrid[:40, :40] + 0.5
    inside = (abs(columns - 12) < 5) & (abs(40 - rows - 20) < 5) & known
    assert 0.2 < values[inside].mean() < 0.99
    assert mean_smoothness(smooth, box(12, 20, 5)) == pytest.approx([values[inside].mean()])


def test_a_cloud_without_high_points_is_no_error():
    points, z = cloud(lambda x, y, rng: np.zeros(len(x)))
    assert np.isnan(mean_smoothness(smoothness_sums(points, z, GRID, spacing=1.0, threshold=2.5), box(20, 20, 5))).all()
