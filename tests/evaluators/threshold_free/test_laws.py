"""Laws that any evaluation must keep; each is broken by some published tool."""

import math

import numpy as np
import pytest
import shapely
from builders.footprint_sets import random_detections, random_reference
from harness.effort import examples
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely import affinity

import roofbench as rb
from roofbench.evaluators.threshold_free.evaluator import ThresholdFree

seeds = st.integers(0, 10**6)
laws = examples(60)


def scene(seed, *, general=True):
    rng = np.random.default_rng(seed)
    reference, building = random_reference(rng, general=general)
    return random_detections(rng, reference), reference, building


def scene_without_ties(seed):
    """Return a scene whose centre distances all differ, so that the order of rows decides nothing."""
    detected, reference, building = scene(seed)
    rng = np.random.default_rng(seed + 1)
    detected = [affinity.translate(polygon, *rng.normal(0, 0.05, 2)) for polygon in detected]
    distances = evaluate(detected, reference).graph.distances
    assume(not len(distances) or np.diff(np.sort(distances)).min(initial=1) > 1e-4)
    return detected, reference, building


def evaluate(detected, reference, building=None, **parameters):
    evaluator = ThresholdFree(**parameters)
    return evaluator.evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference, building_ids=building))


def assert_same_values(one, two, *, rel=1e-7):
    for key, value in one.values.items():
        assert two.values[key] == (None if value is None else pytest.approx(value, rel=rel, abs=1e-7)), key


@laws
@given(seeds, st.sampled_from(["nearest", "one-pass", "overlap"]))
def test_every_object_is_counted_exactly_once(seed, matching):
    detected, reference, building = scene(seed)
    counts = evaluate(detected, reference, building, matching=matching).counts
    assert counts.true_positives + counts.false_positives + counts.multiple_detections == len(detected)
    assert counts.true_positives + counts.false_negatives == len(reference)


@laws
@given(seeds)
def test_the_matching_is_stable_and_maximal(seed):
    detected, reference, _ = scene(seed)
    graph = evaluate(detected, reference).graph
    partner_of_d, partner_of_r = graph.correspondence.of_detection, graph.correspondence.of_reference
    pairs = zip(graph.overlaps.first, graph.overlaps.second, strict=True)
    distance = dict(zip(pairs, np.round(graph.distances, 6), strict=True))
    for (d, r), near in distance.items():
        d_content = partner_of_d[d] >= 0 and distance[d, partner_of_d[d]] <= near
        r_content = partner_of_r[r] >= 0 and distance[partner_of_r[r], r] <= near
        assert d_content or r_content


@laws
@given(seeds)
def test_swapping_the_roles_swaps_the_indices(seed):
    detected, reference, _ = scene(seed)
    one, two = evaluate(detected, reference), evaluate(reference, detected)
    assert one.counts.true_positives == two.counts.true_positives
    assert one.object.detection_cross_lap_rate == two.object.reference_cross_lap_rate
    assert one.object.reference_cross_lap_rate == two.object.detection_cross_lap_rate
    if one.counts.multiple_detections == 0 and two.counts.multiple_detections == 0:
        assert one.object.completeness == two.object.correctness
        for this, other in (
            ("completeness", "correctness"),
            ("area_omission_error", "area_commission_error"),
            ("branching_factor", "miss_factor"),
        ):
            swapped = getattr(two.pixel, other)
            assert getattr(one.pixel, this) == (None if swapped is None else pytest.approx(swapped, abs=1e-9))


@laws
@given(seeds)
def test_the_order_of_the_input_does_not_matter(seed):
    detected, reference, building = scene_without_ties(seed)
    rng = np.random.default_rng(seed)
    d, r = rng.permutation(len(detected)), rng.permutation(len(reference))
    new_ids = {label: f"b{number}" for number, label in enumerate(rng.permutation(np.unique(building)))}
    mixed = evaluate([detected[k] for k in d], [reference[k] for k in r], [new_ids[building[k]] for k in r])
    plain = evaluate(detected, reference, building)
    assert_same_values(plain, mixed, rel=1e-9)
    assert mixed.counts == plain.counts
    assert mixed.graph.correspondence.of_detection.tolist() == [
        r.tolist().index(partner) if (partner := plain.graph.correspondence.of_detection[row]) >= 0 else -1 for row in d
    ]


