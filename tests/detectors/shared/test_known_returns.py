"""Return numbers that say nothing in a part of a cloud are unknown there, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

import roofbench as rb
from roofbench.detectors.shared.known_returns import known_returns
from roofbench.scenes.builtin import hamlet


@pytest.fixture(scope="module")
def scene():
    return rb.make_scene("vaihingen-a-small", seed=1)


def numbered(points, chosen, number, **columns):
    """Return points with number and number of returns replaced where chosen."""
    new = {
        name: np.where(chosen, np.uint8(number), getattr(points, name))
        for name in ("return_number", "number_of_returns")
    }
    return replace(points, **new, **columns)


def west_of(scene):
    return scene.points.x < (scene.extent[0] + scene.extent[2]) / 2


def detected(scene, points, detector):
    place = rb.Scene(scene.name, scene.extent, points=points, dem=scene.dem, reference=scene.reference, crs=scene.crs)
    found = rb.detect(place, detector)
    return found, rb.evaluate(found, scene.reference).pixel.quality


def test_numbers_of_an_ordinary_cloud_are_known_everywhere(scene):
    for points in (scene.points, hamlet(1).points, rb.open_scene("delft").points):
        extent = points.x.min(), points.y.min(), points.x.max(), points.y.max()
        found = known_returns(points, extent)
        assert found.points is points
        assert found.notes == ()


@pytest.mark.parametrize("number", [1, 2])
def test_numbers_are_unknown_in_the_half_that_has_the_same_ones_everywhere(scene, number):
    west = west_of(scene)
    given = numbered(scene.points, west, number)
    found = known_returns(given, scene.extent)
    silent = found.points.number_of_returns == 0
    # Up to a block at the border.
    far = abs(scene.points.x - (scene.extent[0] + scene.extent[2]) / 2) > 16
    assert (silent[far] == west[far]).mean() > 0.97
    assert found.unknown == pytest.approx(silent.mean())
    assert f"not used of about {round(10 * silent.mean())}0% of the points" in found.notes[0]
    assert (found.points.return_number[silent] == 0).all()
    assert (found.points.return_number[~silent] == given.return_number[~silent]).all()


@pytest.mark.parametrize("number", [1, 2])
def test_a_strip_without_numbers_of_its_own_is_unknown_where_it_overlaps_others(scene, number):
    other = np.random.default_rng(0).random(len(scene.points)) < 0.5
    points = numbered(scene.points, other, number, source=7 + other.astype(np.uint16))
    found = known_returns(points, scene.extent)
    assert ((found.points.number_of_returns == 0) == other).all()


def test_a_cloud_whose_numbers_say_nothing_anywhere_is_left_to_the_tests_of_cues(scene):
    everywhere = np.ones(len(scene.points), dtype=bool)
    for number in (1, 2):
        points = numbered(scene.points, everywhere, number)
        assert known_returns(points, scene.extent).points is points


def test_numbers_of_zero_are_unknown_without_a_note(scene):
    points = numbered(scene.points, west_of(scene), 0)
    found = known_returns(points, scene.extent)
    assert found.points is points
    assert found.notes == ()


@pytest.mark.parametrize("detector", ["ndsm", "dempster-shafer", "mpp"])
@pytest.mark.parametrize("number", [0, 1, 2])
def test_detectors_lose_little_where_half_of_the_numbers_say_nothing(scene, detector, number):
    _, best = detected(scene, scene.points, detector)
    found, quality = detected(scene, numbered(scene.points, west_of(scene), number), detector)
    assert quality > best - 0.05
    assert any("return numbers" in note for note in found.metadata["notes"]) == (number > 0)
