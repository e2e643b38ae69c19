"""Edges move, parts are cut off and rectangles are joined as polygons are."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from roofbench.detectors.mpp.rectangles import corners
from roofbench.detectors.mpp.reshaping import cut, hull, join_along, move_edge

RECTANGLES = st.builds(
    lambda *numbers: np.array(numbers),
    *(st.floats(-20, 20),) * 2,
    *(st.floats(2, 15),) * 2,
    st.floats(0, math.pi, exclude_max=True),
)


def polygon(rectangle):
    return shapely.polygons(corners(rectangle))[0]


def edge_of(rectangle, edge):
    """The line of an edge: 0, 1 the ends along u, 2, 3 those along v; the even ones on the positive side."""
    place = corners(rectangle)[0]
    first = {0: 1, 1: 3, 2: 2, 3: 0}[edge]
    return shapely.linestrings([place[first], place[(first + 1) % 4]])


@given(RECTANGLES, st.integers(0, 3), st.floats(-1.5, 5))
def test_one_edge_moves_and_the_opposite_one_stays(rectangle, edge, by):
    new = np.empty(5)
    move_edge(rectangle, edge, by, new)
    assert shapely.hausdorff_distance(edge_of(new, edge ^ 1), edge_of(rectangle, edge ^ 1)) < 1e-9
    assert shapely.hausdorff_distance(edge_of(new, edge), edge_of(rectangle, edge)) == pytest.approx(abs(by), abs=1e-9)
    larger, smaller = (new, rectangle) if by >= 0 else (rectangle, new)
    assert polygon(larger).buffer(1e-9).covers(polygon(smaller))


def test_columns_beyond_the_fifth_are_copied_and_the_result_may_be_the_argument():
    building = np.array([1.0, 2.0, 3.0, 4.0, 0.5, 6.0, 7.0])
    new = np.empty(7)
    move_edge(building, 2, 1.5, new)
    assert list(new[5:]) == [6.0, 7.0]
    move_edge(building, 2, 1.5, building)
    np.testing.assert_array_equal(building, new)


@given(RECTANGLES, st.integers(0, 1), st.floats(0.1, 0.9))
def test_the_parts_of_a_cut_fill_the_whole(rectangle, axis, share):
    side = rectangle[2 + axis]
    at = side * (share - 0.5)
    first, second = np.empty(5), np.empty(5)
    cut(rectangle, axis, -0.5 * side, at, first)
    cut(rectangle, axis, at, 0.5 * side, second)
    # Overlays of polygons with almost equal edges are not reliable: parts are compared in the frame of the whole.
    whole, low, high = (turned(polygon(shape), rectangle).bounds for shape in (rectangle, first, second))
    wall = whole[axis] + side * share
    np.testing.assert_allclose(low, [*whole[: 2 + axis], wall, *whole[3 + axis :]], atol=1e-9)
    np.testing.assert_allclose(high, [*whole[:axis], wall, *whole[axis + 1 :]], atol=1e-9)


def turned(shape, rectangle):
    """A polygon in the frame of a rectangle."""
    at_origin = shapely.affinity.translate(shape, -rectangle[0], -rectangle[1])
    return shapely.affinity.rotate(at_origin, -rectangle[4], origin=(0, 0), use_radians=True)


@given(RECTANGLES, RECTANGLES)
def test_a_hull_is_the_bounding_box_of_both_in_the_frame_of_the_first(first, second):
    merged = np.empty(5)
    hull(first, second, merged)
    both = turned(shapely.multipolygons([polygon(first), polygon(second)]), first)
    np.testing.assert_allclose(turned(polygon(merged), first).bounds, both.bounds, atol=1e-9)
    assert merged[4] == first[4]


@given(RECTANGLES, RECTANGLES, st.integers(0, 1))
def test_a_joined_rectangle_reaches_over_both_and_has_the_mean_edges_across(first, second, axis):
    joined = np.empty(5)
    join_along(first, second, axis, joined)
    one, two, found = (turned(polygon(shape), first).bounds for shape in (first, second, joined))
    across = 1 - axis
    lengths = one[2 + axis] - one[axis], two[2 + axis] - two[axis]
    for side in (0, 2):
        reach = (min if side == 0 else max)(one[side + axis], two[side + axis])
        assert found[side + axis] == pytest.approx(reach, abs=1e-9)
        mean = np.average([one[side + across], two[side + across]], weights=lengths)
        assert found[side + across] == pytest.approx(mean, abs=1e-9)
