"""The fast evaluator agrees with plain loops on a thousand random scenes, at night on a hundred thousand."""

import numpy as np
import pytest
import shapely
from builders.footprint_sets import footprints_on_a_lattice, random_detections, random_reference
from harness import effort
from naive import evaluation as naive

import roofbench as rb
from roofbench.evaluators.threshold_free.evaluator import ThresholdFree
from roofbench.scenes.geodata.raster import Grid


def scene(seed, *, general):
    rng = np.random.default_rng(seed)
    reference, building = random_reference(rng, general=general)
    return random_detections(rng, reference), reference, building


def footprints(polygons, building=None):
    return rb.Footprints.of(polygons, building_ids=building)


def assert_same(evaluation, expected):
    scale = max(
        1.0, expected["areas.true_positive"] + expected["areas.false_positive"] + expected["areas.false_negative"]
    )
    tallies = evaluation.tallies.to_dict()
    for key, value in expected.items():
        if key.startswith("counts."):
            assert tallies[key] == value, key
        else:
            assert tallies[key] == pytest.approx(value, rel=1e-9, abs=1e-9 * scale), key


@pytest.mark.parametrize("matching", ["nearest", "one-pass", "overlap"])
@pytest.mark.parametrize("general", [False, True], ids=["rectangles", "polygons"])
@pytest.mark.parametrize("block", range(effort.of(10, 1000)))
def test_counts_are_equal_and_areas_agree_to_nine_digits(block, general, matching):
    evaluator = ThresholdFree(matching=matching)
    seeds = range(50 * block, 50 * (block + 1)) if matching == "nearest" else range(10 * block, 10 * (block + 1))
    for seed in seeds:
        detected, reference, building = scene(seed, general=general)
        evaluation = evaluator.evaluate(footprints(detected), footprints(reference, building))
        assert_same(evaluation, naive.evaluate(detected, reference, building, matching=matching))


@pytest.mark.parametrize("seed", [2698, 4913, 7300, 9706, 11977, 12354, 22587, 31092, 36168, 46128, 47148])
@pytest.mark.parametrize("general", [False, True], ids=["rectangles", "polygons"])
def test_sets_whose_overlay_in_floating_precision_loses_area(seed, general):
    detected, reference, building = scene(seed, general=general)
    evaluation = ThresholdFree().evaluate(footprints(detected), footprints(reference, building))
    assert_same(evaluation, naive.evaluate(detected, reference, building))


@pytest.mark.parametrize("seed", range(20))
def test_large_outlines_cut_into_pieces_share_the_same_areas(seed, monkeypatch):
    monkeypatch.setattr("roofbench.evaluators.overlay.polygon_overlay._MANY_VERTICES", 6)
    monkeypatch.setattr("roofbench.evaluators.overlay.polygon_overlay._FEW_PAIRS", 1)
    detected, reference, building = scene(seed, general=True)
    evaluation = ThresholdFree().evaluate(footprints(detected), footprints(reference, building))
    assert_same(evaluation, naive.evaluate(detected, reference, building))


def test_one_outline_around_a_quarter_is_overlaid_in_pieces(monkeypatch):
    houses = [shapely.box(20 * i, 20 * j, 20 * i + 10, 20 * j + 10) for i in range(14) for j in range(14)]
    quarter = shapely.union_all([*shapely.buffer(houses, 1, join_style="mitre"), shapely.box(4, 4, 266, 5)])
    quarter = shapely.union_all([quarter, *(shapely.box(20 * i + 4, 4, 20 * i + 5, 266) for i in range(14))])
    assert shapely.get_num_coordinates(quarter) > 1000
    sizes = []
    intersection = shapely.intersection

    def watched(one, two):
        sizes.extend(np.atleast_1d(np.maximum(shapely.get_num_coordinates(one), shapely.get_num_coordinates(two))))
        return intersection(one, two)

    monkeypatch.setattr(shapely, "intersection", watched)
    evaluation = ThresholdFree().evaluate(footprints([quarter]), footprints(houses))
    assert evaluation.graph.overlaps.area == pytest.approx(100.0)
    assert sum(size > 1000 for size in sizes) <= 2


@pytest.mark.parametrize("seed", range(60))
def test_evaluation_area_and_minimum_size_are_as_defined(seed):
    detected, reference, building = scene(seed, general=seed % 2 == 0)
    area = naive.rectangle(30, 30, 45, 35, seed)
    evaluator = ThresholdFree(minimum_area=45.0 if seed % 3 else 0.0)
    evaluation = evaluator.evaluate(footprints(detected), footprints(reference, building), area=area)
    expected = naive.evaluate(detected, reference, building, area=area, minimum_area=evaluator.minimum_area)
    assert_same(evaluation, expected)


