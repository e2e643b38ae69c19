"""The ground filter says where it is unsure."""

import numpy as np

from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid
from roofbench.scenes.ground.doubt import Doubt, doubtful_ground
from roofbench.scenes.ground.filter import filtered_ground
from roofbench.scenes.ground.heights import heights_of

GRID = Grid(0.0, 200.0, 1.0, 200, 200)
ALL = np.ones(GRID.shape, dtype=bool)


NONE = ~ALL


def doubts(values, seen=ALL, covered=ALL, low=NONE):
    return doubtful_ground(Elevation(values.astype(np.float32), GRID), seen, covered, low).cells


def test_the_middle_of_a_hall_is_doubtful_unless_the_ground_around_it_is_a_plane():
    seen = ALL.copy()
    seen[50:150, 10:190] = False
    row, column = np.indices(GRID.shape)
    rolling = 3 * np.sin(row / 20) * np.cos(column / 25)
    found = doubts(rolling, seen)
    assert found[100, 100]
    assert not found[55, 100]
    assert not found[seen].any()
    assert not doubts(rolling, seen, seen).any()
    assert not doubts(0.1 * row - 0.05 * column, seen).any()
    # Where the border cuts it, the ground goes on unseen.
    seen[50:, 10:190] = False
    assert doubts(0.1 * row, seen)[150, 100]


def test_hardly_any_ground_points_are_a_doubt_and_a_street_in_ten_metres_is_none():
    row, column = np.indices(GRID.shape)
    hills = 5 * np.sin(row / 15)
    assert doubts(hills, (row % 20 == 0) & (column % 20 == 0)).mean() > 0.95
    assert not doubts(hills, row % 10 == 0).any()


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
    # Its end lies beyond the border of the scene.
    hall = (x > 20) & (abs(y - 120) < 55)
    points = PointCloud(x.ravel(), y.ravel(), np.where(hall, 12.0, 0.0).ravel())
    heights = heights_of(points, None, (0, 0, 240, 240))
    assert "the filtered ground is uncertain on" in heights.notes[1]
    assert heights.doubtful.sample(np.array([150.0, 5.0]), np.array([120.0, 5.0])).tolist() == [1, 0]
    plain = heights_of(points.take(~hall.ravel()), None, (0, 0, 240, 240))
    assert len(plain.notes) == 1
    assert plain.doubtful.values.sum() == 0


def test_a_gap_in_a_ring_of_steps_does_not_make_the_land_around_it_doubtful():
    row, column = np.indices(GRID.shape)
    part = (abs(row - 100) < 60) & (abs(column - 100) < 70)
    # A ramp of 12 m width joins the part to the land around it.
    ramp = (abs(row - 100) < 6) & (column >= 170)
    values = np.where(part, 9.0, np.where(ramp, np.clip(9.0 - 0.35 * (column - 170), 0, 9), 0.0))
    found = doubts(values)
    assert not found[~part & ~ramp].any()


def test_land_between_canals_is_no_doubt():
    row, column = np.indices(GRID.shape)
    canals = (abs(row - 100) < 6) | (abs(column - 90) < 7)
    assert not doubts(np.where(canals, 0.8, 3.0)).any()


def walled_terrace(height):
    y, x = np.mgrid[:240, :240] + 0.5
    land = 5 + np.where((abs(x - 120) < 40) & (abs(y - 120) < 30), height, 0.0)
    house = (abs(x - 30) < 6) & (abs(y - 40) < 5)
    points = PointCloud(x.ravel(), y.ravel(), np.where(house, 13.0, land).ravel())
    return filtered_ground(points, (0, 0, 240, 240))


def test_a_low_wide_part_that_was_taken_off_is_named_as_a_possible_terrace_and_a_high_hall_is_not():
    ground, doubt = walled_terrace(4.0)
    assert ground.sample(120.0, 120.0) < 5.5
    area, rest = doubt.note().split(": ", 1)[1].split(" m2 around ")
    place, reason = rest.split(" (")
    assert 4600 < float(area.replace(",", "")) < 4900
    assert np.all(np.abs(np.array(place.split(), dtype=float) - 120) < [40, 30])
    assert reason.startswith("taken off as a wide low building: may be a terrace)")
    assert doubt.cells.mean() < 0.1
    ground, doubt = walled_terrace(8.0)
    assert ground.sample(120.0, 120.0) < 5.5
    assert doubt.note() is None


def test_a_closed_forest_is_doubtful():
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:300, :300] + 0.5
    land = 0.15 * x
    forest = y > 130
    surface = land + np.where(forest, 18 + 4 * np.sin(x / 3.1) * np.sin(y / 2.7) + rng.normal(0, 0.5, x.shape), 0.0)
    ground, doubt = filtered_ground(PointCloud(x.ravel(), y.ravel(), surface.ravel()), (0, 0, 300, 300))
    wrong = np.abs(ground.sample(x.ravel(), y.ravel()) - land.ravel()) > 2
    doubtful = Elevation(doubt.cells.astype(np.float32), doubt.grid).sample(x.ravel(), y.ravel()) > 0.5
    assert wrong.mean() > 0.3
    assert doubtful[wrong].mean() > 0.5
    assert doubtful[~wrong].mean() < 0.1


def test_the_note_names_the_largest_places_and_the_remedy():
    cells = NONE.copy()
    cells[20:60, 30:70] = True
    cells[100:110, 100:110] = cells[150:170, 150:170] = cells[190:195, 10:15] = True
    note = Doubt(GRID, {"because": cells, "never": NONE}).note()
    assert note.startswith("the filtered ground is uncertain on 5.3% of the scene: 1,600 m2 around ")
    assert "400 m2 around 1" in note
    assert note.count("because") == 3
    assert "and elsewhere" in note
    assert note.endswith("give a terrain model as DEM")
    x, y = map(int, note.split(" around ")[1].split(" (")[0].split())
    row, column = (int(value) for value in GRID.to_pixel(x, y))
    assert cells[20:60, 30:70].all()
    assert 20 <= row < 60
    assert 30 <= column < 70


def test_where_a_terrain_model_is_known_there_is_no_doubt():
    y, x = np.mgrid[:240, :240] + 0.5
    terrace = (abs(x - 120) < 40) & (abs(y - 120) < 30)
    points = PointCloud(x.ravel(), y.ravel(), np.where(terrace, 9.0, 5.0).ravel())
    for west, doubtful in ((0, False), (140, True)):
        values = np.full((240, 240), 5.0, dtype=np.float32)
        values[:, west : west + 10] = np.nan
        values[:, west:] = np.nan if west else values[:, west:]
        heights = heights_of(points, Elevation(values, Grid(0.0, 240.0, 1.0, 240, 240)), (0, 0, 240, 240))
        assert (len(heights.notes) == 2) is doubtful
        assert heights.doubtful.sample(np.array([150.0, 100.0]), np.array([120.0, 120.0])).tolist() == [doubtful, 0]


def test_next_to_nothing_is_no_note():
    assert Doubt(GRID, {"because": NONE}).note() is None
    empty = Grid(0.0, 0.0, 1.0, 0, 0)
    assert Doubt(empty, {"because": np.zeros((0, 0), dtype=bool)}).note() is None
