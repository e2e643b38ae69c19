"""The rules of the authors' own program, each by itself."""

import numpy as np
import pytest
from builders.line_scenes import GREEN_ROOF, SceneBuilder, rectangle

from roofbench.detectors.lines.boxes import U0, U1, V0, V1, prefix_sums
from roofbench.detectors.lines.colours import Colours, dominant_ranges, yiq_bins
from roofbench.detectors.lines.extension import Cover, Growth, extend_lines
from roofbench.detectors.lines.final_rectangles import (
    DROPPED,
    FinalRules,
    black_share,
    extended_final_side,
    final_rectangles,
)
from roofbench.detectors.lines.improved import Improved
from roofbench.detectors.lines.masks import build_cell_masks
from roofbench.detectors.lines.original import Original
from roofbench.detectors.lines.texture import BIN_COUNT, TextureRules, apply_tests
from roofbench.detectors.lines.trace import Outcome
from roofbench.detectors.lines.vegetation import noise_variance, pseudo_ndvi_sigma
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Grid

BOX = np.array([50.0, 30.0, 1.0, 0.0, -10.0, 10.0, -10.0, 10.0])
RULES = FinalRules(0.0, 0.97, 0.9, 2.0, 2.0, 0.4, 0.9, 0.1, 0.0, False)


def grey(rows=60, columns=100):
    return Colours.of(np.full((3, rows, columns), 99, np.uint8))


@pytest.mark.parametrize(("spacing", "side"), [(0.3, 3), (0.5, 3), (0.7, 3), (1.0, 7), (1.5, 11)])
def test_a_point_marks_a_square_of_cells_that_follows_the_spacing(spacing, side):
    grid = Grid(0.0, 20.0, 0.25, 80, 80)
    points = PointCloud(np.array([5.1, 15.1]), np.array([10.1, 10.1]), np.array([0.0, 9.0]))
    masks = build_cell_masks(points, np.array([2.5, 2.5]), grid, spacing=spacing, clip=False)
    assert (1 - masks.primary).sum() == masks.secondary.sum() == side**2
    assert masks.primary[39, 20] == 0
    assert masks.secondary[39, 60] == 1


def test_masks_of_cells_cover_the_same_area_on_any_image():
    points = PointCloud(np.array([5.1]), np.array([10.1]), np.array([9.0]))
    areas = []
    for gsd in (0.1, 0.25, 0.05):
        grid = Grid(0.0, 20.0, gsd, round(20 / gsd), round(20 / gsd))
        masks = build_cell_masks(points, np.array([2.5]), grid, spacing=0.5, clip=False)
        areas.append(masks.secondary.sum() * gsd**2)
    np.testing.assert_allclose(areas, 0.75**2, rtol=0.15)


def test_bins_of_a_tenth_follow_the_definition():
    rng = np.random.default_rng(1)
    for red, green, blue in [(255, 0, 0), (0, 255, 0), (0, 0, 255), *rng.integers(0, 256, (50, 3))]:
        found = yiq_bins(Colours.of(np.array([red, green, blue], np.uint8).reshape(3, 1, 1), tenths=True), 0, 0)
        yiq = np.array([[0.299, 0.587, 0.114], [0.595716, -0.274453, -0.321263], [0.211456, -0.522591, 0.311135]])
        y, i, q = yiq @ (np.array([red, green, blue]) / 255)
        assert found == (min(int(10 * y), 9), int(np.floor(10 * i)) + 6, int(np.floor(10 * q)) + 6)
        assert max(found[1:]) < 12
        assert min(found) >= 0


def test_independent_sides_are_all_extended_from_the_same_rectangle():
    secondary = np.zeros((60, 100), np.uint8)
    secondary[20:40, 30:70] = 1
    secondary[10:20, 40:60] = 1  # reached from the rectangle as it was, but not from the widened one
    order = np.zeros(1, np.int64)
    found = {}
    for independent in (False, True):
        rules = RULES._replace(independent=independent)
        boxes, _ = final_rectangles(grey(), np.zeros_like(secondary), secondary, rules, BOX[None], order)
        found[independent] = boxes[0]
    np.testing.assert_allclose(found[True][[U0, U1]], [-20, 20], atol=2)
    np.testing.assert_allclose(found[True][[V0, V1]], [-20, 10], atol=2)
    wide = BOX.copy()
    wide[U0], wide[U1] = -20, 20
    within = dominant_ranges(grey(), wide, 0.97, 0.9)
    assert extended_final_side(grey(), np.zeros_like(secondary), secondary, within, RULES, wide, V0, 0.0) == -10
    assert found[False][V0] == found[True][V0]  # the first side in the sequence starts alike


def test_primary_black_may_rise_until_it_once_fell_below_a_tenth():
    secondary = np.ones((60, 100), np.uint8)
    primary = secondary.copy()
    primary[:, 62:66] = 0
    primary[15:45, 72:76] = 0
    within = dominant_ranges(grey(), BOX, 0.97, 0.9)
    free = RULES._replace(rises_after_gap=True)
    # Black, white at 62, black again at 66: the rise after the gap ends the side.
    assert 50 + extended_final_side(grey(), primary, secondary, within, free, BOX, U1, 0.0) == 66
    primary[:, 62:66] = 1
    primary[25:45, 62:66] = 0  # a third of the strip stays black: no gap
    assert 50 + extended_final_side(grey(), primary, secondary, within, free, BOX, U1, 0.0) == 76
    assert 50 + extended_final_side(grey(), primary, secondary, within, RULES, BOX, U1, 0.0) < 70