@laws
@given(seeds, st.sampled_from([(6e6, 5e5), (-3e5, 6.6e6), (0.125, -7.5)]))
def test_moving_the_scene_changes_nothing(seed, shift):
    detected, reference, building = scene(seed)
    moved = [[affinity.translate(polygon, *shift) for polygon in side] for side in (detected, reference)]
    before, after = evaluate(detected, reference, building), evaluate(*moved, building)
    assert after.counts == before.counts
    assert_same_values(before, after)


@laws
@given(seeds, st.floats(0, 2 * math.pi), st.floats(0.2, 5))
def test_turning_changes_nothing_and_scaling_scales(seed, angle, factor):
    detected, reference, building = scene_without_ties(seed)

    def change(polygon):
        turned = affinity.rotate(polygon, angle, origin=(0, 0), use_radians=True)
        return affinity.scale(turned, factor, factor, origin=(0, 0))

    before = evaluate(detected, reference, building)
    after = evaluate([change(p) for p in detected], [change(p) for p in reference], building)
    assert after.counts == before.counts
    for key in ("true_positive", "false_positive", "false_negative"):
        expected = getattr(before.tallies.areas, key) * factor**2
        assert getattr(after.tallies.areas, key) == pytest.approx(expected, rel=1e-7, abs=1e-6)
    if before.geometric.rmse is not None:
        assert after.geometric.rmse == pytest.approx(before.geometric.rmse * factor, rel=1e-6, abs=1e-7)


@laws
@given(seeds)
def test_the_reference_against_itself_is_perfect(seed):
    _, reference, building = scene(seed)
    result = evaluate(reference, reference, building)
    assert result.object.completeness == result.object.correctness == result.object.quality == 1
    assert result.pixel.completeness == result.pixel.correctness == result.pixel.quality == 1
    assert result.pixel.area_omission_error == result.pixel.area_commission_error == 0
    assert result.pixel.branching_factor == result.pixel.miss_factor == 0
    assert result.object.multiple_detection_rate == result.geometric.rmse == 0
    assert result.geometric.median_iou == pytest.approx(1)


@laws
@given(seeds, seeds)
def test_two_scenes_far_apart_are_the_pooled_ones(first, second):
    one, two = scene(first), scene(second)
    away = [[affinity.translate(polygon, 5000, 0) for polygon in side] for side in two[:2]]
    together = evaluate(one[0] + away[0], one[1] + away[1], [f"1-{b}" for b in one[2]] + [f"2-{b}" for b in two[2]])
    pooled = rb.pool([evaluate(*one), evaluate(*two)])
    assert pooled.counts == together.counts
    assert_same_values(together, pooled)


@laws
@given(seeds)
def test_the_ratio_identities_hold(seed):
    detected, reference, building = scene(seed)
    result = evaluate(detected, reference, building)
    for group in (result.object, result.pixel):
        if group.completeness and group.correctness:
            assert 1 / group.quality == pytest.approx(1 / group.completeness + 1 / group.correctness - 1)
    if result.pixel.branching_factor is not None:
        assert result.pixel.branching_factor == pytest.approx(1 / result.pixel.correctness - 1, abs=1e-9)
        assert result.pixel.miss_factor == pytest.approx(1 / result.pixel.completeness - 1, abs=1e-9)
        assert result.pixel.area_omission_error == pytest.approx(1 - result.pixel.completeness, abs=1e-9)


@laws
@given(seeds)
def test_one_more_false_alarm_never_raises_correctness(seed):
    detected, reference, building = scene(seed)
    before = evaluate(detected, reference, building)
    after = evaluate([*detected, shapely.box(500, 500, 510, 510)], reference, building)
    assert (after.object.correctness or 0) <= (before.object.correctness or 1)
    assert (after.pixel.correctness or 0) <= (before.pixel.correctness or 1)
    assert after.object.completeness == before.object.completeness


