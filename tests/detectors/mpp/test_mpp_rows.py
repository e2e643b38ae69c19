"""Rows of houses: party walls in profiles, and parts, buildings and blocks."""

import math
import warnings

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from roofbench.detectors.mpp.cells import HIGH, LOW
from roofbench.detectors.mpp.party_walls import (
    CERTAIN,
    PROBABLE,
    colour_strength,
    most_walls,
    party_walls,
    profile_of,
    wall_strength,
)
from roofbench.detectors.mpp.profiles import line_medians
from roofbench.detectors.mpp.rectangles import to_world
from roofbench.detectors.mpp.rows import find_levels
from roofbench.detectors.mpp.wall_marks import colour_marks, roof_marks
from roofbench.scenes.geodata.raster import Grid, Image

GRID = Grid(1000.0, 2000.0, 0.5, 160, 260)


def place(*roofs):
    """Heights (cm) and states of cells with roofs, each (left, top, right, bottom) in metres and a height function."""
    height = np.zeros((GRID.rows, GRID.columns), dtype=np.uint16)
    state = np.full((GRID.rows, GRID.columns), LOW, dtype=np.uint8)
    y, x = (np.mgrid[: GRID.rows, : GRID.columns] + 0.5) * GRID.gsd
    for (left, top, right, bottom), roof in roofs:
        inside = (x >= left) & (x < right) & (y >= top) & (y < bottom)
        height[inside] = np.round(100 * np.broadcast_to(roof(x, y), x.shape)[inside])
        state[inside] = HIGH
    return height, state


def rectangle(left, top, right, bottom):
    return np.array([left + right, top + bottom, 2 * (right - left), 2 * (bottom - top), 0.0])


def gables(width, start):
    """Gables that face the street: the ridge of each house runs across the row."""
    return lambda x, y: 9.0 - np.abs((x - start) % width - width / 2)


