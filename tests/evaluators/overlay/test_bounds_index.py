"""Pairs of bounds from the packed tree, against all pairs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import roofbench as rb
from roofbench.evaluators.overlay.bounds_index import BoundsTree, meeting_bounds, meeting_bounds_within


def boxes(rng, count, extent):
    low = np.round(rng.uniform(0, extent, (count, 2)), 1)
    return np.concatenate([low, low + np.round(rng.exponential(3, (count, 2)), 1)], axis=1)


def plain(one, two):
    meet = (one[:, None, :2] < two[None, :, 2:]).all(axis=2) & (two[None, :, :2] < one[:, None, 2:]).all(axis=2)
    return np.nonzero(meet)


@given(seed=st.integers(0, 10**6), counts=st.tuples(st.integers(0, 70), st.integers(0, 70)))
def test_pairs_are_all_that_share_area(seed, counts):
    rng = np.random.default_rng(seed)
    one, two = (boxes(rng, count, 60) for count in counts)
    if counts[0]:
        one[0] = (-1e7, -1e7, 1e7, 1e7)  # the outline of a country among houses
    trees = BoundsTree.of(one), BoundsTree.of(two)
    for found, expected in zip(meeting_bounds(*trees, most=1e6), plain(one, two), strict=True):
        assert found.tolist() == expected.tolist()
    first, second = plain(one, one)
    within = meeting_bounds_within(trees[0], most=1e6)
    assert [rows.tolist() for rows in within] == [first[first < second].tolist(), second[first < second].tolist()]


def test_threads_change_nothing_and_a_crowd_is_given_up(monkeypatch):
    monkeypatch.setattr("roofbench.evaluators.overlay.bounds_index._CHUNK", 7)
    one, two = (BoundsTree.of(boxes(np.random.default_rng(seed), 300, 60)) for seed in (1, 2))
    alone, both = (meeting_bounds(one, two, most=1e6, threads=threads) for threads in (1, 2))
    assert all((a == b).all() for a, b in zip(alone, both, strict=True))
    assert meeting_bounds(one, two, most=10) is None


@pytest.mark.parametrize("seed", range(5))
def test_large_sets_have_the_evaluation_of_small_ones(monkeypatch, seed):
    from builders.footprint_sets import random_detections, random_reference

    rng = np.random.default_rng(seed)
    reference, building = random_reference(rng, general=True)
    sides = rb.Footprints.of(random_detections(rng, reference)), rb.Footprints.of(reference, building_ids=building)
    small = rb.evaluate(*sides)
    monkeypatch.setattr("roofbench.evaluators.overlay.overlaps._MANY_FOOTPRINTS", 0)
    monkeypatch.setattr("roofbench.evaluators.overlay.areas._MANY_MEMBERS", -1)
    monkeypatch.setattr("roofbench.evaluators.overlay.outline_distances._MANY_OUTLINES", 0)
    large = rb.evaluate(*sides)
    assert large.counts == small.counts
    for key, value in small.tallies.areas.to_dict().items():
        assert large.tallies.areas.to_dict()[key] == pytest.approx(value, abs=1e-9 * (1 + value))
    assert list(large.verdicts.detection_table.reasons) == list(small.verdicts.detection_table.reasons)