@laws
@given(seeds)
def test_removing_a_multiple_detection_changes_only_four_rates(seed):
    detected, reference, building = scene(seed)
    before = evaluate(detected, reference, building)
    verdict = before.verdicts.detections["verdict"].to_numpy()
    multiple = np.flatnonzero(verdict == "MD")
    if not len(multiple):
        return
    rest = [polygon for row, polygon in enumerate(detected) if row != multiple[0]]
    after = evaluate(rest, reference, building)
    may_change = {
        "object.multiple_detection_rate",
        "object.detection_overlap_rate",
        "object.detection_cross_lap_rate",
        "object.reference_cross_lap_rate",
    }
    for index in before.evaluator.indices:
        if index.main and index.key not in may_change:
            value = before.values[index.key]
            assert after.values[index.key] == (None if value is None else pytest.approx(value, abs=1e-9)), index.key


def test_footprints_that_touch_are_no_pair():
    counts = evaluate([shapely.box(0, 0, 10, 10)], [shapely.box(10, 0, 20, 10), shapely.box(10, 10, 20, 20)]).counts
    assert (counts.true_positives, counts.false_positives, counts.false_negatives) == (0, 1, 2)


def test_there_is_no_cap_on_the_number_of_objects():
    row = [shapely.box(20 * k, 0, 20 * k + 10, 10) for k in range(70_000)]
    result = evaluate(row, row)
    assert result.counts.true_positives == 70_000
    assert result.pixel.quality == 1


def test_no_footprint_on_either_side_is_a_result_and_undefined_is_none():
    house = [shapely.box(0, 0, 10, 10)]
    nothing_found, nothing_there, nothing = evaluate([], house), evaluate(house, []), evaluate([], [])
    assert nothing_found.object.completeness == 0
    assert nothing_found.object.correctness is None
    assert nothing_found.geometric.rmse is None
    assert nothing_there.object.correctness == 0
    assert nothing_there.object.completeness is None
    assert all(value is None for value in nothing.values.values())


def test_a_perfect_scene_and_an_empty_one_count_rightly_in_the_mean():
    from roofbench.evaluators.base import mean_values

    house = [shapely.box(0, 0, 10, 10)]
    means = mean_values([evaluate(house, house), evaluate([], house), evaluate([], [])])
    assert means["object.completeness"] == (0.5, 2)
    assert means["object.correctness"] == (1.0, 1)


@pytest.mark.parametrize("factor", [1, 2, 4, 8])
def test_errors_of_pairs_are_never_negative_where_the_detection_covers_its_reference(factor):
    def circle(corners):
        turn = -np.arange(corners) * 2 * math.pi / corners
        return shapely.Polygon(np.stack([500_020 + 10 * np.cos(turn), 5_500_020 + 10 * np.sin(turn)], axis=1))

    evaluation = evaluate([circle(90 * factor)], [circle(90)])
    assert 0 <= evaluation.pixel.area_omission_error_matched < 1e-9
    assert evaluation.pixel.area_commission_error_matched >= 0


@laws
@given(seeds)
def test_the_literal_areas_are_never_smaller_than_the_unions(seed):
    detected, reference, building = scene(seed)
    tallies = evaluate(detected, reference, building).tallies
    for key in ("true_positive", "false_positive", "false_negative"):
        assert getattr(tallies.literal_areas, key) >= getattr(tallies.areas, key) - 1e-6


def test_literal_areas_of_a_house_in_its_neighbour_worked_by_hand():
    # Two buildings side by side; the detection of the left one reaches 2 m over the right one, which is found, too.
    reference = [shapely.box(0, 0, 10, 10), shapely.box(10, 0, 20, 10)]
    detected = [shapely.box(0, 0, 12, 10), shapely.box(10, 0, 20, 10)]
    found = evaluate(detected, reference)
    assert (found.pixel.correctness, found.pixel.quality) == (1, 1), "covered correctly by the other detection"
    assert found.pixel_literal.correctness == pytest.approx(200 / 220), "the rest of the first are FP pixels"
    assert found.pixel_literal.completeness == 1
    same = evaluate(detected, reference, [7, 7])
    assert same.pixel_literal.quality == 1, "natural overlap counts once"


@pytest.mark.parametrize("seed", range(5))
def test_literal_areas_in_pixels_tend_to_the_exact_ones(seed):
    detected, reference, building = scene(seed)
    exact = evaluate(detected, reference, building).tallies
    counted = evaluate(detected, reference, building, area="pixels", gsd=0.05).tallies
    for key in ("true_positive", "false_positive", "false_negative"):
        one, two = (getattr(tallies.literal_areas, key) for tallies in (exact, counted))
        assert two == pytest.approx(one, rel=0.02, abs=1.0)
