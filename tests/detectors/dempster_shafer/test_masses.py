"""Masses and Dempster's rule: against numbers worked by hand, a slow enumeration, and the laws of the theory."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from naive import masses as naive

from roofbench.detectors.dempster_shafer.masses import (
    ALL,
    BUILDING,
    CLASSES,
    GRASS,
    SOIL,
    TREE,
    combined,
    evidence_for,
    step_probability,
    strongest_class,
    support,
)


def cell(value):
    return np.array([value], dtype=np.float32)


def test_two_cues_combine_as_worked_by_hand():
    """m1(BT)=.8, m1(GS)=.2; m2(T)=.3, m2(BGS)=.7. T .24, B .56, GS .14, conflict .06; divided by .94."""
    height, pulses = evidence_for(BUILDING | TREE, cell(0.8)), evidence_for(TREE, cell(0.3))
    found, conflict = combined([height, pulses], (1,))
    assert conflict[0] == pytest.approx(0.06)
    assert found[TREE][0] == pytest.approx(0.24 / 0.94)
    assert found[BUILDING][0] == pytest.approx(0.56 / 0.94)
    assert found[GRASS | SOIL][0] == pytest.approx(0.14 / 0.94)
    assert support(found, BUILDING | TREE)[0] == pytest.approx(0.80 / 0.94)
    assert CLASSES[strongest_class(found)[0]] == BUILDING


def test_a_third_cue_combines_as_worked_by_hand():
    """m3(TG)=.9, m3(BS)=.1 on the masses above (times .94): T .216, B .056, G .126, S .014, conflict .528 of .94."""
    cues = [
        evidence_for(BUILDING | TREE, cell(0.8)),
        evidence_for(TREE, cell(0.3)),
        evidence_for(TREE | GRASS, cell(0.9)),
    ]
    found, conflict = combined(cues, (1,))
    left = 0.216 + 0.056 + 0.126 + 0.014
    assert {one: found[one][0] for one in CLASSES} == pytest.approx(
        {TREE: 0.216 / left, BUILDING: 0.056 / left, GRASS: 0.126 / left, SOIL: 0.014 / left}
    )
    assert conflict[0] == pytest.approx(1 - left)
    assert CLASSES[strongest_class(found)[0]] == TREE


def test_certain_evidence_that_contradicts_says_nothing():
    found, conflict = combined([evidence_for(TREE, cell(1.0)), evidence_for(BUILDING, cell(1.0))], (1,))
    assert conflict[0] == 1
    assert found[ALL][0] == 1
    assert CLASSES[strongest_class(found)[0]] == SOIL


def test_an_unknown_cue_changes_nothing():
    known = evidence_for(BUILDING | TREE, cell(0.7))
    alone, _ = combined([known], (1,))
    both, conflict = combined([known, evidence_for(TREE, cell(np.nan))], (1,))
    assert conflict[0] == 0
    for held in alone:
        assert both[held][0] == pytest.approx(alone[held][0])


def test_low_ground_without_colours_is_soil_and_no_building():
    found, _ = combined([evidence_for(BUILDING | TREE, cell(0.05)), evidence_for(TREE, cell(0.05))], (1,))
    assert CLASSES[strongest_class(found)[0]] == SOIL


def test_the_step_is_a_cubic_between_its_bounds():
    """t = 1/4: 3/16 - 2/64 = 0.15625, so that P = .05 + .9 * .15625."""
    assert step_probability([1.0, 1.5, 1.875, 2.25, 3.0, 7.0], 1.5, 3.0) == pytest.approx(
        [0.05, 0.05, 0.190625, 0.5, 0.95, 0.95]
    )
    assert np.isnan(step_probability([np.nan], 1.5, 3.0)).all()
    assert np.all(np.diff(step_probability(np.linspace(0, 4, 200), 1.5, 3.0)) >= 0)


CUES = st.lists(
    st.tuples(st.integers(1, ALL - 1), st.one_of(st.floats(0, 1, width=32), st.just(float("nan")))), max_size=6
)


@given(CUES)
def test_the_combination_equals_the_enumeration_of_all_subsets(cues):
    pieces = [evidence_for(classes, cell(probability)) for classes, probability in cues]
    found, conflict = combined(pieces, (1,))
    plain = [{held: float(mass[0]) for held, mass in piece.items()} for piece in pieces]
    expected, expected_conflict = naive.combined(plain)
    if expected_conflict > 1 - 1e-4:
        return  # what is left is rounding
    assert conflict[0] == pytest.approx(expected_conflict, abs=1e-5)
    assert sum(float(mass[0]) for mass in found.values()) == pytest.approx(1, abs=1e-5)
    for held in range(1, ALL + 1):
        assert support(found, held)[0] == pytest.approx(naive.support(expected, held), abs=2e-3)


@given(CUES)
def test_the_order_of_the_cues_does_not_matter(cues):
    pieces = [evidence_for(classes, cell(probability)) for classes, probability in cues]
    forward, conflict = combined(pieces, (1,))
    backward, other = combined(pieces[::-1], (1,))
    if conflict[0] > 1 - 1e-4:
        return
    assert conflict[0] == pytest.approx(other[0], abs=1e-5)
    for held in range(1, ALL + 1):
        assert support(forward, held)[0] == pytest.approx(support(backward, held)[0], abs=2e-3)