@pytest.mark.parametrize("matching", ["nearest", "one-pass", "overlap"])
def test_footprints_that_touch_the_evaluation_area_and_each_other_are_cut_cleanly(matching):
    area = shapely.box(5, 5, 35, 35) - shapely.box(15, 15, 22, 22)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        detected, reference = (footprints_on_a_lattice(rng, rng.integers(0, 9)) for _ in range(2))
        building = rng.integers(0, 4, len(reference)).tolist()
        evaluator = ThresholdFree(matching=matching, minimum_area=30.0 if seed % 5 == 0 else 0.0)
        evaluation = evaluator.evaluate(footprints(detected), footprints(reference, building), area=area)
        expected = naive.evaluate(
            detected, reference, building, matching=matching, area=area, minimum_area=evaluator.minimum_area
        )
        assert_same(evaluation, expected)


def test_a_house_along_the_border_of_the_evaluation_area_may_overlap_one_beyond_it():
    # Cut at x = 20, the L is a rectangle and a line, and its neighbour is nothing.
    corner_house = shapely.box(10, 5, 22, 10) | shapely.box(20, 10, 22, 15)
    beyond = shapely.box(21, 5, 30, 20)
    evaluation = ThresholdFree().evaluate(
        footprints([corner_house, beyond]), footprints([corner_house, beyond]), area=shapely.box(0, 0, 20, 20)
    )
    assert evaluation.counts.true_positives == 1
    assert evaluation.tallies.areas.true_positive == pytest.approx(50)


@pytest.mark.parametrize("seed", range(30))
def test_pixel_areas_count_the_pixel_centres_inside(seed):
    detected, reference, _ = scene(seed, general=seed % 2 == 0)
    grid = Grid(west=-3.217, north=71.113, gsd=0.37, rows=10, columns=10)
    evaluation = ThresholdFree().evaluate(footprints(detected), footprints(reference), grid=grid)
    matches, nearest = naive.correspondence(detected, reference)
    false_positive = [d for d in range(len(detected)) if d not in nearest]
    false_negative = [r for r in range(len(reference)) if r not in matches.values()]
    expected = naive.pixel_areas(
        detected, reference, matches, false_positive, false_negative, grid.west, grid.north, grid.gsd
    )
    found = [getattr(evaluation.tallies.areas, name) for name in ("true_positive", "false_positive", "false_negative")]
    assert found == pytest.approx(expected, rel=1e-12)


def test_pixel_areas_in_many_bands_are_those_in_one(monkeypatch):
    detected, reference, _ = scene(4, general=True)
    whole = ThresholdFree(area="pixels", gsd=0.05).evaluate(footprints(detected), footprints(reference))
    monkeypatch.setattr("roofbench.evaluators.overlay.pixels._BAND_CROSSINGS", 97)
    banded = ThresholdFree(area="pixels", gsd=0.05).evaluate(footprints(detected), footprints(reference))
    assert banded.tallies == whole.tallies


@pytest.mark.parametrize("seed", range(8))
def test_pixel_areas_tend_to_exact_areas_as_the_gsd_shrinks(seed):
    detected, reference, building = scene(seed, general=True)
    exact = ThresholdFree(area="exact").evaluate(footprints(detected), footprints(reference, building))
    perimeter = sum(polygon.length for polygon in [*detected, *reference])
    for gsd in (1.0, 0.3, 0.1, 0.03, 0.01):
        pixels = ThresholdFree(area="pixels", gsd=gsd).evaluate(footprints(detected), footprints(reference, building))
        for name in ("true_positive", "false_positive", "false_negative"):
            error = abs(getattr(pixels.tallies.areas, name) - getattr(exact.tallies.areas, name))
            # A pixel can be wrong only where an outline crosses it.
            assert error <= perimeter * gsd


def test_touching_footprints_share_every_pixel_between_them_once():
    left, right = shapely.box(0, 0, 1, 1), shapely.box(1, 0, 2, 1)
    both = shapely.box(0, 0, 2, 1)
    evaluate = ThresholdFree(area="pixels", gsd=0.25).evaluate
    apart = evaluate(footprints([left, right]), footprints([]))
    whole = evaluate(footprints([both]), footprints([]))
    assert apart.tallies.areas.false_positive == whole.tallies.areas.false_positive == pytest.approx(2.0)
