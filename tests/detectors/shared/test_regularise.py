import numpy as np
import pytest
import shapely
from builders.traced_shapes import iou, traced
from harness.effort import examples
from hypothesis import given
from hypothesis import strategies as st
from shapely.affinity import rotate

from roofbench.detectors.shared.regularise import regularise
from roofbench.scenes.geodata.outlines import coverage_of_mask, trace
from roofbench.scenes.geodata.raster import Grid


@pytest.mark.parametrize("angle", [0, 9, 23, 45, 80])
def test_a_t_shape_gets_its_eight_corners_back_at_any_angle(angle):
    shape = shapely.box(112, 222, 136, 230).union(shapely.box(120, 208, 128, 222))
    shape = rotate(shape, angle, origin="centroid")
    (regular,) = regularise(traced(shape), 0.5)
    assert shapely.get_num_coordinates(regular) - 1 == 8
    assert iou(regular, shape) > 0.97


def test_walls_that_follow_no_main_direction_stay_as_they_are():
    # A house with one wall at 30 degrees to the others.
    house = shapely.Polygon([(110, 210), (130, 210), (130, 216), (116, 224.1), (110, 224.1)])
    (regular,) = regularise(traced(house), 0.5)
    assert iou(regular, house) > 0.97
    assert shapely.get_num_coordinates(regular) - 1 == 5


def test_a_round_tower_is_not_squared():
    tower = shapely.Point(125, 220).buffer(9)
    (regular,) = regularise(traced(tower), 0.5)
    assert iou(regular, tower) > 0.9


@examples(25)
@given(seed=st.integers(0, 10_000))
def test_regularised_outlines_are_valid_and_agree_with_what_was_traced(seed):
    rng = np.random.default_rng(seed)
    boxes = [
        rotate(shapely.box(x, y, x + w, y + h), angle)
        for x, y, w, h, angle in rng.uniform([108, 206, 4, 4, 0], [130, 226, 14, 12, 90], (5, 5))
    ]
    polygons = traced(shapely.union_all(boxes))
    regular = regularise(polygons, 0.5)
    assert shapely.is_valid(regular).all()
    for one, two in zip(regular, polygons, strict=True):
        assert iou(one, two) > 0.8


def test_walls_of_a_long_block_do_not_depend_on_its_far_end():
    """Two wings, each along its own direction, 300 m from end to end: half of it has the same walls."""
    rng = np.random.default_rng(2)
    one, two = (shapely.affinity.rotate(shapely.box(0, 0, 170, 22), turn, origin=(0, 0)) for turn in (20.0, 24.0))
    block = shapely.union(one, shapely.affinity.translate(two, 150, 58))
    row, column = np.mgrid[0:400, 0:700]
    x, y = 0.5 * column.ravel() - 12.75, 187.25 - 0.5 * row.ravel()
    mask = shapely.contains_xy(block, x, y).reshape(row.shape) & (rng.random(row.shape) < 0.995)
    grid = Grid(-13.0, 187.5, 0.5, *mask.shape)
    part = mask.copy()
    part[:, 440:] = False

    def walls(of, reach):
        (found,) = regularise(np.array([max(trace(coverage_of_mask(of), grid), key=shapely.area)]), 0.5, reach=reach)
        return found.intersection(shapely.box(-20, -20, 60, 200))

    near = [walls(of, 50.0) for of in (mask, part)]
    assert shapely.area(near[0].symmetric_difference(near[1])) < 1e-6
    assert near[0].intersection(block).area > 0.97 * near[0].area
    far = [walls(of, np.inf) for of in (mask, part)]
    assert shapely.area(far[0].symmetric_difference(far[1])) > 1e-3
