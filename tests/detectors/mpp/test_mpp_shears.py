"""Oblique party walls: the shear along which roofs repeat, and where a row is cut along it."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from roofbench.detectors.mpp.cells import HIGH
from roofbench.detectors.mpp.lattices import lattice_of
from roofbench.detectors.mpp.party_walls import CERTAIN, party_walls, profile_of
from roofbench.detectors.mpp.rows import find_levels
from roofbench.detectors.mpp.shears import likely_shear
from roofbench.scenes.geodata.raster import Grid

GRID = Grid(1000.0, 2000.0, 0.5, 120, 160)
#: Centre of the row, metres; its length and depth.
X, Y, LONG, DEEP = 40.0, 30.0, 48.0, 10.0


def row_of_houses(skew, roof, turn=0.0):
    """Heights and states of a row of eight houses whose party walls are oblique by some degrees, and its rectangle."""
    y, x = (np.mgrid[: GRID.rows, : GRID.columns] + 0.5) * GRID.gsd
    cosine, sine = math.cos(turn), math.sin(turn)
    along, across = cosine * (x - X) + sine * (y - Y), cosine * (y - Y) - sine * (x - X)
    place = along + LONG / 2 - math.tan(math.radians(skew)) * across
    inside = (np.abs(along) < LONG / 2 + 1) & (np.abs(across) < DEEP / 2 + 1)
    height = np.where(inside, np.round(100 * roof(place, across)), 0).astype(np.uint16)
    state = np.where(inside, HIGH, 0).astype(np.uint8)
    sides = np.array([X, Y, LONG, DEEP]) / GRID.gsd
    return np.append(sides, turn), height, state


def gables(place, across):
    return 8.0 - np.abs(place % 6.0 - 3.0)


def steps(place, across):
    return 7.0 + 0.6 * (place // 6.0 % 2) - 0.4 * np.abs(across)


@pytest.mark.parametrize("roof", [gables, steps])
@pytest.mark.parametrize("turn", [0.0, 0.4, 2.0])
@pytest.mark.parametrize("skew", [-30, -20, -14, 14, 20, 30])
def test_oblique_walls_are_found_where_they_are(roof, turn, skew):
    row, height, state = row_of_houses(skew, roof, turn)
    walls = party_walls(profile_of(row, height, state, GRID), CERTAIN, GRID)
    assert len(walls) >= 5
    for wall in walls:
        x, y = wall.point * GRID.gsd - (X, Y)
        along, across = math.cos(turn) * x + math.sin(turn) * y, math.cos(turn) * y - math.sin(turn) * x
        place = along + LONG / 2 - math.tan(math.radians(skew)) * across
        assert abs((place + 3.0) % 6.0 - 3.0) < 1.25
        way = wall.along if wall.along @ (-math.sin(turn), math.cos(turn)) > 0 else -wall.along
        ahead, deep = way @ (math.cos(turn), math.sin(turn)), way @ (-math.sin(turn), math.cos(turn))
        assert math.degrees(math.atan2(ahead, deep)) == pytest.approx(skew, abs=5)


@pytest.mark.parametrize("roof", [gables, steps])
def test_a_row_with_oblique_walls_is_cut_into_its_houses(roof):
    row, height, state = row_of_houses(25, roof)
    outline = shapely.box(1000 + X - LONG / 2, 2000 - Y - DEEP / 2, 1000 + X + LONG / 2, 2000 - Y + DEEP / 2)
    found = find_levels(row[None], np.array([outline]), height, state, GRID)
    slope = math.tan(math.radians(25))
    x, y = 1000 + X - LONG / 2, 2000 - Y
    houses = [
        shapely.Polygon(
            [(x + at + end * slope, y - end) for at, end in ((6 * k, -5), (6 * k + 6, -5), (6 * k + 6, 5), (6 * k, 5))]
        )
        for k in range(1, 7)
    ]
    best = [max(house.intersection(one).area / house.union(one).area for one in found.buildings) for house in houses]
    assert min(best) > 0.8


@pytest.mark.parametrize("roof", [gables, steps])
def test_walls_perpendicular_to_the_row_are_read_without_a_shear(roof):
    row, height, state = row_of_houses(0, roof)
    assert profile_of(row, height, state, GRID).lattice.shear == 0


@given(st.integers(0, 2**32 - 1), st.integers(24, 80), st.integers(8, 24))
def test_no_shear_is_found_in_noise_along_one_line_or_without_heights(seed, stations, lines):
    rng = np.random.default_rng(seed)
    ridge = 8 - 0.5 * np.abs(np.arange(lines) - lines / 2) + np.zeros((stations, 1))
    assert likely_shear(ridge) == 0
    assert likely_shear(np.full((stations, lines), np.nan)) == 0
    levels = rng.choice([7.0, 7.5, 8.0], stations)[:, None] + np.zeros(lines)
    assert likely_shear(levels) == 0


@pytest.mark.parametrize("shear", [0.0, 0.3, -0.5])
def test_cells_of_a_lattice_lie_on_its_walls(shear):
    lattice = lattice_of(np.array([80.0, 60.0, 96.0, 20.0, 0.3]), GRID)._replace(shear=shear)
    row, column, inside = lattice.cells(GRID)
    assert row.shape == (lattice.stations, 20)
    assert inside.all() == (shear == 0)
    for station in (5, 50, 90):
        point, way = lattice.wall((station + 0.5) * 0.5, GRID)
        offset = np.stack([column[station] + 0.5, row[station] + 0.5], axis=1) - point
        assert np.abs(offset @ (-way[1], way[0])).max() < 0.75
        assert np.hypot(*way) == pytest.approx(1)


def test_a_side_that_is_cut_off_by_the_shear_is_unknown():
    lattice = lattice_of(np.array([80.0, 60.0, 96.0, 20.0, 0.0]), GRID)._replace(shear=0.5)
    inside = lattice.cells(GRID)[2]
    assert not inside[0, 0]
    assert inside[0, -1]
    assert not inside[-1, -1]
