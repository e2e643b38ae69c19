"""Pixel areas against one loop over pixel centres."""

import numpy as np
import pytest
import shapely

from roofbench.core.errors import ParameterError
from roofbench.evaluators.overlay.areas import AreaTally
from roofbench.evaluators.overlay.pixels import pixel_areas
from roofbench.scenes.geodata.raster import Grid

GRID = Grid(west=0.0, north=40.0, gsd=1.0, rows=40, columns=40)


def tally(detected, reference, pairs, *, alarms=(), missed=(), grid=GRID):
    polygons = [np.array([*side, None], dtype=object)[:-1] for side in (detected, reference)]
    rows = [np.array([pair[side] for pair in pairs], dtype=np.int64) for side in (0, 1)]
    return pixel_areas(
        *polygons,
        (rows[0], rows[1]),
        grid,
        false_positives=np.array(alarms, dtype=np.int64),
        false_negatives=np.array(missed, dtype=np.int64),
    )


def by_loops(detected, reference, pairs, alarms, missed, grid):
    counts = np.zeros(6)
    for row in range(grid.rows):
        for column in range(grid.columns):
            point = shapely.Point(grid.west + (column + 0.5) * grid.gsd, grid.north - (row + 0.5) * grid.gsd)
            of_d = [polygon.contains(point) for polygon in detected]
            of_r = [polygon.contains(point) for polygon in reference]
            found = any(of_d[d] and of_r[r] for d, r in pairs)
            excess = any(of_d[d] and not of_r[r] for d, r in pairs) or any(of_d[d] for d in alarms)
            lacking = any(of_r[r] and not of_d[d] for d, r in pairs) or any(of_r[r] for r in missed)
            counts[:3] += found, excess and not found, lacking and not found
            for d, r in pairs:
                counts[3:] += of_d[d], of_r[r], of_d[d] and of_r[r]
    return counts * grid.gsd**2


def test_whole_pixels_by_hand():
    found = tally([shapely.box(1, 30, 11, 40)], [shapely.box(0, 30, 10, 40)], [(0, 0)])
    assert found == AreaTally(
        true_positive=90.0, false_positive=10.0, false_negative=10.0, pair_detected=100.0, pair_reference=100.0,
        pair_shared=90.0,
    )  # fmt: skip


def test_a_pixel_belongs_to_a_footprint_when_its_centre_does():
    narrow = shapely.box(0.6, 30, 1.4, 40)  # between two columns of centres
    assert tally([narrow], [], [], alarms=[0]).false_positive == 0.0
    assert tally([shapely.box(0.4, 30, 1.4, 40)], [], [], alarms=[0]).false_positive == 10.0


def test_nothing_has_no_pixels_and_the_lattice_goes_on_beyond_the_image():
    assert tally([], [], []) == AreaTally()
    assert tally([shapely.box(-500, 900, -490, 910)], [], [], alarms=[0]).false_positive == 100.0


@pytest.mark.parametrize("seed", range(15))
def test_pixels_are_counted_as_by_a_loop_over_their_centres(seed):
    rng = np.random.default_rng(seed)

    def some(count):
        for _ in range(count):
            x, y, radius = rng.uniform(8, 32), rng.uniform(8, 32), rng.uniform(2, 7)
            house = shapely.Point(x, y).buffer(radius, quad_segs=int(rng.integers(1, 4)))
            yield house - shapely.Point(x, y).buffer(radius / 3) if rng.random() < 0.4 else house

    detected, reference = list(some(4)), list(some(4))
    found = tally(detected, reference, [(0, 1), (1, 0)], alarms=[2], missed=[3])
    expected = by_loops(detected, reference, [(0, 1), (1, 0)], [2], [3], GRID)
    assert list(found.to_dict().values()) == pytest.approx(expected)


def test_pixels_that_would_take_an_hour_are_refused():
    with pytest.raises(ParameterError, match=r"pixels of 1e-07 m are too small .* area=exact"):
        tally([shapely.box(0, 0, 4000, 4000)], [], [], alarms=[0], grid=Grid(0, 0, 1e-7, 1, 1))
