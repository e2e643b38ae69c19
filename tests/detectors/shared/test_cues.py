import numpy as np
import pytest
from naive import cues as naive_cues

from roofbench.detectors.shared import cues as module
from roofbench.detectors.shared.cues import cell_cues
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Grid

GRID = Grid(500.0, 910.0, 1.0, 8, 10)


def cloud(n=400, seed=0):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(500, 510, n), rng.uniform(902, 910, n)
    z = np.where(x < 505, 8 + 0.5 * (x - 500) + rng.normal(0, 0.02, n), rng.uniform(3, 12, n))
    return x, y, z


@pytest.mark.parametrize("width", [2, 3])
def test_the_roughness_equals_a_plane_fitted_in_every_window(width):
    x, y, z = cloud()
    cues = cell_cues(PointCloud(x, y, z), z.astype(np.float32), GRID, threshold=2.5, window=float(width))
    expected = naive_cues.roughness(x, y, z, GRID, width)
    inner = (slice(1, -1), slice(1, -1))
    np.testing.assert_allclose(cues.roughness[inner], expected[inner], rtol=1e-3, atol=1e-4)


def test_roofs_are_smooth_and_crowns_rough():
    x, y, z = cloud()
    rough = cell_cues(PointCloud(x, y, z), z.astype(np.float32), GRID, threshold=2.5, window=2.0).roughness
    assert np.nanmax(rough[:, :4]) < 0.1
    assert np.nanmedian(rough[:, 6:]) > 1


def test_points_on_one_line_have_no_roughness():
    x = np.linspace(500.1, 509.9, 200)
    z = np.full(200, 7.0)
    cues = cell_cues(PointCloud(x, np.full(200, 905.5), z), z.astype(np.float32), GRID, threshold=2.5, window=2.0)
    assert np.isnan(cues.roughness).all()


def test_shares_count_what_they_say():
    x, y = np.array([500.5, 500.5, 500.5, 500.5]), np.array([909.5] * 4)
    heights = np.array([8.0, 7.0, 0.0, np.nan], dtype=np.float32)
    points = PointCloud(x, y, heights.astype(float), number_of_returns=np.array([3, 1, 3, 2], dtype=np.uint8))
    cues = cell_cues(points, heights, GRID, threshold=2.5, window=1.0)
    assert cues.count[0, 0] == 3
    assert cues.high_share[0, 0] == pytest.approx(2 / 3)
    assert cues.penetration[0, 0] == pytest.approx(1 / 3)
    assert cues.multiple_share[0, 0] == pytest.approx(1 / 2)
    assert cues.height[0, 0] == pytest.approx(7.5)
    # A cell without points takes what is around, one far away knows nothing.
    assert cues.high_share[1, 1] == pytest.approx(2 / 3)
    assert np.isnan(cues.high_share[5, 5])


def test_single_returns_alone_give_no_share_of_multiple_returns():
    x, y, z = cloud()
    points = PointCloud(x, y, z, number_of_returns=np.ones(len(x), dtype=np.uint8))
    assert cell_cues(points, z.astype(np.float32), GRID, threshold=2.5, window=2.0).multiple_share is None


@pytest.mark.parametrize("noise", [0.02, 0.1, 0.4])
def test_the_noise_is_that_of_low_points(noise):
    rng = np.random.default_rng(3)
    x, y = rng.uniform(500, 510, 3000), rng.uniform(902, 910, 3000)
    heights = np.where(x < 507, rng.normal(0, noise, 3000), rng.uniform(3, 9, 3000)).astype(np.float32)
    cues = cell_cues(PointCloud(x, y, heights.astype(float)), heights, GRID, threshold=2.5, window=2.0)
    assert cues.noise == pytest.approx(noise, rel=0.1)


def test_without_low_points_near_each_other_no_noise_is_known():
    x, y, z = cloud()
    assert cell_cues(PointCloud(x, y, z), z.astype(np.float32), GRID, threshold=2.5, window=2.0).noise == 0


@pytest.mark.parametrize("window", [2.0, 3.0])
def test_working_in_strips_changes_nothing(monkeypatch, window):
    x, y, z = cloud(seed=4)
    points, heights = PointCloud(x, y * 4 - 2730, z), z.astype(np.float32)
    grid = Grid(500.0, 910.0, 1.0, 32, 10)
    whole = cell_cues(points, heights, grid, threshold=2.5, window=window).roughness
    monkeypatch.setattr(module, "_STRIP", 1)
    np.testing.assert_allclose(
        cell_cues(points, heights, grid, threshold=2.5, window=window).roughness, whole, rtol=1e-5
    )


def test_tallies_equal_those_of_one_point_at_a_time():
    rng = np.random.default_rng(5)
    n, size = 300, 6
    index, inside = rng.integers(0, size, n), rng.random(n) < 0.9
    heights = rng.uniform(-1, 6, n).astype(np.float32)
    heights[:5] = np.nan, np.inf, -np.inf, 2.5, 1.0
    returns = rng.integers(0, 4, n).astype(np.uint8)
    *tallies, high, low, several = module._tally(index, inside, heights, returns, 2.5, (2, 3))
    expected = naive_cues.tally(index, inside, heights, returns, 2.5, size)
    np.testing.assert_allclose([tally.ravel() for tally in tallies], expected, rtol=1e-12)
    used = inside & np.isfinite(heights)
    assert high.tolist() == np.flatnonzero(used & (heights > 2.5)).tolist()
    assert low.tolist() == np.flatnonzero(used & (heights < 1)).tolist()
    assert several
    assert not module._tally(index, inside, heights, module._NO_RETURNS, 2.5, (2, 3))[-1]


def test_sums_of_blocks_equal_those_of_bincount():
    rng = np.random.default_rng(6)
    index, heights = rng.integers(0, 9, 200), rng.normal(size=200).astype(np.float32)
    chosen = np.flatnonzero(rng.random(200) < 0.5)
    sums = module._sums(index, heights, chosen, 9)
    high = heights[chosen].astype(np.float64)
    for found, weights in zip(sums, (None, high, high**2), strict=True):
        np.testing.assert_allclose(found, np.bincount(index[chosen], weights, minlength=9))
