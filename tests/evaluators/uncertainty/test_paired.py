"""Two detections of one place, paired."""

from fractions import Fraction
from math import comb

import numpy as np
import pytest
import shapely
from harness.effort import examples
from hypothesis import given
from hypothesis import strategies as st

import roofbench as rb
from roofbench.core.errors import CRSError, InputError
from roofbench.evaluators.registry import EVALUATORS
from roofbench.evaluators.uncertainty.intervals import block_intervals
from roofbench.evaluators.uncertainty.paired import FATES, compare, mcnemar_p

HOUSES = rb.Footprints.of([shapely.box(25 * k, 0, 25 * k + 10, 10) for k in range(20)])


def shifted(footprints, step):
    return rb.Footprints.of(
        [shapely.transform(polygon, lambda xy: xy + np.array([step, 0])) for polygon in footprints.polygons]
    )


def test_fates_of_a_place_worked_by_hand():
    first, second = HOUSES.take(np.arange(0, 12)), shifted(HOUSES.take(np.arange(8, 15)), 1.0)
    found = compare(first, second, HOUSES)
    assert [found.objects[fate] for fate in FATES] == [4, 8, 3, 5, 0]
    assert found.fates[[0, 9, 13, 19]].tolist() == ["only A", "both", "only B", "neither"]
    # 11 discordant objects, 3 on the smaller side: 2 (1 + 11 + 55 + 165) / 2^11.
    assert found.p_value == pytest.approx(464 / 2048)
    assert found.conclusion == "no significant difference"
    completeness = found.differences[0]
    assert completeness.difference == pytest.approx((7 - 12) / 20)
    assert completeness.ends[0] < -0.25 < completeness.ends[1]
    columns = found.references
    assert columns["verdict_a"][:13].tolist() == ["TP"] * 12 + ["FN"]
    assert "shifted 1.0 m" in columns["reason_b"][9]


@pytest.mark.parametrize("evaluator", EVALUATORS.names())
def test_a_detection_does_not_differ_from_itself(evaluator):
    detected = shifted(HOUSES.take(np.arange(3, 17)), 2.0)
    found = compare(detected, detected, HOUSES, evaluator=evaluator)
    for one in found.differences:
        assert one.difference in (0, None)
        assert one.ends in ((0, 0), None)
        assert one.conclusion in ("no significant difference", "no interval", "not measurable")
    assert found.objects.get("only A", 0) == found.objects.get("only B", 0) == 0
    assert found.p_value in (1.0, None)


def test_exchanging_the_two_turns_every_sign():
    first, second = HOUSES.take(np.arange(12)), shifted(HOUSES.take(np.arange(6, 20)), 1.5)
    one, two = compare(first, second, HOUSES), compare(second, first, HOUSES)
    assert one.objects["only A"] == two.objects["only B"]
    assert one.p_value == two.p_value
    for there, back in zip(one.differences, two.differences, strict=True):
        assert back.difference == (None if there.difference is None else pytest.approx(-there.difference))
        if there.ends is not None:
            assert back.ends == pytest.approx((-there.ends[1], -there.ends[0]))


def test_pairing_narrows_the_interval_of_a_difference():
    rng = np.random.default_rng(3)
    reference = rb.Footprints.of([shapely.box(25 * k, 0, 25 * k + 10, 10) for k in range(200)])
    first = rng.random(200) < 0.6
    second = first | (rng.random(200) < 0.1)
    a, b = reference.take(first), reference.take(second)
    found = compare(a, b, reference).differences[0]
    alone = [block_intervals(side, reference).ends["object.completeness"] for side in (a, b)]
    assert found.ends[1] - found.ends[0] < 0.7 * min(high - low for low, high in alone)
    assert found.conclusion == "B better"


@examples(40)
@given(st.integers(0, 60), st.integers(0, 60))
def test_mcnemar_is_the_exact_binomial_test(b, c):
    tail = sum((Fraction(comb(b + c, k), 2 ** (b + c)) for k in range(min(b, c) + 1)), Fraction(0))
    assert mcnemar_p(b, c) == pytest.approx(float(min(Fraction(1), 2 * tail)), rel=1e-9)


def test_what_lies_outside_the_area_is_left_out():
    found = compare(HOUSES.take(np.arange(5)), HOUSES, HOUSES, area=shapely.box(-5, -5, 240, 20))
    assert [found.objects[fate] for fate in FATES] == [5, 0, 5, 0, 10]


def test_empty_detections_are_compared():
    found = compare(rb.Footprints.empty(), HOUSES, HOUSES)
    assert found.objects["only B"] == 20
    assert found.conclusion == "B finds more"
    assert found.differences[1].conclusion == "not measurable"


def test_different_systems_and_other_things_are_refused():
    there, here = (rb.Footprints.of(HOUSES.polygons, crs=crs) for crs in ("EPSG:25832", "EPSG:25833"))
    with pytest.raises(CRSError):
        compare(there, here, there)
    with pytest.raises(InputError, match="A is int, not footprints"):
        compare(3, HOUSES, HOUSES)
