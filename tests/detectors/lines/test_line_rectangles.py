"""Adjustment, extension, rectangles and dominant colours."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from naive import lines as naive_lines

from roofbench.detectors.lines.adjustment import adjust_to_neighbours, adjust_to_shape, adjust_within_shape, rotate
from roofbench.detectors.lines.boxes import U0, U1, UX, UY, V0, V1, prefix_sums
from roofbench.detectors.lines.colours import Colours, dominant_bins, dominant_ranges, yiq_bins
from roofbench.detectors.lines.duplicates import DuplicateRules, adds_width, find_duplicates, new_share
from roofbench.detectors.lines.extension import Cover, Growth, extend_lines, extend_rectangle
from roofbench.detectors.lines.final_rectangles import (
    FinalRules,
    black_shares,
    extended_final_side,
    has_colours,
    lies_inside,
    shrink,
)
from roofbench.detectors.lines.initial_rectangles import (
    INSIDE,
    TOO_NARROW,
    InitialRules,
    initial_rectangles,
    share_inside,
)
from roofbench.detectors.lines.original import Original
from roofbench.detectors.lines.segments import Segments

NONE = np.zeros((0, 1), dtype=np.int32)
NOT_GREEN = np.zeros(1, dtype=np.bool_)
RULES = Growth(step=20.0, least_step=2.7, black_share=0.7, part=20.0, vegetation=48.0, entropy=0.0)


def line(x, y, degrees, length):
    angle = np.radians(degrees)
    return np.array([x, y, np.cos(angle), np.sin(angle), -length / 2, length / 2, 0.0, 0.0])


def cover(black, vegetation=None, entropy=None):
    vegetation = np.zeros_like(black) if vegetation is None else vegetation
    return Cover(prefix_sums(black), prefix_sums(vegetation), NONE if entropy is None else prefix_sums(entropy))


def test_each_line_keeps_its_smallest_rotation_towards_a_neighbour():
    rng = np.random.default_rng(3)
    degrees, x, y = rng.uniform(0, 360, 40), rng.uniform(0, 1000, 40), rng.uniform(0, 1000, 40)
    lines = np.array([line(*values, rng.uniform(20, 100)) for values in zip(x, y, degrees, strict=True)])
    found = adjust_to_neighbours(lines, radius=250.0, tolerance=np.pi / 8, longer_only=False)
    expected = naive_lines.rotation_candidates(np.radians(degrees), np.stack([x, y], 1), 250.0, np.pi / 8)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_longer_lines_are_turned_by_nothing_shorter():
    lines = np.array([line(0, 0, 0, 100), line(30, 0, 93, 40), line(60, 0, 5, 30), line(900, 0, 0, 50)])
    rotation = np.degrees(adjust_to_neighbours(lines, radius=100.0, tolerance=np.pi / 8, longer_only=True))
    np.testing.assert_allclose(rotation, [0, -3, -2, np.nan], atol=1e-9)


def test_the_longest_share_of_the_lines_are_references():
    lines = np.array([line(0, 0, 0, 100), line(30, 0, 93, 40), line(60, 0, 5, 30), line(90, 0, 6, 20)])
    all_of_them = adjust_to_neighbours(lines, radius=200.0, tolerance=np.pi / 8, longer_only=True)
    half = adjust_to_neighbours(lines, radius=200.0, tolerance=np.pi / 8, longer_only=True, share=0.5)
    np.testing.assert_allclose(np.degrees(all_of_them), [0, -3, -2, -1], atol=1e-9)
    np.testing.assert_allclose(np.degrees(half), [0, -3, -2, -3], atol=1e-9)


def test_lines_of_a_shape_are_turned_to_its_longest_and_odd_ones_drop_out():
    lines = np.array([line(0, 0, 10, 30), line(0, 9, 190, 90), line(5, 0, 104, 40), line(5, 5, 45, 50)])
    one_shape = np.array([7, 7, 7, 7])
    rotation = np.degrees(adjust_to_shape(lines, one_shape, tolerance=np.pi / 8, longest_only=True))
    np.testing.assert_allclose(rotation, [0, 0, -4, np.nan], atol=1e-9)
    rotation = np.degrees(adjust_to_shape(lines, np.array([1, 2, 2, 3]), tolerance=np.pi / 8, longest_only=True))
    np.testing.assert_allclose(rotation, [0, 0, -4, 0], atol=1e-9)


def test_lines_beyond_the_reach_of_the_longest_are_turned_to_the_next_longest():
    lines = np.array([line(0, 0, 10, 90), line(0, 9, 45, 80), line(5, 0, 130, 40), line(5, 5, 97, 30)])
    rotation = np.degrees(adjust_to_shape(lines, np.zeros(4, np.int64), tolerance=np.pi / 8, longest_only=False))
    np.testing.assert_allclose(rotation, [0, 0, 5, 3], atol=1e-9)
    rotation = np.degrees(
        adjust_to_shape(lines[[0, 1, 3]], np.zeros(3, np.int64), tolerance=np.pi / 8, longest_only=False)
    )
    np.testing.assert_allclose(rotation, [0, np.nan, 3], atol=1e-9)


def test_a_line_follows_its_own_house_unless_that_moves_its_ends_too_far():
    house, short, long = line(0, 0, 0, 100), line(30, 0, 97, 12), line(40, 0, 7, 60)
    neighbour, far = line(60, 0, 10, 90), line(400, 0, 1, 90)
    lines, shapes = np.array([house, short, long, neighbour, far]), np.array([1, 1, 1, 2, 1])
    found = adjust_within_shape(lines, shapes, radius=100.0, tolerance=np.pi / 8, reach=2.0)
    np.testing.assert_allclose(np.degrees(found), [np.nan, -7, np.nan, np.nan, np.nan], atol=1e-9)
    found = adjust_within_shape(lines, shapes, radius=1e3, tolerance=np.pi / 8, reach=4.0)
    np.testing.assert_allclose(np.degrees(found), [np.nan, -7, -7, np.nan, -1], atol=1e-9)
    # Of the longest fifth, the neighbour included, only the house itself is left.
    found = adjust_within_shape(lines, shapes, radius=1e3, tolerance=np.pi / 8, reach=0.75, share=0.2)
    np.testing.assert_allclose(np.degrees(found), [np.nan, -7, np.nan, np.nan, np.nan], atol=1e-9)
    found = adjust_within_shape(lines[1:], shapes[1:], radius=1e3, tolerance=np.pi / 8, reach=4.0, share=0.25)
    np.testing.assert_allclose(np.degrees(found), [np.nan] * 4)


@pytest.mark.parametrize(("direction", "own", "longer"), [(96, -6, -1), (98, -3, -3)])
def test_original_turns_a_line_to_its_house_within_the_certainty_of_its_ends_and_else_to_its_neighbours(
    direction, own, longer
):
    # The house is at 0 degrees, its neighbours at 5; ends of a line of 12 m move by 0.63 and 0.84 m.
    lines = np.array([line(0, 0, 0, 100), line(60, 0, 5, 90), line(30, 0, direction, 12), line(30, 9, 1, 11)])
    segments = Segments(lines, np.array([1, 2, 1, 1]))
    rasters = SimpleNamespace(gsd=1.0, spacing=1.0)
    found = Original()._rotation(segments, rasters)
    np.testing.assert_allclose(np.degrees(found), [0, 0, own, -1], atol=1e-9)
    found = Original(adjustment_reference="longer")._rotation(segments, rasters)
    np.testing.assert_allclose(np.degrees(found)[2], longer, atol=1e-9)


def test_rotating_turns_a_line_about_its_centre():
    turned = rotate(line(5, 6, 30, 10)[None], np.radians([15.0]))[0]
    np.testing.assert_allclose(turned, line(5, 6, 45, 10), atol=1e-12)


def test_a_line_is_extended_to_within_a_least_step_of_the_end_of_the_black():
    black = np.zeros((100, 200), np.uint8)
    black[20:80, 30:170] = 1
    found = extend_lines(cover(black), RULES, line(100, 20, 0, 40)[None], 20.0, NOT_GREEN)[0]
    assert 100 + found[U0] == pytest.approx(30, abs=2.7)
    assert 100 + found[U1] == pytest.approx(170, abs=2.7)


def test_a_side_stops_at_a_court_that_takes_less_than_a_third_of_it():
    black = np.zeros((120, 140), np.uint8)
    black[20:100, 20:120] = 1
    black[60:100, 60:84] = 0
    box = line(70, 20, 0, 100)
    box[V1] = 10.0
    in_parts, as_a_whole = box.copy(), box.copy()
    in_parts = extend_rectangle(cover(black), RULES, in_parts, False)
    as_a_whole = extend_rectangle(cover(black), RULES._replace(part=1e6), as_a_whole, False)
    assert 20 + in_parts[V1] == pytest.approx(60, abs=2.7)
    assert 20 + as_a_whole[V1] == pytest.approx(100, abs=2.7)


def test_extension_stops_at_vegetation_unless_its_texture_is_smooth():
    black = np.zeros((100, 200), np.uint8)
    black[20:80, 30:170] = 1
    leaves, rough = np.zeros_like(black), np.zeros_like(black)
    leaves[:, 130:] = 100
    rough[:, 130:] = 200
    start = line(100, 20, 0, 40)[None]
    assert extend_lines(cover(black, leaves), RULES, start, 20.0, NOT_GREEN)[0, U1] < 45
    textured = RULES._replace(entropy=128.0)
    assert extend_lines(cover(black, leaves, rough), textured, start, 20.0, NOT_GREEN)[0, U1] < 45
    assert extend_lines(cover(black, leaves, 0 * rough), textured, start, 20.0, NOT_GREEN)[0, U1] > 60


def test_a_strip_beyond_the_image_is_white():
    found = extend_lines(cover(np.ones((50, 50), np.uint8)), RULES, line(25, 0, 0, 20)[None], 20.0, NOT_GREEN)[0]
    assert found[U1] <= 25 + 0.3 * 20


def test_a_rectangle_grows_over_the_whole_black_shape():
    black = np.zeros((100, 200), np.uint8)
    black[20:80, 30:170] = 1
    box = line(100, 20, 0, 40)
    box[V1] = 10
    box = extend_rectangle(cover(black), RULES, box, False)
    assert (box[V0], box[V1]) == (0, pytest.approx(60, abs=2.7))
    assert box[U1] - box[U0] == pytest.approx(140, abs=5.4)


def test_the_longest_line_makes_the_rectangle_and_the_others_are_inside_it():
    black = np.zeros((100, 200), np.uint8)
    black[20:80, 30:170] = 1
    lines = np.array([line(100, 20, 0, 130), line(100, 80, 180, 120), line(170, 50, 90, 50), line(100, 10, 180, 30)])
    order = np.arange(4)
    found, made = initial_rectangles(
        cover(black), RULES, InitialRules(10.0, 20.0, 3.0, 0.75), lines, np.zeros(len(lines), bool), order
    )
    assert len(found) == 1
    assert made.tolist() == [0, INSIDE, INSIDE, TOO_NARROW]


def test_a_line_is_inside_by_half_its_length_and_its_midpoint():
    box = np.array([0.0, 0.0, 1.0, 0.0, -10.0, 10.0, -5.0, 5.0])
    assert share_inside(line(0, 0, 0, 20), box, 0.0) == 1
    assert share_inside(line(8, 0, 0, 20), box, 0.0) == pytest.approx(0.6)
    assert share_inside(line(11, 0, 0, 20), box, 0.0) == 0
    assert share_inside(line(0, 6, 0, 20), box, 0.0) == 0
    assert share_inside(line(0, 6, 0, 20), box, 1.5) == 1


def test_shrinking_takes_a_share_of_length_and_width_about_the_centre():
    box = np.array([3.0, 4.0, 0.6, 0.8, 0.0, 100.0, 10.0, 50.0])
    np.testing.assert_allclose(shrink(box, 0.15), [3, 4, 0.6, 0.8, 7.5, 92.5, 13, 47])


def test_a_box_lies_inside_another_when_all_its_corners_do():
    outer = np.array([0.0, 0.0, 1.0, 0.0, -10.0, 10.0, -10.0, 10.0])
    turned = line(0, 0, 45, 19)
    assert lies_inside(turned, outer)
    turned[V1] = 5
    assert not lies_inside(turned + np.array([3, 3, 0, 0, 0, 0, 0, 0]), outer)


def rectangles(rng, count):
    """Return random rectangles on a place so small that most overlap."""
    boxes = np.array([line(*rng.uniform(0, 120, 2), rng.uniform(0, 180), rng.uniform(20, 90)) for _ in range(count)])
    boxes[:, V1] = rng.uniform(20, 60, count)
    return boxes


def test_the_new_share_of_a_rectangle_is_what_lies_outside_the_union_of_the_others():
    rng = np.random.default_rng(5)
    for _ in range(20):
        boxes = rectangles(rng, 6)
        assert new_share(boxes[0], boxes[1:]) == pytest.approx(naive_lines.new_share(boxes[0], boxes[1:]), abs=0.02)
    assert new_share(boxes[0], boxes[:0]) == 1
    assert new_share(boxes[0], boxes[:1]) == 0


def test_duplicates_are_those_that_larger_turned_rectangles_cover():
    rng = np.random.default_rng(8)
    boxes = rectangles(rng, 60)
    boxes[::3, UX:U0] = 1.0, 0.0
    found = find_duplicates(boxes, DuplicateRules(0.31, np.radians(3)))
    np.testing.assert_array_equal(found, naive_lines.duplicates(boxes, 0.31, 3.0))
    assert 5 < found.sum() < 55
    assert not find_duplicates(boxes, DuplicateRules(0.0, np.radians(3))).any()


def test_a_wing_stays_however_much_of_it_lies_in_the_house_and_a_turned_rectangle_does_not():
    house, wing, turned = line(50, 30, 0, 60), line(60, 30, 90, 40), line(50, 32, 14, 52)
    house[V1], wing[V1], turned[V1] = 40, 15, 30
    found = find_duplicates(np.array([wing, turned, house]), DuplicateRules(0.1, np.radians(3)))
    assert found.tolist() == [False, True, False]
    assert not find_duplicates(np.array([turned]), DuplicateRules(0.1, np.radians(3))).any()


def test_of_two_rectangles_of_one_area_the_smaller_is_a_duplicate_at_any_angle():
    house, again, turned, wing = line(50, 30, 0, 60), line(52, 30, 0, 56), line(50, 33, 8, 58), line(35, 20, 90, 50)
    house[V1], again[V1], turned[V1], wing[V1] = 40, 40, 36, 18
    boxes = np.array([house, again, turned, wing])
    assert find_duplicates(boxes, DuplicateRules(0.0, np.radians(3), 0.5)).tolist() == [False, True, True, False]
    assert not find_duplicates(boxes, DuplicateRules(0.0, np.radians(3))).any()


def test_the_new_width_of_a_rectangle_is_that_of_the_widest_square_outside_the_others():
    rng = np.random.default_rng(6)
    for _ in range(12):
        boxes = rectangles(rng, 4)
        widest = naive_lines.widest_new_square(boxes[0], boxes[1:], np.arange(2.0, 60.0, 2.0))
        narrow = min(boxes[0, U1] - boxes[0, U0], boxes[0, V1] - boxes[0, V0])
        assert not adds_width(boxes[0], boxes[1:], 1.2 * widest + 4) or 1.2 * widest + 4 > narrow
        assert widest == 0 or adds_width(boxes[0], boxes[1:], 0.85 * widest)
    assert not adds_width(boxes[0], boxes[:1], 1.0)


@pytest.mark.parametrize(("angle", "beyond", "expected"), [(90, 2.5, False), (90, 1.5, True), (97, 1.5, True)])
def test_a_rectangle_that_adds_a_narrow_strip_is_a_duplicate_at_any_angle(angle, beyond, expected):
    house, part = line(0, 0, 0, 18), line(4, beyond / 2, angle, 12 + beyond)
    house[V0], house[V1], part[V1] = -6, 6, 8
    boxes = np.array([house, part])
    assert find_duplicates(boxes, DuplicateRules(0.01, np.radians(3), 1.0, 2.0)).tolist() == [False, expected]
    assert not find_duplicates(boxes, DuplicateRules(0.01, np.radians(3))).any()


@pytest.mark.parametrize(
    ("histogram", "expected"),
    [
        # One hill of 100: 3 + 20 + 50 + 25 = 98 reach 97 % of it; the foot of 2 stays out.
        ([0, 2, 20, 50, 25, 3, 0, 0, 0, 0], [2, 3, 4, 5]),
        # Two hills, cut after the minimum of 4: 65 and 35 of 100; both are needed for 90 %.
        ([0, 1, 60, 4, 30, 5, 0, 0, 0, 0], [2, 3, 4, 5]),
        # The first hill holds 95 %, so the second colour is not used.
        ([0, 10, 80, 5, 0, 0, 5, 0, 0, 0], [1, 2, 3]),
        ([0] * 10, []),
        ([7, 0, 0, 0, 0, 0, 0, 0, 0, 0], [0]),
    ],
)
def test_dominant_bins_of_histograms_worked_by_hand(histogram, expected):
    found = dominant_bins(np.array(histogram), 0.97, 0.90)
    assert np.flatnonzero(found).tolist() == expected


def test_colours_fall_into_the_bins_of_their_yiq():
    def bins(*rgb):
        return yiq_bins(Colours.of(np.array(rgb, np.uint8).reshape(3, 1, 1)), 0, 0)

    assert bins(0, 0, 0) == (0, 10, 10)
    assert bins(255, 255, 255) == (9, 10, 10)
    assert bins(255, 0, 0) == (2, 19, 14)
    assert bins(0, 255, 0) == (5, 5, 0)
    assert bins(0, 0, 255) == (1, 4, 15)


def two_coloured():
    values = np.empty((3, 60, 100), np.uint8)
    values[:] = np.array([180, 60, 50])[:, None, None]
    values[:, :, 60:] = np.array([60, 60, 180])[:, None, None]
    return Colours.of(values)


def test_a_side_is_extended_as_far_as_the_colour_of_the_roof_reaches():
    colours, black = two_coloured(), np.ones((60, 100), np.uint8)
    box = np.array([30.0, 30.0, 1.0, 0.0, -10.0, 10.0, -10.0, 10.0])
    within = dominant_ranges(colours, box, 0.97, 0.9)
    rules = FinalRules(0.15, 0.97, 0.9, 2.3, 1.0, 0.4, 0.9, 0.1, 0.0, False)
    box[U1] = extended_final_side(colours, black, black, within, rules, box, U1, 0.0)
    assert 30 + box[U1] == pytest.approx(60, abs=1.5)


@pytest.mark.parametrize(("margin", "reached"), [(math.inf, 60), (0.0, 80), (5.0, 75), (25.0, 60)])
def test_colours_are_not_tested_well_inside_the_initial_rectangle(margin, reached):
    colours, black = two_coloured(), np.ones((60, 100), np.uint8)
    box = np.array([30.0, 30.0, 1.0, 0.0, -10.0, 10.0, -10.0, 10.0])
    within = dominant_ranges(colours, box, 0.97, 0.9)
    rules = FinalRules(0.15, 0.97, 0.9, 2.0, 1.0, 0.4, 0.9, 0.1, 0.0, False, colour_margin=margin)
    side = extended_final_side(colours, black, black, within, rules, box, U1, 50.0)  # the initial side is at 80
    assert 30 + side == pytest.approx(reached, abs=1.5)
    assert 30 + side <= max(60, 80 - margin) + 1.5
    # The points must prove it in any case.
    half = black.copy()
    half[:, 55:] = 0
    assert 30 + extended_final_side(colours, black, half, within, rules, box, U1, 50.0) <= 57


def test_a_side_ends_where_the_primary_mask_is_black_again_after_a_gap():
    colours = Colours.of(np.full((3, 60, 100), 99, np.uint8))
    secondary = np.ones((60, 100), np.uint8)
    primary = secondary.copy()
    primary[:, 50:54] = 0
    box = np.array([30.0, 30.0, 1.0, 0.0, -10.0, 10.0, -10.0, 10.0])
    within = dominant_ranges(colours, box, 0.97, 0.9)
    rules = FinalRules(0.15, 0.97, 0.9, 2.0, 1.0, 0.4, 0.9, 0.1, 0.1, False)
    box[U1] = extended_final_side(colours, primary, secondary, within, rules, box, U1, 0.0)
    assert 50 <= 30 + box[U1] <= 54


def test_shares_of_an_axis_parallel_strip_are_those_of_its_pixels():
    colours, black = two_coloured(), np.zeros((60, 100), np.uint8)
    black[:30] = 1
    strip = np.array([50.0, 20.0, 0.0, 1.0, 0.0, 20.0, -20.0, 10.0])
    within = dominant_ranges(colours, np.array([30.0, 30.0, 1.0, 0.0, -9.0, 9.0, -9.0, 9.0]), 0.97, 0.9)
    assert black_shares(black, 1 - black, strip) == pytest.approx((0.5, 0.5))
    assert has_colours(colours, within, strip, 0.66)
    assert not has_colours(colours, within, strip, 0.67)


def test_a_strip_thinner_than_a_pixel_is_sampled_once_across():
    colours, black = two_coloured(), np.ones((60, 100), np.uint8)
    strip = np.array([30.0, 20.5, 1.0, 0.0, 0.0, 10.0, 0.0, 0.3])
    within = np.ones((3, 20), dtype=bool)
    assert black_shares(black, black, strip) == (1, 1)
    assert has_colours(colours, within, strip, 0.99)
    assert not has_colours(colours, within, strip, 1.0)


@pytest.mark.parametrize("seed", range(4))
def test_the_colours_of_a_strip_are_those_of_its_lattice(seed):
    rng = np.random.default_rng(seed)
    colours = Colours.of(rng.integers(0, 255, (3, 30, 40), dtype=np.uint8))
    within = rng.random((3, 20)) < 0.7
    angle = rng.uniform(0, 7)
    # Partly beyond the image, so that not all of it has a colour.
    strip = np.array([30.0, 15.0, np.cos(angle), np.sin(angle), -12.0, 12.0, -2.0, 1.5])
    lattice = [(u, v) for u in np.arange(-11.5, 12) for v in -2 + 3.5 / 4 * np.arange(0.5, 4)]
    counts = np.zeros(3)
    for u, v in lattice:
        column = math.floor(strip[0] + u * strip[2] - v * strip[3])
        row = math.floor(strip[1] + u * strip[3] + v * strip[2])
        if 0 <= row < 30 and 0 <= column < 40:
            counts += [within[band, k] for band, k in enumerate(yiq_bins(colours, row, column))]
    share = counts.min() / len(lattice)
    found = [has_colours(colours, within, strip, asked) for asked in (0.0, np.nextafter(share, 0), share, 1.0)]
    assert found == [True, True, False, False]


def test_directions_are_unit_vectors_after_all_steps():
    lines = np.array([line(0, 0, 10, 30), line(0, 9, 190, 90)])
    turned = rotate(lines, adjust_to_shape(lines, np.zeros(2, np.int64), tolerance=1.0, longest_only=True))
    np.testing.assert_allclose(np.hypot(turned[:, UX], turned[:, UY]), 1)
