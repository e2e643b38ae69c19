import numpy as np
import pytest
import shapely
from builders.traced_shapes import GRID, centres, iou, traced
from harness.effort import examples
from hypothesis import given
from hypothesis import strategies as st
from shapely.affinity import rotate

from roofbench.scenes.geodata.outlines import coverage_of_mask, minimum_rectangles, simplify, trace
from roofbench.scenes.geodata.raster import Grid


@examples(30)
@given(seed=st.integers(0, 10_000))
def test_an_outline_encloses_exactly_the_centres_of_the_mask(seed):
    mask = np.random.default_rng(seed).random(GRID.shape) < 0.6
    polygons = trace(coverage_of_mask(mask), GRID)
    x, y = centres()
    inside = np.zeros(GRID.shape, dtype=bool)
    for polygon in polygons:
        inside |= shapely.contains_xy(polygon, x, y)
    np.testing.assert_array_equal(inside, mask)
    assert shapely.is_valid(polygons).all()


def test_shares_place_the_outline_within_a_fraction_of_a_cell():
    house = shapely.box(110.13, 210.2, 124.38, 219.57)
    (polygon,) = traced(house)
    assert polygon.area == pytest.approx(house.area, rel=0.02)
    assert iou(polygon, house) > 0.97


def test_holes_stay_and_objects_end_at_the_border_of_the_grid():
    ring = shapely.box(110, 210, 130, 230).difference(shapely.box(115, 215, 125, 225))
    (polygon,) = traced(ring)
    assert len(polygon.interiors) == 1
    (whole,) = trace(np.ones(GRID.shape, dtype=np.float32), GRID)
    assert shapely.box(*whole.bounds).within(shapely.box(*GRID.extent).buffer(1e-6))
    assert len(trace(np.zeros(GRID.shape, dtype=np.float32), GRID)) == 0


def test_simplifying_moves_no_vertex_further_than_the_tolerance():
    polygons = traced(rotate(shapely.box(110, 210, 130, 222), 20))
    simple = simplify(polygons, 0.4)
    assert shapely.get_num_coordinates(simple)[0] < shapely.get_num_coordinates(polygons)[0]
    assert shapely.hausdorff_distance(simple[0], polygons[0]) <= 0.4 + 1e-9


def test_minimum_rectangles_hold_their_polygons():
    polygons = traced(rotate(shapely.box(110, 210, 130, 222), 20))
    (rectangle,) = minimum_rectangles(polygons)
    assert rectangle.buffer(1e-6).contains(polygons[0])
    assert shapely.get_num_coordinates(rectangle) == 5


@pytest.mark.parametrize("gsd", [0.35, 0.1, 0.5])
def test_an_outline_is_the_same_to_the_last_bit_in_every_window(gsd):
    rng = np.random.default_rng(3)
    share = rng.random((40, 50)).astype(np.float32)
    mask = np.zeros(share.shape, dtype=bool)
    mask[12:30, 14:38] = rng.random((18, 24)) < 0.8
    coverage, place = coverage_of_mask(mask, share), Grid.covering((84000, 447000, 84000 + 50 * gsd, 447000), gsd)
    grid = Grid(place.west, place.north, gsd, *mask.shape)
    whole, part = trace(coverage, grid), trace(coverage[7:, 9:], grid.cut(slice(7, 40), slice(9, 50)))
    assert len(whole) == len(part) > 0
    assert shapely.equals_exact(whole, part, 0.0).all()
