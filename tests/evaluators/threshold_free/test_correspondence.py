"""Matching, given overlaps and distances directly."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roofbench.evaluators.overlay.overlaps import Overlaps
from roofbench.evaluators.threshold_free.correspondence import MATCHINGS, match


def overlaps_of(pairs):
    """Pairs are (detection, reference, shared area); sorted as the overlay gives them."""
    pairs = sorted(pairs)
    columns = [np.array([pair[k] for pair in pairs], dtype=np.int64) for k in (0, 1)]
    area = np.array([pair[2] for pair in pairs], dtype=np.float64)
    return Overlaps(*columns, area, np.ones(len(pairs), dtype=bool))


def matched(pairs, distances, counts, matching="nearest"):
    """`distances` by (detection, reference)."""
    overlaps = overlaps_of(pairs)
    found = [distances[pair] for pair in zip(overlaps.first.tolist(), overlaps.second.tolist(), strict=True)]
    return match(overlaps, np.array(found, dtype=np.float64), counts, matching=matching)


def test_a_chain_by_hand():
    # d0 - r0 - d1 - r1: d1 is nearest to r0 (1 m), so d0 is left over, and r1 is missed.
    pairs = [(0, 0, 9.0), (1, 0, 5.0), (1, 1, 8.0)]
    distances = {(0, 0): 2.0, (1, 0): 1.0, (1, 1): 3.0}
    found = matched(pairs, distances, (2, 2))
    assert found.of_detection.tolist() == [-1, 0]
    assert found.of_reference.tolist() == [1, -1]
    assert found.assigned_to.tolist() == [0, 0]
    assert [rows.tolist() for rows in found.pairs] == [[1], [0]]
    by_area = matched(pairs, distances, (2, 2), "overlap")
    assert by_area.of_detection.tolist() == [0, 1]


def test_one_pass_lets_each_detection_claim_once():
    # Both detections are nearest to r0; d1 overlaps r1, too, and would be free to take it.
    pairs = [(0, 0, 5.0), (1, 0, 5.0), (1, 1, 5.0)]
    distances = {(0, 0): 1.0, (1, 0): 2.0, (1, 1): 3.0}
    assert matched(pairs, distances, (2, 2), "one-pass").of_reference.tolist() == [0, -1]
    assert matched(pairs, distances, (2, 2), "nearest").of_reference.tolist() == [0, 1]


def test_ties_go_to_the_larger_overlap_then_to_the_lower_reference_then_to_the_lower_detection():
    same = dict.fromkeys(itertools.product(range(2), range(2)), 1.0)
    assert matched([(0, 0, 4.0), (1, 0, 5.0)], same, (2, 1)).of_reference.tolist() == [1]
    assert matched([(0, 0, 4.0), (0, 1, 4.0)], same, (1, 2)).of_detection.tolist() == [0]
    assert matched([(0, 0, 4.0), (1, 0, 4.0)], same, (2, 1)).of_reference.tolist() == [0]


def test_distances_that_differ_by_less_than_a_micrometre_are_ties():
    distances = {(0, 0): 1.0 + 4e-8, (1, 0): 1.0}
    assert matched([(0, 0, 5.0), (1, 0, 4.0)], distances, (2, 1)).of_reference.tolist() == [0]


@pytest.mark.parametrize("matching", MATCHINGS)
def test_without_overlaps_no_object_has_a_partner(matching):
    found = matched([], {}, (2, 3), matching)
    assert (found.of_detection.tolist(), found.of_reference.tolist()) == ([-1, -1], [-1, -1, -1])
    assert found.assigned_to.tolist() == [-1, -1]


@given(st.data(), st.sampled_from(MATCHINGS))
def test_partners_are_mutual_overlap_and_are_the_same_as_by_a_plain_loop(data, matching):
    counts = data.draw(st.integers(1, 6)), data.draw(st.integers(1, 6))
    every = list(itertools.product(range(counts[0]), range(counts[1])))
    chosen = data.draw(st.lists(st.sampled_from(every), unique=True))
    pairs = [(d, r, float(data.draw(st.integers(1, 4)))) for d, r in chosen]
    distances = {pair: float(data.draw(st.integers(0, 3))) for pair in chosen}
    found = matched(pairs, distances, counts, matching)
    area = {(d, r): shared for d, r, shared in pairs}
    by_distance = sorted(chosen, key=lambda pair: (distances[pair], -area[pair], pair[1], pair[0]))
    nearest = {}
    for d, r in by_distance:
        nearest.setdefault(d, r)
    order = by_distance
    if matching == "one-pass":
        order = [pair for pair in by_distance if nearest[pair[0]] == pair[1]]
    if matching == "overlap":
        order = sorted(chosen, key=lambda pair: (-area[pair], distances[pair], pair[1], pair[0]))
    partner = {}
    for d, r in order:
        if d not in partner and r not in partner.values():
            partner[d] = r
    assert found.of_detection.tolist() == [partner.get(d, -1) for d in range(counts[0])]
    assert found.assigned_to.tolist() == [nearest.get(d, -1) for d in range(counts[0])]
    for d, r in enumerate(found.of_detection.tolist()):
        assert r < 0 or found.of_reference[r] == d
