"""Contours, corners and segments: from a black shape to the lines around it."""

import itertools

import numpy as np
import pytest
from builders.line_scenes import rectangle
from naive import lines as naive_lines
from shapely import contains_xy

from roofbench.detectors.lines.boxes import OX, OY, UX, UY, lengths
from roofbench.detectors.lines.contours import sample_curves, smooth, trace_shapes
from roofbench.detectors.lines.corners import accumulated_distance, find_corners
from roofbench.detectors.lines.segments import fit_line, fit_segments, inside_first

GSD = 0.15


def raster_of(polygon, side=300):
    x, y = np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5)
    return contains_xy(polygon, x, y).astype(np.uint8)


def lines_around(black):
    curves = trace_shapes(black, shortest=3.0, gsd=GSD)
    points, corners, offsets = find_corners(curves, sigma=3.0, product=0.2, straight=(157.0, 203.0))
    segments = fit_segments(curves, points, corners, offsets, shortest=3.0 / GSD)
    return inside_first(segments.lines, black, reach=3.0, outset=0.5), segments, corners


def pack(polyline, *, closed, spacing):
    offsets = np.array([0, len(polyline)])
    return sample_curves(polyline, offsets, np.zeros(1, np.int64), closed=closed, spacing=spacing)


def wobbly_curve(n=90):
    t = np.linspace(0, 2 * np.pi, n, endpoint=False)
    radius = 20 + 3 * np.sin(3 * t) + np.random.default_rng(1).normal(0, 0.2, n)
    return np.stack([radius * np.cos(t), radius * np.sin(t)], axis=-1)


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("chord", [10, 20, 30])
def test_accumulated_chord_distances_follow_the_definition(chord, closed):
    curve = wobbly_curve()
    expected = naive_lines.accumulated_distance(curve, chord, closed)
    np.testing.assert_allclose(accumulated_distance(curve, chord, closed), expected, atol=1e-9)


def test_smoothing_a_closed_curve_is_a_circular_gaussian():
    curve = wobbly_curve()
    curves = pack(curve, closed=True, spacing=1.0)
    np.testing.assert_allclose(smooth(curves, 3.0), naive_lines.gaussian_smooth_closed(curves.points, 3.0), atol=1e-9)


def test_smoothing_an_open_straight_curve_changes_nothing():
    line = np.stack([np.arange(40.0), 2 * np.arange(40.0)], axis=-1)
    curves = pack(line, closed=False, spacing=1.0)
    np.testing.assert_allclose(smooth(curves, 3.0), curves.points, atol=1e-9)


def test_curves_are_sampled_evenly_from_their_first_point():
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    curves = pack(square, closed=True, spacing=2.0)
    assert len(curves.points) == 20
    np.testing.assert_allclose(np.hypot(*np.diff(curves.points, axis=0).T), 2.0)
    assert curves.points[0].tolist() == [0, 0]


@pytest.mark.parametrize("degrees", [0, 7, 23, 45, 61, 88])
def test_a_rectangle_has_four_corners_and_four_lines_that_lie_on_its_sides(degrees):
    shape = rectangle(150, 150, 120, 70, degrees)
    lines, _, corners = lines_around(raster_of(shape))
    assert len(corners) == 4
    assert len(lines) == 4
    ring = np.array(shape.exterior.coords)
    for start, end in itertools.pairwise(ring):
        along = (end - start) / np.linalg.norm(end - start)
        middle = (start + end) / 2
        offset = [abs((line[OX] - middle[0]) * along[1] - (line[OY] - middle[1]) * along[0]) for line in lines]
        nearest = lines[int(np.argmin(offset))]
        assert min(offset) < 0.6
        assert abs(nearest[UX] * along[1] - nearest[UY] * along[0]) < np.sin(np.radians(1.5))
        assert lengths(nearest[None])[0] == pytest.approx(np.linalg.norm(end - start), abs=6)


def test_black_lies_across_every_line_of_outer_and_inner_outlines():
    ring = rectangle(150, 150, 200, 160, 20).difference(rectangle(150, 150, 90, 60, 20))
    black = raster_of(ring)
    lines, segments, _ = lines_around(black)
    assert len(lines) == 8
    assert len(set(segments.shapes)) == 1
    inside = black[
        np.floor(lines[:, OY] + 3 * lines[:, UX]).astype(int), np.floor(lines[:, OX] - 3 * lines[:, UY]).astype(int)
    ]
    outside = black[
        np.floor(lines[:, OY] - 3 * lines[:, UX]).astype(int), np.floor(lines[:, OX] + 3 * lines[:, UY]).astype(int)
    ]
    assert inside.all()
    assert not outside.any()


