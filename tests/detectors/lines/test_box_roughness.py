"""The roughness of the laser points in boxes: windows about planes, by a slow oracle on level and sloping roofs."""

import numpy as np
import pytest

from roofbench.detectors.lines.box_roughness import mean_roughness, roughness_sums
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
    rough = roughness_sums(points, z, GRID, spacing=1.0, threshold=2.5)
    assert rough.pixels == 4
    roof, crown = mean_roughness(rough, np.concatenate([box(9, 20, 6), box(31, 20, 6)]))
    assert roof < 0.06
    assert 0.6 < crown < 2.0


def test_low_points_have_none_and_outside_the_grid_there_is_none():
    points, z = cloud(lambda x, y, rng: np.where(x < 20, 5.0, 0.5))
    rough = roughness_sums(points, z, GRID, spacing=1.0, threshold=2.5)
    assert mean_roughness(rough, box(10, 20, 5)) == pytest.approx([0.0], abs=1e-3)
    assert np.isnan(mean_roughness(rough, np.concatenate([box(33, 20, 5), box(90, 20, 5)]))).all()


def test_the_mean_is_that_over_the_cells_with_a_value():
    points, z = cloud(lambda x, y, rng: 5 + rng.normal(0, 0.1 + x / 50, len(x)), seed=3)
    rough = roughness_sums(points, z, GRID, spacing=1.0, threshold=2.5)
    values, known = np.diff(rough.total, axis=1) / 1000, np.diff(rough.known, axis=1) > 0
    rows, columns = np.mgrid[:40, :40] + 0.5
    inside = (abs(columns - 12) < 5) & (abs(40 - rows - 20) < 5) & known
    assert mean_roughness(rough, box(12, 20, 5)) == pytest.approx([values[inside].mean()])


def test_a_cloud_without_high_points_is_no_error():
    points, z = cloud(lambda x, y, rng: np.zeros(len(x)))
    assert np.isnan(mean_roughness(roughness_sums(points, z, GRID, spacing=1.0, threshold=2.5), box(20, 20, 5))).all()
