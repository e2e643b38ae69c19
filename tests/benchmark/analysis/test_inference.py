import itertools

import numpy as np
import pytest
from harness.effort import examples
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from roofbench.benchmark.analysis.inference import (
    HALF_SPLITS,
    bootstrap_interval,
    first_places,
    holm,
    letter_groups,
    lowest_p,
    paired_p,
    scenes_needed,
    sign_flip_p,
)


def naive_sign_flip(differences):
    sums = [abs(np.dot(signs, differences)) for signs in itertools.product((-1, 1), repeat=len(differences))]
    return np.mean([total >= abs(sum(differences)) - 1e-9 for total in sums])


@given(st.lists(st.integers(-20, 20), min_size=1, max_size=9))
def test_the_sign_flip_test_is_the_enumeration_of_all_signs(differences):
    assert paired_p(differences) == pytest.approx(naive_sign_flip(differences) if any(differences) else 1.0)


@examples(30)  # half a million sums each
@given(st.lists(st.sampled_from([0, 0, 0, 1, -1, 7, -900, 4095, -4096]), min_size=16, max_size=18))
def test_the_test_of_many_differences_agrees_with_enumeration(differences):
    differences = [4096, *differences]  # the largest is the unit of the lattice
    sums = np.zeros(1, dtype=int)
    for difference in differences:
        sums = np.concatenate([sums + difference, sums - difference])
    assert sign_flip_p(differences) == pytest.approx((sums <= sum(differences)).mean())


@pytest.mark.parametrize("count", [17, 30, 300, 1000])
def test_both_tails_are_those_of_the_differences_and_of_their_opposites(count):
    differences = np.random.default_rng(count).normal(0.05, 1, count)
    assert paired_p(differences) == 2 * min(sign_flip_p(differences), sign_flip_p(-differences))


@pytest.mark.parametrize("count", [100, 1000])
def test_the_test_of_very_many_differences_nears_the_normal_distribution(count):
    differences = np.random.default_rng(count).normal(-0.1, 1, count)
    expected = norm.cdf(differences.sum() / np.sqrt((differences**2).sum()))
    assert sign_flip_p(differences) == pytest.approx(expected, rel=0.1)


@given(st.lists(st.floats(-1, 1), min_size=1, max_size=40), st.floats(0, 2))
def test_a_margin_never_makes_it_easier_to_be_worse(differences, margin):
    with_margin = [difference + margin for difference in differences]
    # beyond 16 differences the unit of the lattice changes with the largest one
    slack = 1e-12 if len(differences) <= 16 else 0.01
    assert sign_flip_p(with_margin) >= sign_flip_p(differences) - slack


@given(st.lists(st.floats(-1, 1), min_size=1, max_size=12), st.floats(0.001, 1000))
def test_the_test_does_not_depend_on_sign_or_unit(differences, factor):
    scaled = [-factor * difference for difference in differences]
    assert paired_p(scaled) == pytest.approx(paired_p(differences), abs=0.02)


@pytest.mark.parametrize("count", [2, 5, 6, 10])
def test_differences_of_one_sign_reach_the_lowest_p(count):
    assert paired_p(np.arange(1, count + 1)) == lowest_p(count) == 2.0 ** (1 - count)


def test_five_scenes_can_never_reach_five_percent():
    assert lowest_p(5) > 0.05 >= lowest_p(6)
    assert scenes_needed(1) == 6
    assert scenes_needed(5) == 8
    assert lowest_p(scenes_needed(5)) <= 0.05 / 5 < lowest_p(scenes_needed(5) - 1)


def test_no_difference_gives_p_of_one():
    assert paired_p([]) == paired_p([0.0] * 30) == 1.0


def test_the_test_holds_its_level_where_most_differences_are_zero_and_some_are_wild():
    rng = np.random.default_rng(2)
    wild = [rng.choice([-1, 0, 0, 1], 30) * rng.lognormal(0, 2, 30) for _ in range(400)]
    assert np.mean([sign_flip_p(differences) <= 0.05 for differences in wild]) < 0.08


@pytest.mark.parametrize("count", [8, 25])
def test_the_test_holds_its_level_and_finds_a_shift(count):
    rng = np.random.default_rng(count)
    null = np.mean([paired_p(rng.normal(0, 1, count)) <= 0.05 for _ in range(300)])
    shifted = np.mean([paired_p(rng.normal(1.5, 1, count)) <= 0.05 for _ in range(100)])
    assert null < 0.09
    assert shifted > 0.8


def test_the_interval_covers_the_mean_as_often_as_its_level():
    rng = np.random.default_rng(0)
    hits = [low <= 0 <= high for low, high in (bootstrap_interval(rng.normal(0, 1, 10)) for _ in range(400))]
    assert 0.92 < np.mean(hits) < 0.985


def test_the_interval_is_the_same_every_time_and_needs_two_values():
    values = [0.4, 0.7, 0.6]
    assert bootstrap_interval(values) == bootstrap_interval(values)
    assert bootstrap_interval([0.4]) is None


@given(st.lists(st.floats(0, 1), min_size=1, max_size=8))
def test_holm_keeps_the_order_and_never_helps(p_values):
    adjusted = holm(p_values)
    assert all(new >= old for new, old in zip(adjusted, p_values, strict=True))
    order = np.argsort(p_values, kind="stable")
    assert (np.diff(np.array(adjusted)[order]) >= 0).all()
    assert adjusted[order[0]] == min(1.0, len(p_values) * p_values[order[0]])


@given(st.integers(1, 6).flatmap(lambda n: st.tuples(st.just(n), st.sets(st.sampled_from(pairs(n) or [(0, 0)])))))
def test_two_detectors_share_a_letter_exactly_if_they_do_not_differ(case):
    count, differing = case
    letters = letter_groups(count, lambda i, j: (i, j) in differing)
    assert all(letters)
    for i, j in pairs(count):
        assert bool(set(letters[i]) & set(letters[j])) == ((i, j) not in differing)


def pairs(count):
    return list(itertools.combinations(range(count), 2))


def test_first_places_on_halves_of_the_scenes():
    rng = np.random.default_rng(0)
    noise = rng.normal(0, 0.1, (2, 20))
    alike, ahead = first_places(noise), first_places(noise + np.array([[1.0], [0.0]]))
    assert alike.sum() == ahead.sum() == HALF_SPLITS
    assert ahead.tolist() == [HALF_SPLITS, 0]
    assert alike.max() < HALF_SPLITS
    assert first_places(noise).tolist() == alike.tolist(), "a fixed stream"
    assert first_places([[1.0] * 5, [1.0] * 5]).tolist() == [HALF_SPLITS, 0], "equal: the earlier row"
