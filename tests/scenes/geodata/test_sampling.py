import numpy as np
import pytest
from naive import sampling as naive_sampling

from roofbench.scenes.geodata.raster import Elevation, Grid


@pytest.mark.parametrize("shape", [(1, 1), (1, 6), (5, 1), (7, 9)])
def test_sampling_equals_the_oracle_inside_and_beyond_the_grid(shape):
    rng = np.random.default_rng(3)
    grid = Grid(100.0, 50.0, 2.0, *shape)
    values = rng.normal(300, 5, shape).astype(np.float32)
    values.flat[0] = np.nan
    dem = Elevation(values, grid)
    x, y = rng.uniform(90, 125, 300), rng.uniform(25, 60, 300)
    np.testing.assert_allclose(dem.sample(x, y), naive_sampling.bilinear(dem, x, y), rtol=1e-12)


def test_a_plane_is_sampled_exactly_between_cell_centres():
    grid = Grid(0.0, 10.0, 1.0, 10, 10)
    column, row = np.meshgrid(np.arange(10) + 0.5, np.arange(10) + 0.5)
    x, y = grid.to_world(row, column)
    dem = Elevation((3 * x - 2 * y).astype(np.float32), grid)
    assert dem.sample(4.3, 6.9) == pytest.approx(3 * 4.3 - 2 * 6.9, abs=1e-5)
    assert dem.sample([[1.0, 2.0]], [[3.0, 4.0]]).shape == (1, 2)


def test_points_that_are_not_finite_have_no_elevation():
    dem = Elevation(np.ones((2, 2), dtype=np.float32), Grid(0.0, 2.0, 1.0, 2, 2))
    assert np.isnan(dem.sample([np.nan, np.inf, 1.0], [1.0, 1.0, -np.inf])).all()


@pytest.mark.parametrize("grid", [Grid(10.0, 30.0, 0.25, 40, 60), Grid(-3.1, 7.3, 0.35, 11, 13)])
def test_cells_equal_those_of_one_point_at_a_time(grid):
    rng = np.random.default_rng(1)
    west, south, east, north = grid.extent
    x, y = rng.uniform(west - 2, east + 2, 500), rng.uniform(south - 2, north + 2, 500)
    # Corners and borders of cells, and places that are none.
    x[:100], y[100:200] = west + grid.gsd * np.arange(-10, 90), north - grid.gsd * np.arange(-10, 90)
    x[200:203], y[203:206] = [np.nan, np.inf, -np.inf], [np.nan, np.inf, -np.inf]
    index, inside = grid.cells(x, y)
    assert list(zip(index.tolist(), inside.tolist(), strict=True)) == naive_sampling.cells(grid, x, y)
    assert grid.cells(x.reshape(50, 10), y.reshape(50, 10))[0].shape == (50, 10)
    assert grid.cells(np.empty(0), np.empty(0))[0].shape == (0,)
