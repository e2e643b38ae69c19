"""Each square metre of F and M has one cause."""

import doctest
from dataclasses import asdict

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

import roofbench as rb
from roofbench.evaluators.threshold_free import causes
from roofbench.evaluators.threshold_free.causes import CAUSES, loss_by_cause

HOUSE = shapely.box(0, 0, 20, 10)


def losses(detected, reference, area=None):
    evaluation = rb.evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference), area=area)
    loss = asdict(loss_by_cause(evaluation.graph, area=area))
    tally = evaluation.tallies.areas
    assert sum(loss.values()) == pytest.approx(tally.false_positive + tally.false_negative)
    return {name: value for name, value in loss.items() if value > 1e-9}


def test_the_example_of_the_docstring():
    assert doctest.testmod(causes).failed == 0


def test_the_second_half_of_a_house_is_a_split():
    assert losses([shapely.box(0, 0, 12, 10), shapely.box(12, 0, 20, 10)], [HOUSE]) == {"split": pytest.approx(80)}


def test_a_detection_of_two_houses_is_merged_in_both_directions():
    found = losses([shapely.box(0, 0, 30, 10)], [HOUSE, shapely.box(20, 0, 30, 10)])
    assert found == {"merged": pytest.approx(200)}


def test_holes_and_bulges_lie_beyond_the_rim():
    yard = HOUSE.difference(shapely.box(5, 3, 9, 7))
    assert losses([yard], [HOUSE]) == {"holes": pytest.approx(16)}
    found = losses([shapely.box(0, 0, 30, 10)], [HOUSE])
    assert found["rim_added"] == pytest.approx(15)
    assert found["bulges"] == pytest.approx(85)


def test_only_the_evaluation_area_counts():
    assert losses([shapely.box(0, 0, 20, 9)], [HOUSE], area=shapely.box(0, -5, 15, 20)) == {
        "rim_omitted": pytest.approx(15)
    }


def test_points_of_nothing_are_undefined():
    assert causes.LossByCause().points(0) == dict.fromkeys(CAUSES)
    assert causes.LossByCause(split=5).points(50)["split"] == 10


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_causes_add_up_where_no_side_overlaps_itself(seed):
    rng = np.random.default_rng(seed)
    sides = []
    for _ in range(2):
        # Boxes in cells of 10 m do not overlap each other.
        column, row = np.divmod(rng.choice(16, rng.integers(1, 9), replace=False), 4)
        size, shift = rng.uniform(2, 10, (2, len(row))), rng.uniform(0, 3)
        corner = 10 * np.stack([column, row]) + shift
        sides.append(shapely.box(*corner, *(corner + size)))
    losses(*sides)
