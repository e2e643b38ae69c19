"""The ground filter says where it is unsure."""

import numpy as np

from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid
from roofbench.scenes.ground.doubt import doubt_note, doubtful_ground
from roofbench.scenes.ground.heights import heights_of

GRID = Grid(0.0, 200.0, 1.0, 200, 200)
ALL = np.ones(GRID.shape, dtype=bool)


def doubts(values, seen=ALL, covered=ALL):
    return doubtful_ground(Elevation(values.astype(np.float32), GRID), seen, covered)


def test_the_middle_of_a_hall_is_far_from_any_ground_point():
    seen = ALL.copy()
    seen[50:150, 10:190] = False
    found = doubts(np.zeros(GRID.shape), seen)
    assert found[100, 100]
    assert not found[60, 100]
    assert not found[seen].any()
    assert not doubts(np.zeros(GRID.shape), seen, seen).any()


def test_a_raised_part_is_doubtful_and_slopes_pits_and_terraces_are_not():
    row, column = np.indices(GRID.shape)
    part = (abs(row - 100) < 30) & (abs(column - 100) < 40)
    found = doubts(np.where(part, 12.0, 0.0))
    assert found[part].mean() > 0.8
    assert not found[~part].any()
    assert not doubts(0.8 * column).any()
    assert not doubts(np.where(part, -12.0, 0.0)).any()
    assert not doubts(np.where(row > 100, 12.0, 0.0)).any()


def test_a_part_that_the_border_cuts_is_doubtful_and_the_upper_side_of_a_cliff_is_not():
    row, column = np.indices(GRID.shape)
    for part in ((row < 120) & (column < 130), (row > 90) & (abs(column - 100) < 60)):
        found = doubts(np.where(part, 12.0, 0.0))
        assert found[part].mean() > 0.9
        assert not found[~part].any()
        assert not doubts(np.where(part, -12.0, 0.0)).any()
    for edge in (60, 140):
        assert not doubts(np.where(row < edge + 8 * np.sin(column / 20), 12.0, 0.0)).any()


def test_a_scene_without_a_dem_notes_the_doubtful_share_and_keeps_the_map():
    y, x = np.mgrid[:240, :240] + 0.5
    hall = (abs(x - 120) < 100) & (abs(y - 120) < 55)
    points = PointCloud(x.ravel(), y.ravel(), np.where(hall, 12.0, 0.0).ravel())
    heights = heights_of(points, None, (0, 0, 240, 240))
    assert "the filtered ground is uncertain on" in heights.notes[1]
    assert heights.doubtful.sample(np.array([120.0, 5.0]), np.array([120.0, 5.0])).tolist() == [1, 0]
    plain = heights_of(points.take(~hall.ravel()), None, (0, 0, 240, 240))
    assert len(plain.notes) == 1
    assert plain.doubtful.values.sum() == 0


def test_next_to_nothing_is_no_note():
    assert doubt_note(np.zeros((10, 10), dtype=bool)) is None
    assert doubt_note(np.zeros((0, 0), dtype=bool)) is None
    assert doubt_note(ALL).startswith("the filtered ground is uncertain on 100.0% of the scene")
