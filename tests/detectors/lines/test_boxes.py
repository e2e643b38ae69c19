"""Boxes: geometry, and sums inside them against counting every cell."""

import numpy as np
import pytest
from harness.effort import examples
from hypothesis import given
from hypothesis import strategies as st
from naive import lines as naive_lines

from roofbench.detectors.lines.boxes import (
    box_centres,
    box_corners,
    from_box,
    lengths,
    prefix_sums,
    sum_in_box,
    sums_in_box,
    to_box,
    widths,
)

angles = st.floats(0, 2 * np.pi)
places = st.floats(-20, 60)
sizes = st.floats(0.1, 40)


def make_box(x, y, angle, length, width):
    return np.array([x, y, np.cos(angle), np.sin(angle), -length / 3, length * 2 / 3, -width / 4, width * 3 / 4])


@examples(200)
@given(places, places, angles, sizes, sizes)
def test_the_sum_in_a_box_is_the_sum_over_its_cells(x, y, angle, length, width):
    raster = np.random.default_rng(0).integers(0, 256, (40, 47), dtype=np.uint8)
    box = make_box(x, y, angle, length, width)
    inside = naive_lines.cells_in_box(box, *raster.shape)
    total, on_raster, in_all = sum_in_box(prefix_sums(raster), box)
    assert total == raster[inside].astype(int).sum()
    assert on_raster == inside.sum()
    other = 255 - raster[::-1]
    of_other = other[inside].astype(int).sum()
    assert sums_in_box(prefix_sums(raster), prefix_sums(other), box) == (total, of_other, on_raster, in_all)


def test_cells_beyond_the_raster_are_counted_apart():
    box = np.array([-5.0, 3.0, 1.0, 0.0, 0.0, 10.0, 0.0, 2.0])
    assert sum_in_box(prefix_sums(np.ones((10, 10), np.uint8)), box) == (10, 10, 20)


@pytest.mark.parametrize("degrees", [0, 90, 180, 270])
def test_axis_parallel_boxes_hold_whole_cells(degrees):
    angle = np.radians(degrees)
    box = np.array([20.0, 20.0, np.round(np.cos(angle)), np.round(np.sin(angle)), -6.0, 6.0, -2.0, 2.0])
    assert sum_in_box(prefix_sums(np.ones((40, 40), np.uint8)), box) == (48, 48, 48)


def test_corners_centre_length_and_width_follow_from_the_intervals():
    box = np.array([[10.0, 20.0, 0.0, 1.0, -2.0, 4.0, 1.0, 3.0]])
    assert box_corners(box)[0].tolist() == [[9, 18], [9, 24], [7, 24], [7, 18]]
    assert box_centres(box).tolist() == [[8, 21]]
    assert (lengths(box)[0], widths(box)[0]) == (6, 2)


def test_places_along_and_across_a_box_and_back_are_the_same():
    box = np.array([12.0, 7.0, np.cos(0.4), np.sin(0.4), -3.0, 9.0, -2.0, 5.0])
    assert from_box(0.0, 0.0, box) == (12.0, 7.0)
    for u, v in ((9.0, -2.0), (-3.0, 5.0), (0.5, 0.25)):
        assert to_box(*from_box(u, v, box), box) == pytest.approx((u, v))
    corners = box_corners(box[None])[0]
    assert [from_box(u, v, box) for u, v in ((-3, -2), (9, -2), (9, 5), (-3, 5))] == [pytest.approx(c) for c in corners]
