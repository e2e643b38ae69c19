"""Cues that say the same of roofs and trees are left out."""

import numpy as np
import pytest

from roofbench.detectors.shared.cue_information import ANCHOR, informative_cues

SHAPE = (30, 40)
TREES = np.arange(40)[None, :] >= np.full(SHAPE, 25)
HIGH = np.ones(SHAPE, dtype=bool)


def rating(roofs, trees, *, noise=0.3, seed=0):
    values = np.where(TREES, trees, roofs) + np.random.default_rng(seed).normal(0, noise, SHAPE)
    return np.clip(values, -1, 1).astype(np.float32)


def test_cues_that_agree_are_all_used():
    ratings = {"multiple returns": rating(-0.9, 0.2), ANCHOR: rating(-0.6, 0.7), "penetration": rating(-0.8, -0.1)}
    found = informative_cues(ratings, HIGH)
    assert found.used == tuple(ratings)
    assert not found.silent
    assert not found.notes


@pytest.mark.parametrize("level", [-1.0, -0.5, 0.0, 1.0])
def test_a_cue_that_says_one_thing_everywhere_is_silent(level):
    ratings = {"multiple returns": rating(level, level, noise=0.01), ANCHOR: rating(-0.6, 0.7)}
    found = informative_cues(ratings, HIGH)
    assert found.used == (ANCHOR,)
    assert "multiple returns" in found.notes[0]


def test_a_cue_that_contradicts_the_others_is_silent():
    ratings = {ANCHOR: rating(-0.6, 0.7), "penetration": rating(-0.8, 0.2), "image vegetation": rating(0.8, -0.5)}
    assert informative_cues(ratings, HIGH).used == (ANCHOR, "penetration")


@pytest.mark.parametrize(("roofs", "trees", "used"), [(-0.5, 0.6, True), (-0.2, -0.3, True), (0.6, -0.6, False)])
def test_a_cue_that_knows_more_is_silent_only_where_it_says_the_opposite(roofs, trees, used):
    ratings = {ANCHOR: rating(-0.6, 0.7), "pulse difference": rating(-0.8, 0.5), "vegetation": rating(roofs, trees)}
    found = informative_cues(ratings, HIGH, independent=("vegetation",))
    assert ("vegetation" in found.used) == used
    assert {ANCHOR, "pulse difference"} <= set(found.used)
    assert used or "says the opposite of the other cues" in found.silent["vegetation"]


def test_a_constant_cue_does_not_spoil_the_test_of_the_others():
    ratings = {"multiple returns": rating(1, 1, noise=0), ANCHOR: rating(-0.6, 0.7), "penetration": rating(-0.8, 0.2)}
    assert informative_cues(ratings, HIGH).used == (ANCHOR, "penetration")


def test_without_trees_a_cue_is_used_unless_it_takes_the_roofs_for_trees():
    ratings = {"multiple returns": rating(0.8, 0.8), ANCHOR: rating(-0.8, -0.8), "penetration": rating(-0.8, -0.8)}
    assert informative_cues(ratings, HIGH).used == (ANCHOR, "penetration")


def test_a_cue_without_values_is_silent_and_nothing_high_silences_nothing_else():
    ratings = {ANCHOR: rating(-0.6, 0.7), "image vegetation": np.full(SHAPE, np.nan, dtype=np.float32)}
    found = informative_cues(ratings, HIGH)
    assert found.used == (ANCHOR,)
    assert "not known of any high cell" in found.silent["image vegetation"]
    assert informative_cues({}, HIGH).used == ()
    assert informative_cues(ratings, ~HIGH).used == ()


def test_cells_that_are_not_high_do_not_count():
    ratings = {"penetration": rating(-0.5, -0.5, noise=0.01), ANCHOR: rating(-0.6, 0.7)}
    ratings["penetration"][:, :8] = 1.0
    high = HIGH.copy()
    high[:, :8] = False
    assert informative_cues(ratings, high).used == (ANCHOR,)


def test_penetration_that_says_of_crowns_what_it_says_of_roofs_is_silent():
    """First returns of dense crowns have as few points below them as roofs have."""
    ratings = {"penetration": rating(-0.9, -0.8), ANCHOR: rating(-0.6, 0.7)}
    found = informative_cues(ratings, HIGH)
    assert found.used == (ANCHOR,)
    assert "does not separate" in found.silent["penetration"]


def test_a_cue_that_cannot_know_is_silent_with_its_reason():
    ratings = {ANCHOR: rating(-0.6, 0.7), "penetration": rating(-0.8, 0.2)}
    found = informative_cues(ratings, HIGH, known_silent={"penetration": "it is a raster"})
    assert found.used == (ANCHOR,)
    assert found.silent == {"penetration": "it is a raster"}
