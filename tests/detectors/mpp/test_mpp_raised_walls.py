"""Parapets and chimneys as evidence of party walls."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from roofbench.detectors.mpp.cells import HIGH, LOW
from roofbench.detectors.mpp.party_walls import CERTAIN, PROBABLE, party_walls, profile_of
from roofbench.detectors.mpp.raised_walls import chimneys, parapet_strength, rises, series
from roofbench.detectors.mpp.rectangles import to_world
from roofbench.detectors.mpp.rows import find_levels
from roofbench.scenes.geodata.raster import Grid

GRID = Grid(1000.0, 2000.0, 0.5, 60, 140)
#: Left, top, right, bottom of a row, metres: six houses of 6 m under one ridge along the row.
ROW = (10, 10, 46, 20)
WALLS = (16, 22, 28, 34, 40)


def ridge(x, y):
    return 9.0 - 0.7 * np.abs(y - 15)


def low(x, y):
    return 9.0 - 0.22 * np.abs(y - 15)


def flat(x, y):
    return 7.0 + 0 * x


def gables(x, y):
    return 9.0 - np.abs((x - 10) % 6 - 3)


def cells(roof, structures=(), noise=0.0):
    """Heights (cm), states and structures (cm) of cells; structures are left, top, right, bottom, rise in metres."""
    y, x = (np.mgrid[: GRID.rows, : GRID.columns] + 0.5) * GRID.gsd
    left, top, right, bottom = ROW
    inside = (x >= left) & (x < right) & (y >= top) & (y < bottom)
    wobble = np.random.default_rng(5).normal(0, noise, x.shape)
    height = np.where(inside, np.round(100 * (roof(x, y) + wobble)), 0).astype(np.uint16)
    standing = np.zeros(GRID.shape, dtype=np.uint8)
    for left, top, right, bottom, rise in structures:
        standing[(x >= left) & (x < right) & (y >= top) & (y < bottom)] = round(100 * rise)
    return height, np.where(inside, HIGH, LOW).astype(np.uint8), standing


def rectangle(left, top, right, bottom):
    return np.array([left + right, top + bottom, 2 * (right - left), 2 * (bottom - top), 0.0])


def walls_at(roof, structures, rule=CERTAIN, noise=0.02):
    height, state, standing = cells(roof, structures, noise)
    return [
        wall.point[0] * GRID.gsd
        for wall in party_walls(profile_of(rectangle(*ROW), height, state, GRID, structures=standing), rule, GRID)
    ]


def buildings(roof, structures):
    height, state, standing = cells(roof, structures, 0.02)
    one = rectangle(*ROW)[None]
    blocks = shapely.polygons(to_world(one, GRID))
    return len(find_levels(one, blocks, height, state, GRID, structures=standing).buildings)


def chimney(x, y=15.0, rise=1.0, size=1.0):
    return (x - size / 2, y - size / 2, x + size / 2, y + size / 2, rise)


@pytest.mark.parametrize("rise", [0.3, 0.6])
@pytest.mark.parametrize("roof", [ridge, flat], ids=["ridge", "flat"])
def test_parapets_are_party_walls(roof, rise):
    parapets = [(x, 10, x + 0.5, 20, rise) for x in WALLS]
    np.testing.assert_allclose(walls_at(roof, parapets), WALLS, atol=0.6)
    assert buildings(roof, parapets) == 6


def test_chimneys_that_repeat_are_party_walls():
    found = walls_at(ridge, [chimney(x) for x in WALLS])
    np.testing.assert_allclose(found, WALLS, atol=0.6)
    assert buildings(ridge, [chimney(x) for x in WALLS]) == 6


@pytest.mark.parametrize(
    ("roof", "structures"),
    [
        (ridge, []),
        (ridge, [chimney(28)]),
        (ridge, [chimney(22), chimney(34)]),
        (ridge, [chimney(16), chimney(18.5), chimney(21), chimney(30.5), chimney(33), chimney(35.5)]),
        (ridge, [(x - 1.25, 11, x + 1.25, 14, 1.4) for x in (13, 19, 25, 31, 37, 43)]),
        (ridge, [(x - 2, 11, x + 2, 14, 0.12) for x in (13, 19, 25, 31, 37, 43)]),
        (ridge, [(17, 11, 39, 14, 0.12)]),
        (ridge, [chimney(x, 10.25, size=0.5) for x in WALLS]),
        (flat, [chimney(x) for x in WALLS]),
        (low, [chimney(x) for x in WALLS]),
        (flat, [(x, 10, x + 0.5, 20, 0.5) for x in (20, 35)]),
    ],
    ids=[
        "plain",
        "one",
        "two",
        "too close",
        "dormers",
        "panels",
        "long panels",
        "eaves",
        "flat: vents",
        "low: vents",
        "flat: edges",
    ],
)
def test_what_else_stands_on_roofs_cuts_nothing(roof, structures):
    assert walls_at(roof, structures) == []
    assert buildings(roof, structures) == 1


def test_a_chimney_is_a_wall_where_other_walls_show_a_row():
    assert len(walls_at(ridge, [chimney(22), chimney(34)], PROBABLE)) == 2
    parapets = [(x, 10, x + 0.5, 20, 0.5) for x in WALLS[:3]]
    assert buildings(ridge, parapets) == 4
    assert buildings(ridge, [*parapets, chimney(38)]) == 5


def test_on_a_deep_roof_nothing_is_a_wall():
    height, state, standing = cells(flat, [(x, 10, x + 0.5, 28, 0.5) for x in WALLS])
    height[20:56, 20:92], state[20:56, 20:92] = 700, HIGH
    for depth, count in ((15, 5), (18, 0)):
        profile = profile_of(rectangle(10, 10, 46, 10 + depth), height, state, GRID, structures=standing)
        assert len(party_walls(profile, CERTAIN, GRID)) == count


def test_between_gables_that_face_the_street_nothing_rises():
    height, _, standing = cells(gables, [chimney(x) for x in WALLS])
    assert np.isnan(rises((height + standing)[20:40, 20:92].T / 100.0)).all()


def test_a_series_has_one_width_and_leaves_out_what_does_not_fit():
    np.testing.assert_array_equal(series(np.array([10.0, 22.0, 34.0, 46.0])), [10, 22, 34, 46])
    np.testing.assert_array_equal(series(np.array([10.0, 22.0, 27.0, 34.0, 46.0])), [10, 22, 34, 46])
    # Two houses share a chimney: every second wall has one.
    np.testing.assert_array_equal(series(np.array([10.0, 34.0, 58.0])), [10, 34, 58])
    for none in ([], [10.0], [10.0, 22.0], [10.0, 15.0, 20.0], [10.0, 22.0, 200.0]):
        assert len(series(np.array(none))) == 0


@given(st.lists(st.floats(0, 150), max_size=9))
def test_a_series_is_part_of_the_chimneys_and_moves_with_them(places):
    stations = np.sort(np.array(places, dtype=np.float64).round(2))
    found = series(stations)
    assert np.isin(found, stations).all()
    assert len(found) == 0 or len(found) >= 3
    np.testing.assert_allclose(series(stations + 64), found + 64)


def slow_rises(profile):
    """The definition of a rise, place by place."""
    count, lines = profile.shape

    def mean(values):
        known = [value for value in values if not math.isnan(value)]
        return sum(known) / len(known) if known else math.nan

    def slope(i, sign):
        steps = []
        for k in range(lines):
            near = mean([profile[i + sign * d, k] for d in (2, 3, 4)])
            far = mean([profile[i + sign * d, k] for d in (4, 5, 6)])
            steps.append(near - far)
        known = [step for step in steps if not math.isnan(step)]
        return abs(float(np.median(known))) if known else math.inf

    rise = np.full(profile.shape, np.nan)
    for i in range(6, count - 6):
        if slope(i, 1) >= 0.25 or slope(i, -1) >= 0.25:
            continue
        for k in range(lines):
            sides = [mean([profile[i + sign * d, k] for d in (2, 3, 4)]) for sign in (-1, 1)]
            if not any(math.isnan(side) for side in sides):
                rise[i, k] = profile[i, k] - max(sides)
    return rise


@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.integers(1, 9))
def test_rises_are_those_of_plain_loops(seed, stations, lines):
    rng = np.random.default_rng(seed)
    profile = 8 + rng.normal(0, 0.1, (stations, lines)) + rng.choice([0, 0.4, 1.0], stations)[:, None]
    profile[rng.random(profile.shape) < rng.choice([0, 0.2, 0.6])] = np.nan
    np.testing.assert_allclose(rises(profile), slow_rises(profile), atol=1e-9)


def slow_parapets(rise, share, least):
    """The definition of a parapet, station by station."""
    both = np.full(rise.shape, np.nan)
    for i in range(1, len(rise)):
        for k in range(rise.shape[1]):
            pair = [value for value in rise[i - 1 : i + 1, k] if not math.isnan(value)]
            both[i, k] = max(pair, default=math.nan)
    known = [[value for value in row if not math.isnan(value)] for row in both]
    enough = [2 * len(row) >= rise.shape[1] and len(row) > 0 for row in known]
    strength = np.zeros(len(rise))
    if not any(enough):
        return strength
    medians = [float(np.median(row)) if ok else math.nan for row, ok in zip(known, enough, strict=True)]
    usual = float(np.nanmedian(medians))
    spread = 1.4826 * float(np.nanmedian([abs(value - usual) for value in medians]))
    for i, (row, ok) in enumerate(zip(known, enough, strict=True)):
        shown = sum(value > usual + 0.08 for value in row)
        if ok and shown >= share * len(row) and medians[i] - usual >= max(least, 2 * spread):
            strength[i] = medians[i] - usual
    return strength


@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.integers(1, 9))
def test_the_strength_of_parapets_is_that_of_plain_loops(seed, stations, lines):
    rng = np.random.default_rng(seed)
    rise = rng.normal(0, 0.05, (stations, lines)) + rng.choice([0, 0, 0, 0.4], stations)[:, None]
    rise[rng.random(rise.shape) < rng.choice([0, 0.2, 0.6])] = np.nan
    np.testing.assert_allclose(parapet_strength(rise, 0.65, 0.15), slow_parapets(rise, 0.65, 0.15), atol=1e-9)


def test_chimneys_are_compact_and_those_of_one_wall_count_once():
    rise = np.zeros((60, 16))
    rise[20:22, 6:8] = 1.0
    rise[21, 11] = 0.9  # of the same wall
    rise[30:34, 6:9] = 1.0  # too long
    rise[40, 2:9] = 1.0  # too deep
    rise[50, 0] = 1.0  # at the eaves
    rise[55, 8] = 0.5  # too low
    rise[10, 8] = np.nan
    np.testing.assert_allclose(chimneys(rise), [21.25], atol=0.3)
    assert len(chimneys(np.full((40, 9), np.nan))) == 0
