"""Runs: rectangles end to end, and rows in which each house has a rectangle."""

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from roofbench.detectors.mpp.cells import HIGH
from roofbench.detectors.mpp.rectangles import to_world
from roofbench.detectors.mpp.rows import find_levels
from roofbench.detectors.mpp.runs import runs_of
from roofbench.scenes.geodata.raster import Grid

GRID = Grid(1000.0, 2000.0, 0.5, 120, 200)


def rectangle(left, top, right, bottom):
    return np.array([left + right, top + bottom, 2 * (right - left), 2 * (bottom - top), 0.0])


@given(
    st.lists(st.floats(4, 9), min_size=2, max_size=6),
    st.floats(0, math.pi),
    st.lists(st.booleans(), min_size=6, max_size=6),
    st.integers(0, 2**32 - 1),
)
def test_a_run_reaches_from_the_first_to_the_last_and_is_as_deep_as_all(widths, turn, swapped, seed):
    rng = np.random.default_rng(seed)
    ends = np.cumsum([0.0, *widths])
    depths, shifts = rng.uniform(9.0, 10.0, len(widths)), rng.uniform(-0.5, 0.5, len(widths))
    way, side = np.array([math.cos(turn), math.sin(turn)]), np.array([-math.sin(turn), math.cos(turn)])
    houses = []
    for k, wide in enumerate(widths):
        centre = (100 + (ends[k] + ends[k + 1]) / 2 * way + shifts[k] * side) / 0.5
        sides = (wide / 0.5, depths[k] / 0.5)
        # A rectangle has the same corners with its sides exchanged.
        houses.append([*centre, *(sides[::-1] if swapped[k] else sides), turn + math.pi / 2 * swapped[k]])
    runs = runs_of(rng.permutation(np.array(houses)), 0.5)
    low, high = (shifts - depths / 2).max(), (shifts + depths / 2).min()
    if ends[-1] <= high - low:
        assert len(runs) == 0
        return
    assert len(runs) == 1
    assert runs[0, 2] * 0.5 == pytest.approx(ends[-1])
    assert runs[0, 3] * 0.5 == pytest.approx(high - low)
    assert runs[0, :2] * 0.5 == pytest.approx(100 + ends[-1] / 2 * way + (low + high) / 2 * side)
    assert math.sin(runs[0, 4] - turn) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    "other",
    [
        (20, 10, 30, 15),  # half as deep
        (20, 15, 30, 25),  # beside only half of it
        (22, 10, 32, 20),  # apart
        (10, 20, 20, 40),  # behind it: a run of 20 m depth has no other house
    ],
    ids=["shallow", "aside", "apart", "behind"],
)
def test_what_does_not_go_on_is_no_run(other):
    house = rectangle(8, 10, 20, 20)
    runs = runs_of(np.array([house, rectangle(*other)]), 0.5)
    assert all(run[3] * 0.5 > 10 for run in runs) or len(runs) == 0


def test_a_bend_ends_a_run():
    house, turned = rectangle(10, 10, 20, 20), rectangle(20, 10, 30, 20)
    assert len(runs_of(np.array([house, turned]), 0.5)) == 1
    turned[4] = math.radians(8)
    assert len(runs_of(np.array([house, turned]), 0.5)) == 0
    assert len(runs_of(house[None], 0.5)) == len(runs_of(np.empty((0, 5)), 0.5)) == 0


def levels(houses):
    """Levels of boxes (left, top, right, bottom, roof), metres, which are one block."""
    y, x = (np.mgrid[: GRID.rows, : GRID.columns] + 0.5) * GRID.gsd
    height = np.zeros(x.shape, dtype=np.uint16)
    for left, top, right, bottom, roof in houses:
        inside = (x >= left) & (x < right) & (y >= top) & (y < bottom)
        height[inside] = np.round(100 * np.broadcast_to(roof, x.shape)[inside])
    rectangles = np.array([rectangle(*house[:4]) for house in houses])
    outlines = shapely.polygons(to_world(rectangles, GRID))
    blocks = shapely.get_parts(shapely.union_all(shapely.buffer(outlines, 0.01, join_style="mitre")))
    state = np.where(height > 0, HIGH, 0).astype(np.uint8)
    return find_levels(rectangles, blocks, height, state, GRID)


@pytest.mark.parametrize(("step", "buildings"), [(0.6, 5), (0.0, 1)])
def test_houses_with_a_rectangle_each_are_a_row_where_their_roofs_differ(step, buildings):
    found = levels([(10 + 6 * k, 10, 16 + 6 * k, 20, 7 + step * (k % 2)) for k in range(5)])
    assert len(found.buildings) == buildings


@pytest.mark.parametrize(
    "houses",
    [
        [(10, 10, 20, 20, 7.0), (20, 10, 30, 20, 8.0), (30, 10, 40, 20, 7.0)],  # a house with two equal wings
        [(10 + 16 * k, 10, 26 + 16 * k, 22, 12 + 1.5 * k) for k in range(4)],  # sections of a block of flats
        [(10 + 8 * k, 10, 18 + 8 * k, 28, 8 + 0.6 * (k % 2)) for k in range(5)],  # a hall with bays
    ],
    ids=["wings", "flats", "hall"],
)
def test_wings_and_sections_end_to_end_are_one_building(houses):
    assert len(levels(houses).buildings) == 1


def meet(one, other):
    """Whether two rectangles (x, y, half length, half depth, angle; metres) lie end to end, seen from both."""
    turn = abs((one[4] - other[4] + math.pi / 2) % math.pi - math.pi / 2)
    for angle in (one[4], other[4]):
        east, south = other[0] - one[0], other[1] - one[1]
        ahead = abs(east * math.cos(angle) + south * math.sin(angle))
        aside = abs(south * math.cos(angle) - east * math.sin(angle))
        common = min(2 * one[3], 2 * other[3], one[3] + other[3] - aside)
        if abs(ahead - one[2] - other[2]) > 1.0 or common < 0.7 * 2 * max(one[3], other[3]):
            return False
    return turn <= math.radians(5)


@pytest.mark.parametrize("seed", range(20))
def test_runs_are_the_connected_pairs_of_all_pairs(seed):
    rng = np.random.default_rng(seed)
    rectangles, ahead = [], 0.0
    for _ in range(12):
        wide, deep = rng.uniform(6, 12), rng.uniform(8, 11)
        aside, apart = rng.uniform(-1.5, 1.5), rng.choice([-0.5, 0.0, 0.5, 1.5, 4.0])
        rectangles.append([2 * (ahead + wide / 2), 2 * aside, 2 * wide, 2 * deep, rng.uniform(-0.06, 0.06)])
        ahead += wide + apart
    rectangles = rng.permutation(np.array(rectangles))
    sides = [
        (x / 2, y / 2, *halves, angle)
        for x, y, a, b, angle in rectangles
        for halves, angle in (((a / 4, b / 4), angle), ((b / 4, a / 4), angle + math.pi / 2))
    ]
    groups = [{k} for k in range(len(sides))]
    for i, j in itertools.combinations(range(len(sides)), 2):
        if i // 2 != j // 2 and meet(sides[i], sides[j]) and (pair := [g for g in groups if g & {i, j}])[1:]:
            groups = [g for g in groups if g not in pair] + [pair[0] | pair[1]]
    # Two houses together are longer than any is deep, so that no run is left out.
    assert len(runs_of(rectangles, 0.5)) == sum(len(group) > 1 for group in groups)