def test_a_rectangle_without_enough_secondary_black_is_dropped():
    secondary = np.zeros((60, 100), np.uint8)
    secondary[:, :56] = 1
    assert black_share(secondary, BOX) == pytest.approx(0.8)
    arguments = grey(), np.zeros_like(secondary), secondary
    for share, kept in ((0.7, True), (0.9, False)):
        _, final_of = final_rectangles(*arguments, RULES._replace(filled_share=share), BOX[None], np.zeros(1, np.int64))
        assert (final_of[0] != DROPPED) == kept


def test_the_noise_of_a_scene_with_edges_is_found():
    rng = np.random.default_rng(2)
    band = np.where(np.arange(400) % 100 < 50, 60.0, 180.0) + rng.normal(0, 4.0, (300, 400))
    assert np.sqrt(noise_variance(band)) == pytest.approx(4.0, rel=0.05)
    assert noise_variance(np.full((1, 1), 7.0)) == 0


def test_the_sigma_of_the_index_grows_where_the_image_is_dark():
    rng = np.random.default_rng(3)
    level = np.repeat([4.0, 20.0, 80.0, 200.0], 100)
    red, green = (level + rng.normal(0, 2.0, (100, 400)) for _ in range(2))
    index = pseudo_ndvi_sigma(red, green)
    means = index.reshape(100, 4, 100).mean(axis=(0, 2))
    assert (np.diff(means) < 0).all()
    assert index.max() <= 100
    assert (pseudo_ndvi_sigma(np.zeros((9, 9)), np.zeros((9, 9))) == 100).all()


@pytest.mark.parametrize(("green_line", "green_ground", "reaches"), [(0, 0, 1), (0, 1, 0), (1, 1, 1), (1, 0, 0)])
def test_strips_must_be_of_the_kind_of_their_line(green_line, green_ground, reaches):
    black = np.ones((60, 100), np.uint8)
    cover = Cover(prefix_sums(black), prefix_sums(200 * green_ground * black), prefix_sums(0 * black))
    rules = Growth(20.0, 2.7, 0.7, 1e6, vegetation=48.0, entropy=0.3, same_kind=True)
    line = np.array([50.0, 20.0, 1.0, 0.0, -10.0, 10.0, 0.0, 0.0])
    found = extend_lines(cover, rules, line[None], 20.0, np.array([bool(green_line)]))[0]
    assert (found[U1] > 30) == bool(reaches)


def test_the_first_step_of_a_rectangle_is_its_own():
    """Below the last step, 2 m, no rectangle is extended from its 1.5 m; lines are extended as before."""
    scene = SceneBuilder().house(rectangle(30, 30, 20, 14, 20)).build().for_detection()
    same, own = (
        Original(extension_stop=2.0, rectangle_extension=step, largest_pixel=1000.0).trace(scene)
        for step in (None, 1.5)
    )
    np.testing.assert_array_equal(own.lines, same.lines)
    assert len(same.initial) > len(own.initial) == 0
    assert (own.outcomes[same.outcomes == Outcome.RECTANGLE] == Outcome.NARROW).all()


def test_any_high_bin_is_a_peak():
    histogram = np.zeros((1, BIN_COUNT))
    histogram[0, [5, 6]] = 10.0, 9.5
    rules = TextureRules(margin=0.0, least=3.0, most_edges=90.0, area_per_edge=4.5, peak_ratio=1.0)
    tests = [apply_tests(histogram, np.zeros(1), np.ones(1), rules._replace(any_bin=any_bin))[0] for any_bin in (0, 1)]
    assert [bool(passed[2]) for passed in tests] == [False, True]  # T3: two bins of 6 m
    assert not tests[1][0]  # T1 needs bins between


def test_lines_without_a_black_strip_are_dropped_with_that_reason():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 20)).build().for_detection()
    trace = Original(inside_test="strip", extension_black=1.0, marking="squares").trace(scene)
    assert (trace.outcomes == Outcome.NO_SIDE).any()
    found = Original(inside_test="strip").trace(scene)
    assert len(found.final) == 1


def test_entropy_is_relative_to_the_image():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 20), GREEN_ROOF).tree(10, 50, 5).build().for_detection()
    detector = Improved(entropy="share")
    high = np.diff(detector._rasters(scene).cover.entropy, axis=1)
    assert set(np.unique(high)) == {0, 1}
    assert 0 < high.mean() < 0.9


@pytest.mark.parametrize("detector", [Original(mode="program"), Improved(mode="program", texture="none")])
@pytest.mark.parametrize("degrees", [0, 30, 77])
def test_the_program_finds_a_clean_house(detector, degrees):
    builder = SceneBuilder().house(rectangle(30, 30, 15, 10, degrees))
    found = detector.detect(builder.build().for_detection(), np.random.default_rng(0))
    truth = builder.truth()[0]
    assert len(found) >= 1
    best = max(polygon.intersection(truth).area / polygon.union(truth).area for polygon in found.polygons)
    assert best > 0.8
