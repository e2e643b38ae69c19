"""Cells are those of the slow oracle, for any number of threads."""

import numpy as np
import pytest
from naive import mpp as naive_mpp

from roofbench.detectors.mpp.cells import make_cells
from roofbench.detectors.mpp.threads import started_threads
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid


@pytest.mark.parametrize("count", [1, 2, 3, 7])
@pytest.mark.parametrize("per_cell", [0.6, 3.0])
def test_cells_are_those_of_the_oracle(per_cell, count):
    """Rows of some hundred cells: the compiler works on many of a row at once, and once got that wrong."""
    rng = np.random.default_rng(0)
    shape, cell, low = (23, 301), 0.5, 200
    n = int(per_cell * shape[0] * shape[1])
    x, y = rng.uniform(-1, shape[1] * cell + 1, n), rng.uniform(-shape[0] * cell - 1, 1, n)
    h = np.where(np.sin(x / 3) + np.sin(y / 2) > 0, rng.choice([3.0, 6.0, 6.5, 12.0], n), 0) + rng.normal(0, 0.3, n)
    h[::211], h[5::307] = 300.0, np.nan
    returns = rng.integers(1, 4, n).astype(np.uint8)
    ground = Elevation(np.full((4, 40), 7.0, np.float32), Grid(-2.0, 2.0, 4.0, 4, 40))
    points = PointCloud(x, y, h + 7.0, number_of_returns=returns)
    with started_threads(count) as threads:
        found = make_cells(points, ground, Grid(0.0, 0.0, cell, *shape), low=0.01 * low, threads=threads)
    seen = np.isfinite(h)
    above = points.z[seen] - 7.0
    expected = naive_mpp.cells(x[seen], y[seen], above, returns[seen], shape, cell, low)
    assert [np.count_nonzero(found.state == kind) > 100 for kind in range(3)] == [per_cell < 1, True, True]
    for values, wanted in zip((found.height, found.state, found.openness), expected, strict=True):
        np.testing.assert_array_equal(values, wanted)
