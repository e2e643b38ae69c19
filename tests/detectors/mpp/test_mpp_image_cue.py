"""The image separates roofs from crowns where the points do not record returns, and is silent where it does not."""

from dataclasses import replace

import numpy as np
import pytest

import roofbench as rb
from roofbench.detectors.mpp.cells import HIGH, LOW
from roofbench.detectors.mpp.image_cue import add_image, image_silence, rate_image, tally_image
from roofbench.detectors.shared.cue_information import IMAGE
from roofbench.scenes.geodata.raster import Grid, Image

GRID = Grid(0.0, 10.0, 0.5, 20, 20)
#: Roof in the west, crown in the east.
SCORE = np.where(np.arange(20) < 10, 2000, -1500).astype(np.int16) * np.ones((20, 1), np.int16)
STATE = np.full(GRID.shape, HIGH)


def image(west, east, bands=("red", "green", "blue")):
    values = np.empty((len(bands), *GRID.shape), np.uint8)
    values[:, :, :10], values[:, :, 10:] = np.array(west)[:, None, None], np.array(east)[:, None, None]
    return Image(values, bands, GRID)


def test_green_crowns_get_less_and_red_roofs_more():
    ratings = rate_image(image((180, 90, 80), (60, 120, 60)), GRID)
    np.testing.assert_array_equal(ratings, np.where(SCORE > 0, -1, 1))
    tally = tally_image(ratings, STATE, SCORE)
    assert tally.tolist() == [200, 200_000, 200, -200_000]
    assert image_silence(tally) is None
    np.testing.assert_array_equal(add_image(SCORE, STATE, ratings, 2.0), np.where(SCORE > 0, 3000, -2500))


def test_colours_that_say_the_same_of_both_are_silent():
    for colour in ((180, 90, 80), (60, 120, 60)):
        ratings = rate_image(image(colour, colour), GRID)
        assert "separation 0.00 of 2" in image_silence(tally_image(ratings, STATE, SCORE))


def test_an_image_without_colours_and_shadow_say_nothing():
    assert rate_image(None, GRID) is None
    assert rate_image(Image(np.full((1, *GRID.shape), 99, np.uint8), ("grey",), GRID), GRID) is None
    dark = rate_image(image((20, 10, 10), (5, 20, 5)), GRID)
    assert np.isnan(dark).all()
    np.testing.assert_array_equal(add_image(SCORE, STATE, dark, 1.0), SCORE)
    assert image_silence(tally_image(dark, STATE, SCORE)) == "it is not known of any high cell"


def test_low_cells_keep_their_score_and_tallies_of_parts_add_up():
    rng = np.random.default_rng(0)
    state = rng.choice([HIGH, LOW], GRID.shape)
    ratings = rng.uniform(-1, 1, GRID.shape).astype(np.float32)
    changed = add_image(SCORE, state, ratings, 1.0) != SCORE
    assert not changed[state == LOW].any()
    assert changed[state == HIGH].any()
    parts = [tally_image(ratings[rows], state[rows], SCORE[rows]) for rows in (slice(0, 7), slice(7, 20))]
    np.testing.assert_array_equal(np.sum(parts, axis=0), tally_image(ratings, state, SCORE))


@pytest.mark.parametrize("numbers", [True, False])
def test_the_detector_says_whether_it_read_the_image(numbers):
    scene = rb.make_scene("vaihingen-b-small", seed=1)
    points = scene.points if numbers else replace(scene.points, number_of_returns=None)
    seen = rb.Scene(scene.name, scene.extent, crs=scene.crs, points=points, image=scene.image, dem=scene.dem)
    used = rb.detect(seen, "mpp", seed=0).metadata["cues"]
    assert (IMAGE in used) != numbers
    assert ("multiple returns" in used) == numbers
