"""Points per square, and the spacing that follows."""

import math

import numpy as np
import pytest
from naive import density as naive_density

from roofbench.scenes.geodata.density import is_lattice, point_counts, point_spacing
from roofbench.scenes.geodata.raster import Grid

EXTENT = (0.0, 0.0, 40.0, 30.0)


def lattice(step, *, width=40.0, height=30.0):
    x, y = np.meshgrid(np.arange(step / 2, width, step), np.arange(step / 2, height, step))
    return x.ravel(), y.ravel()


@pytest.mark.parametrize("step", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("statistic", ["mean", "median", "median-point"])
def test_the_spacing_of_a_lattice_is_its_step_however_little_of_the_extent_it_covers(step, statistic):
    x, y = lattice(step)
    for extent in (EXTENT, (-200, -200, 1000, 1000)):
        assert point_spacing(x, y, extent, statistic=statistic) == pytest.approx(step, rel=0.07)


def test_the_counts_are_those_of_the_oracle():
    rng = np.random.default_rng(0)
    grid = Grid.covering(EXTENT, 4.0)
    x, y = rng.uniform(-3, 43, 500), rng.uniform(-3, 33, 500)
    x[:3], y[3:5] = np.nan, np.inf
    assert point_counts(x, y, grid).tolist() == naive_density.point_counts(x, y, grid)


def test_an_overlap_of_two_strips_moves_the_mean_and_not_the_median():
    x, y = lattice(0.5, height=28)
    twice = x < 12
    x, y = np.concatenate([x, x[twice]]), np.concatenate([y, y[twice]])
    assert point_spacing(x, y, EXTENT, statistic="median") == pytest.approx(0.5)
    assert point_spacing(x, y, EXTENT) == pytest.approx(0.5 / math.sqrt(1.3), rel=0.01)


def test_points_that_cover_parts_of_squares_have_the_spacing_of_their_own_surroundings():
    x, y = lattice(0.5)
    roof = (x > 11) & (x < 21) & (y > 9) & (y < 19)
    assert point_spacing(x[roof], y[roof], EXTENT, square=2.0, statistic="median-point") == pytest.approx(0.5)
    assert point_spacing(x[roof], y[roof], EXTENT, square=2.0) > 0.55


@pytest.mark.parametrize("statistic", ["mean", "median", "median-point"])
def test_without_a_point_in_the_extent_there_is_no_spacing(statistic):
    x, y = lattice(0.5)
    assert point_spacing(x, y, (100, 100, 200, 200), statistic=statistic) is None
    assert point_spacing(np.empty(0), np.empty(0), EXTENT, statistic=statistic) is None


def test_rasters_are_lattices_and_scans_are_not():
    x, y = lattice(0.5)
    rng = np.random.default_rng(1)
    kept = rng.random(len(x)) < 0.5
    assert is_lattice(x, y)
    assert is_lattice(x[kept], y[kept])
    assert not is_lattice(np.append(x, x), np.append(y, y))  # two heights at each place
    assert not is_lattice(np.round(rng.uniform(0, 40, 5000), 2), np.round(rng.uniform(0, 30, 5000), 2))
    assert not is_lattice(np.empty(0), np.empty(0))