def test_a_line_directed_away_from_the_black_is_turned():
    black = raster_of(rectangle(150, 150, 120, 70))
    lines, _, _ = lines_around(black)
    backwards = lines.copy()
    backwards[:, [UX, UY]] *= -1
    np.testing.assert_allclose(inside_first(backwards, black, reach=3.0, outset=0.0), lines)


def test_shapes_shorter_than_three_metres_are_no_curves():
    black = np.zeros((60, 60), np.uint8)
    black[10:14, 10:14] = 1
    black[30:50, 30:50] = 1
    assert len(trace_shapes(black, shortest=3.0, gsd=GSD)) == 1


def test_a_line_fitted_to_noisy_points_is_their_total_least_squares_line():
    rng = np.random.default_rng(2)
    t = np.sort(rng.uniform(-30, 30, 80))
    points = np.stack([40 + 0.6 * t, 50 + 0.8 * t], axis=-1) + rng.normal(0, 0.3, (80, 2))
    line = fit_line(points, points, 0, 80)
    centred = points - points.mean(axis=0)
    axis = np.linalg.svd(centred)[2][0]
    assert abs(line[UX] * axis[1] - line[UY] * axis[0]) < 1e-9
    assert (line[OX] - points[:, 0].mean()) * axis[1] == pytest.approx((line[OY] - points[:, 1].mean()) * axis[0])


def test_a_piece_that_missed_a_corner_is_split_where_it_is_farthest_from_its_chord():
    bend = np.array([[0.0, 0.0], [60.0, 0.0], [60.0, 30.0]])
    curves = pack(bend, closed=False, spacing=1.0)
    none, offsets = np.empty(0, np.int64), np.zeros(2, np.int64)
    whole = fit_segments(curves, curves.points, none, offsets, shortest=5.0)
    split = fit_segments(curves, curves.points, none, offsets, shortest=5.0, deviation=1.0)
    assert len(whole) == 1
    assert len(split) == 2
    np.testing.assert_allclose(lengths(split.lines), [60, 30])
    np.testing.assert_allclose(np.abs(split.lines[:, [UX, UY]]), [[1, 0], [0, 1]], atol=1e-9)


def blobs(seed):
    """Return a mask of shapes of all sizes, most of them single pixels, up to the border."""
    rng = np.random.default_rng(seed)
    black = (rng.random((120, 150)) < 0.03).astype(np.uint8)
    for _ in range(25):
        row, column, height, width = rng.integers([0, 0, 1, 1], [115, 145, 30, 30])
        black[row : row + height, column : column + width] = 1
    black[rng.random(black.shape) < 0.03] = 0
    return black


@pytest.mark.parametrize("seed", range(3))
def test_single_pixels_have_no_outline_and_change_no_other(seed):
    black = blobs(seed)
    every, longer = (trace_shapes(black, shortest=shortest, gsd=GSD) for shortest in (GSD, 1.01 * GSD))
    sizes = np.diff(every.offsets)
    single = [len(np.unique(every.points[a:b], axis=0)) == 1 for a, b in itertools.pairwise(every.offsets)]
    assert sum(single) > 100
    kept = np.repeat(~np.array(single), sizes)
    np.testing.assert_array_equal(longer.points, every.points[kept])
    # Shapes are numbered anew; the outlines of one stay together.
    numbers = every.shapes[~np.array(single)]
    assert len(set(zip(numbers, longer.shapes, strict=True))) == len(set(numbers)) == len(set(longer.shapes))


@pytest.mark.parametrize("seed", range(3))
def test_an_outline_is_twice_as_long_as_any_line_along_it(seed):
    black = blobs(seed)
    found = []
    for shortest in (1.0, 2.0):
        curves = trace_shapes(black, shortest=shortest, gsd=GSD)
        points, corners, offsets = find_corners(curves, sigma=3.0, product=0.2, straight=(157.0, 203.0))
        found.append(fit_segments(curves, points, corners, offsets, shortest=1.0 / GSD).lines)
        found.append(len(curves))
    assert len(found[0]) > 20
    np.testing.assert_array_equal(found[0], found[2])
    assert found[3] < found[1]
