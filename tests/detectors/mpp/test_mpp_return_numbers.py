"""Numbers of returns that do not describe the surface are not read."""

import numpy as np

from roofbench.detectors.mpp.return_numbers import MULTIPLE, cues_of
from roofbench.detectors.mpp.textures import OPENNESS_BINS, ROUGHNESS_BINS
from roofbench.detectors.shared.cue_information import PENETRATION
from roofbench.scenes.geodata.points import PointCloud

SMOOTH, ROUGH = 5 * OPENNESS_BINS, 18 * OPENNESS_BINS
CLOSED, OPEN = 0, OPENNESS_BINS - 1


def points(numbers):
    none = np.zeros(0 if numbers is None else len(numbers))
    return PointCloud(none, none, none, number_of_returns=None if numbers is None else np.array(numbers, np.uint8))


def counts(*parts):
    found = np.zeros(OPENNESS_BINS * ROUGHNESS_BINS, dtype=np.int64)
    for number, count in parts:
        found[number] += count
    return found


def test_roofs_that_return_once_and_trees_that_do_not_make_the_cue_used():
    found = cues_of(points([1, 2]), counts((SMOOTH + CLOSED, 300), (SMOOTH + OPEN, 60), (ROUGH + OPEN, 500)))
    assert MULTIPLE in found.used
    assert not found.notes


def test_two_returns_of_every_pulse_are_not_read():
    found = cues_of(points([2, 2]), counts((SMOOTH + OPEN, 300), (ROUGH + OPEN, 500)))
    assert MULTIPLE not in found.used
    assert "100% of the smooth surfaces" in found.notes[0]


def test_a_wood_without_smooth_surfaces_proves_nothing():
    assert MULTIPLE in cues_of(points([1, 2]), counts((SMOOTH + OPEN, 30), (ROUGH + OPEN, 5000))).used


def test_cells_of_a_raster_do_not_show_what_is_below_a_crown():
    x, y = (values.ravel() for values in np.meshgrid(np.arange(0.25, 20, 0.5), np.arange(0.25, 20, 0.5)))
    raster, scattered = PointCloud(x, y, 0 * x), PointCloud(x + 0.1 * np.sin(y), y, 0 * x)
    found = cues_of(raster, counts((SMOOTH, 300)))
    assert PENETRATION not in found.used
    assert "raster" in found.notes[0]
    assert PENETRATION in cues_of(scattered, counts((SMOOTH, 300))).used


def test_points_without_multiple_returns_do_not_hold_the_cue():
    for numbers in (None, [1, 1], [0, 0], []):
        assert MULTIPLE not in cues_of(points(numbers), counts((SMOOTH, 300))).used
