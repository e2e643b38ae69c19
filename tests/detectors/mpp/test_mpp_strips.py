"""What lies along a larger building is a part of it; houses in a row are not."""

import numpy as np
import pytest

from roofbench.detectors.mpp.energy import Model
from roofbench.detectors.mpp.strips import absorb_strips
from roofbench.detectors.mpp.tables import make_tables

MODEL = Model(
    weight=1.0,
    price=20.0,
    overlap=20.0,
    roof_price=3.0,
    least_tau=0.15,
    ground_error=0.0,
    least_height=2.5,
    cell=1.0,
    void_price=0.1,
    least_side=2.0,
    largest_side=60.0,
    fit_weight=0.2,
)
HALL = (25.0, 25.0, 30.0, 20.0, 0.0)


def tables(*roofs):
    """Flat roofs (top, left, bottom, right, height in metres) on flat ground."""
    height = np.zeros((60, 70), np.int32)
    for top, left, bottom, right, metres in roofs:
        height[top:bottom, left:right] = round(100 * metres)
    return make_tables(height, height > 0, np.where(height > 0, 3000, -5000).astype(np.int16))


def left_over(world, *rectangles, slender=3.0, part_share=0.1):
    return absorb_strips(world, MODEL, np.array(rectangles), slender=slender, part_share=part_share)


def test_a_strip_of_the_same_roof_is_absorbed():
    world = tables((15, 10, 39, 40, 9.0))
    found = left_over(world, HALL, (25.0, 37.0, 30.0, 4.0, 0.0))
    np.testing.assert_allclose(found, [[25, 27, 30, 24, 0]])


@pytest.mark.parametrize("turned", [False, True])
def test_a_strip_that_the_building_cannot_absorb_is_left_out(turned):
    world = tables((15, 10, 35, 40, 9.0), (35, 10, 38, 25, 3.0))
    strip = (17.5, 36.5, 3.0, 15.0, np.pi / 2) if turned else (17.5, 36.5, 15.0, 3.0, 0.0)
    np.testing.assert_array_equal(left_over(world, HALL, strip), [HALL])


def test_a_small_part_along_a_hall_is_left_out_and_one_that_touches_with_its_end_stays():
    world = tables((15, 10, 35, 40, 9.0), (35, 20, 40, 26, 3.0), (20, 40, 29, 45, 3.0))
    along, end = (23.0, 37.5, 6.0, 5.0, 0.0), (42.5, 18.0, 9.0, 5.0, 0.0)
    np.testing.assert_array_equal(left_over(world, HALL, along, end), [HALL, end])


def test_houses_of_a_row_stay():
    row = [(8.0 + 6.0 * k, 25.0, 6.0, 12.0, 0.0) for k in range(5)] + [(42.0, 25.0, 10.0, 12.0, 0.0)]
    world = tables(*((19, 5 + 6 * k, 31, 11 + 6 * k, 8.0 + k) for k in range(5)), (19, 37, 31, 47, 7.0))
    np.testing.assert_array_equal(left_over(world, *row), row)


def test_a_strip_of_a_strip_is_absorbed_with_it():
    world = tables((15, 10, 41, 40, 9.0))
    found = left_over(world, HALL, (25.0, 37.0, 30.0, 4.0, 0.0), (25.0, 40.0, 30.0, 2.0, 0.0))
    assert len(found) == 1
    np.testing.assert_allclose(found[0, 2:4], [30, 26])


def test_empty_scenes_and_rules_that_never_hold_have_no_strips():
    world = tables((15, 10, 39, 40, 9.0))
    assert absorb_strips(world, MODEL, np.empty((0, 5)), slender=3.0, part_share=0.1).shape == (0, 5)
    both = HALL, (25.0, 37.0, 30.0, 4.0, 0.0)
    np.testing.assert_array_equal(left_over(world, *both, slender=1000.0, part_share=0.0), both)