def steps(width, start, rise):
    return lambda x, y: 7.0 + rise * (((x - start) // width) % 2)


def flat(x, y):
    return 8.0


def walls_at(roof, sides, rule=CERTAIN):
    found = party_walls(profile_of(rectangle(*sides), *place((sides, roof)), GRID), rule, GRID)
    return [wall.point[0] * GRID.gsd for wall in found]


@pytest.mark.parametrize("roof", [gables(6.0, 10.0), steps(6.0, 10.0, 0.5)], ids=["valleys", "steps"])
def test_walls_between_equal_houses_are_found(roof):
    found = walls_at(roof, (10, 10, 46, 20))
    assert len(found) == 5
    np.testing.assert_allclose(found, [16, 22, 28, 34, 40], atol=0.5)


def test_low_steps_are_probable_but_not_certain():
    roof = steps(6.0, 10.0, 0.18)
    assert walls_at(roof, (10, 10, 46, 20)) == []
    assert len(walls_at(roof, (10, 10, 46, 20), PROBABLE)) == 5


@pytest.mark.parametrize(
    ("roof", "sides"),
    [
        (flat, (10, 10, 60, 20)),  # a hall
        (steps(25.0, 10.0, 1.0), (10, 10, 110, 22)),  # four large buildings, too wide for houses
        (gables(6.0, 10.0), (10, 10, 46, 12)),  # too shallow
        (gables(3.0, 10.0), (10, 10, 17, 20)),  # too short for two houses
        (lambda x, y: 9 - np.abs(y - 15), (10, 10, 60, 20)),  # one ridge along all of it
    ],
    ids=["flat", "wide", "shallow", "short", "ridge"],
)
def test_what_is_no_row_has_no_walls(roof, sides):
    assert walls_at(roof, sides) == []


@given(st.floats(3, 60), st.floats(3, 20), st.integers(0, 2**32 - 1))
def test_no_more_walls_are_found_than_there_is_room_for(length, depth, seed):
    ups = np.random.default_rng(seed).uniform(0, 4, 400)
    sides = (10, 10, 10 + length, 10 + depth)
    height, state = place((sides, lambda x, y: 6 + ups[np.clip((2 * x).astype(int), 0, 399)]))
    one = rectangle(*sides)
    assert len(party_walls(profile_of(one, height, state, GRID), PROBABLE, GRID)) <= most_walls(one, GRID)[0]


def test_walls_turn_with_the_row():
    height, state = place(((0, 0, 130, 80), lambda x, y: 9.0 - np.abs((u(x, y)) % 6.0 - 3.0)))
    row = np.array([130.0, 80.0, 72.0, 20.0, math.radians(30)])
    found = party_walls(profile_of(row, height, state, GRID), CERTAIN, GRID)
    assert len(found) == 5
    for wall in found:
        np.testing.assert_allclose(np.abs(wall.along), [0.5, math.sqrt(0.75)], atol=1e-12)


def test_walls_do_not_depend_on_the_cell_that_a_window_begins_with():
    """Sides of n + 1/2 cells end on a station, where rounding of the corners would decide."""
    rng = np.random.default_rng(1)
    count, size, far = 150, 140, 2000
    sides = np.column_stack([rng.integers(18, 110, count), rng.integers(14, 40, count)]) + 0.5
    turned = np.column_stack([rng.uniform(60, 80, (count, 2)), sides, rng.uniform(0, np.pi, count)])
    height = rng.integers(300, 500, (size, size)).astype(np.uint16).repeat(4, axis=0)[:size]
    state = np.full((size, size), HIGH, np.uint8)
    rows, columns = far, far - 7
    around = Grid(GRID.west - columns * GRID.gsd, GRID.north + rows * GRID.gsd, GRID.gsd, size + rows, size + columns)
    padded = [np.pad(cells, ((rows, 0), (columns, 0))) for cells in (height, state)]
    for one in turned:
        moved = one + np.array([columns, rows, 0, 0, 0])
        here = party_walls(profile_of(one, height, state, GRID), PROBABLE, GRID)
        there = party_walls(profile_of(moved, *padded, around), PROBABLE, around)
        assert len(here) == len(there)
        for wall, same in zip(here, there, strict=True):
            assert np.allclose(wall.point + np.array([columns, rows]), same.point, atol=1e-6)


def u(x, y):
    """Metres along a row at 30 degrees through (65, 40)."""
    return (x - 65) * math.cos(math.radians(30)) + (y - 40) * math.sin(math.radians(30)) + 18


def test_a_slope_along_the_row_is_no_step():
    stations = np.arange(40)[:, None] * np.ones((1, 12))
    slope = 6 + 0.1 * stations
    assert wall_strength(roof_marks(slope), PROBABLE).max() < 1e-9
    stepped = wall_strength(roof_marks(slope + np.where(stations < 20, 0, 0.5)), PROBABLE)
    assert stepped.argmax() == 20
    assert stepped[20] >= 0.5


def slow_strength(profile, rule):
    """The definition of a wall's strength, station by station and line by line."""

    def mean(values):
        known = [value for value in values if not math.isnan(value)]
        return sum(known) / len(known) if known else math.nan

    def median(values):
        known = [value for value in values if not math.isnan(value)]
        return float(np.median(known)) if known else 0.0

    stations, lines = profile.shape
    strength = np.zeros(stations)
    for i in range(stations):
        jumps, valleys = [], []
        for k in range(lines):
            jump = valley = math.nan
            if i >= 2 and i + 2 <= stations:
                before, behind = mean(profile[i - 2 : i, k]), mean(profile[i : i + 2, k])
                earlier = mean(profile[i - 4 : i - 2, k]) if i >= 4 else math.nan
                later = mean(profile[i + 2 : i + 4, k]) if i + 4 <= stations else math.nan
                rises = [rise for rise in (before - earlier, later - behind) if not math.isnan(rise)]
                jump = behind - before - (sum(rises) / len(rises) if rises else 0.0)
            if i >= 4 and i + 4 <= stations:
                lows = [value for value in profile[i - 1 : i + 1, k] if not math.isnan(value)]
                shoulders = (mean(profile[i - 4 : i - 2, k]) + mean(profile[i + 2 : i + 4, k])) / 2
                valley = shoulders - min(lows) if lows else math.nan
            jumps.append(jump)
            valleys.append(valley)
        known = [value for value in jumps if not math.isnan(value)]
        middle = median(jumps)
        agree = sum(np.sign(value) == np.sign(middle) and abs(value) > 0.12 for value in known)
        if len(known) >= 0.6 * lines and known and agree >= rule.step_share * len(known) and abs(middle) >= rule.step:
            strength[i] += abs(middle)
        known = [value for value in valleys if not math.isnan(value)]
        middle = median(valleys)
        deep = sum(value > 0.25 for value in known)
        if len(known) >= 0.5 * lines and known and deep >= rule.valley_share * len(known) and middle >= rule.valley:
            strength[i] += middle
    return strength


@given(st.integers(0, 2**32 - 1), st.integers(8, 30), st.integers(1, 9), st.sampled_from([CERTAIN, PROBABLE]))
def test_the_strength_of_walls_is_that_of_plain_loops(seed, stations, lines, rule):
    rng = np.random.default_rng(seed)
    profile = 8 + rng.normal(0, 0.1, (stations, lines)) + rng.choice([0, 0.4, 1.0], stations)[:, None]
    profile[rng.random(profile.shape) < rng.choice([0, 0.2, 0.6])] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        expected = slow_strength(profile, rule)
    marks = roof_marks(profile)
    found = np.zeros(stations) if marks is None else wall_strength(marks, rule)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def slow_colours(shares, rule):
    """The definition of a colour edge, station by station and line by line."""
    _, stations, lines = shares.shape
    strength = np.zeros(stations)
    for i in range(3, stations - 2):
        edges = [[np.nanmean(s[i : i + 3, k]) - np.nanmean(s[i - 3 : i, k]) for s in shares] for k in range(lines)]
        edges = np.array(edges)
        middle = [np.nanmedian(column) if np.isfinite(column).any() else 0.0 for column in edges.T]
        size = math.hypot(*middle)
        known = [edge for edge in edges if np.isfinite(edge).all()]
        agree = sum(np.dot(edge, middle) > 0.5 * rule.colour * size for edge in known)
        if known and len(known) >= 0.5 * lines and agree >= rule.colour_share * len(known) and size >= rule.colour:
            strength[i] = 20 * size
    return strength


@given(st.integers(0, 2**32 - 1), st.integers(3, 30), st.integers(1, 9), st.sampled_from([CERTAIN, PROBABLE]))
def test_the_strength_of_colour_edges_is_that_of_plain_loops(seed, stations, lines, rule):
    rng = np.random.default_rng(seed)
    shares = 0.33 + rng.normal(0, 0.005, (2, stations, lines)) + rng.choice([0, 0.02, 0.08], (2, stations, 1))
    shares[:, rng.random((stations, lines)) < rng.choice([0, 0.2, 0.6])] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        expected = slow_colours(shares, rule)
    marks = colour_marks(shares)
    found = np.zeros(stations) if marks is None else colour_strength(marks, rule)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def levels(roofs, rectangles):
    height, state = place(*roofs)
    rectangles = np.array(rectangles)
    outlines = shapely.polygons(to_world(rectangles, GRID))
    blocks = shapely.get_parts(shapely.union_all(shapely.buffer(outlines, 0.01, join_style="mitre")))
    return find_levels(rectangles, blocks, height, state, GRID), blocks


def test_a_row_is_cut_into_houses_and_an_annex_belongs_to_one():
    row, annex = (10, 10, 46, 20), (23, 20, 27, 23)
    found, blocks = levels([(row, gables(6.0, 10.0)), (annex, flat)], [rectangle(*row), rectangle(*annex)])
    assert len(blocks) == 1
    assert len(found.parts) == 7
    assert len(found.buildings) == 6
    areas = np.sort(shapely.area(found.buildings))
    np.testing.assert_allclose(areas, [60, 60, 60, 60, 60, 72], rtol=0.1)
    assert shapely.area(found.buildings).sum() == pytest.approx(blocks[0].area, rel=0.02)
    assert set(found.block_of_building) == {0}
    of_annex = found.building_of_part[found.rectangle_of_part == 1]
    assert shapely.area(found.buildings)[of_annex[0]] == areas.max()


def test_a_house_with_a_wing_is_one_building_and_a_part_outside_blocks_another():
    house, wing, far = (10, 10, 30, 20), (30, 12, 38, 18), (80, 40, 90, 50)
    found, blocks = levels([(house, flat), (wing, flat)], [rectangle(*house), rectangle(*wing)])
    assert len(found.buildings) == len(blocks) == 1
    assert list(found.building_of_part) == [0, 0]
    assert found.rectangle_of_part[found.largest_part].tolist() == [0]
    rectangles = np.array([rectangle(*house), rectangle(*far)])
    height, state = place((house, flat))
    own = shapely.polygons(to_world(rectangles[:1], GRID))
    alone = find_levels(rectangles, own, height, state, GRID)
    assert len(alone.buildings) == 2
    assert sorted(alone.block_of_building) == [0, 1]


@pytest.mark.parametrize(("houses", "length", "buildings"), [(3, 30, 3), (3, 22, 1), (4, 24, 4), (4, 22, 1)])
def test_a_long_row_needs_fewer_walls_than_a_short_block(houses, length, buildings):
    sides = (10, 10, 10 + length, 20)
    found, _ = levels([(sides, steps(length / houses, 10.0, 0.6))], [rectangle(*sides)])
    assert len(found.buildings) == buildings


@pytest.mark.parametrize(("length", "buildings"), [(36, 6), (30, 1)])
def test_five_probable_walls_of_one_part_make_a_row_and_four_do_not(length, buildings):
    sides = (10, 10, 10 + length, 20)
    found, _ = levels([(sides, steps(6.0, 10.0, 0.18))], [rectangle(*sides)])
    assert len(found.buildings) == buildings


@pytest.mark.parametrize(("other", "buildings"), [((90, 100, 120), 6), ((75, 50, 40), 1)], ids=["slate", "shade"])
def test_tiles_of_another_colour_are_another_house_and_shade_is_not(other, buildings):
    row = (10, 10, 46, 20)
    height, state = place((row, flat))
    x = (np.arange(2 * GRID.columns) + 0.5) * GRID.gsd / 2
    red = ((x - 10) // 6) % 2 == 0
    lines = np.where(red[:, None], (150, 100, 80), other).T.astype(np.uint8)
    fine = Grid(GRID.west, GRID.north, GRID.gsd / 2, 2 * GRID.rows, 2 * GRID.columns)
    image = Image(np.repeat(lines[:, None], fine.rows, axis=1), ("red", "green", "blue"), fine)
    sides = np.array([rectangle(*row)])
    blocks = shapely.polygons(to_world(sides, GRID))
    assert len(find_levels(sides, blocks, height, state, GRID).buildings) == 1
    found = find_levels(sides, blocks, height, state, GRID, lambda: image)
    assert len(found.buildings) == buildings


def test_patches_of_another_colour_on_a_deep_roof_are_no_houses():
    hall = (10, 10, 58, 30)
    height, state = place((hall, flat))
    x = (np.arange(GRID.columns) + 0.5) * GRID.gsd
    lines = np.where((((x - 10) // 6) % 2 == 0)[:, None], (150, 100, 80), (90, 100, 120)).T.astype(np.uint8)
    image = Image(np.repeat(lines[:, None], GRID.rows, axis=1), ("red", "green", "blue"), GRID)
    sides = np.array([rectangle(*hall)])
    blocks = shapely.polygons(to_world(sides, GRID))
    assert len(find_levels(sides, blocks, height, state, GRID, lambda: image).buildings) == 1


def test_wings_with_a_step_each_are_one_building():
    wings = [(10, top, 26, top + 8) for top in (10, 18, 26)]
    roof = steps(8.0, 10.0, 0.6)
    assert all(len(walls_at(roof, wing)) == 1 for wing in wings)
    found, blocks = levels([(wing, roof) for wing in wings], [rectangle(*wing) for wing in wings])
    assert len(found.buildings) == len(blocks) == 1


def test_empty_scenes_have_no_levels():
    found = find_levels(np.empty((0, 5)), np.empty(0, dtype=object), *place(), GRID)
    assert len(found.parts) == len(found.buildings) == 0


@pytest.mark.parametrize("lines", [1, 4, 7])
def test_medians_of_stations_are_those_of_their_known_values(lines):
    values = np.random.default_rng(lines).normal(size=(60, lines))
    values[np.random.default_rng(0).random(values.shape) < 0.5] = np.nan
    known = [row[np.isfinite(row)] for row in values]
    assert line_medians(values).tolist() == [np.median(row) if len(row) else 0.0 for row in known]
