"""Changes of direction from house to house."""

import math

import numpy as np
import pytest
import shapely

from roofbench.detectors.mpp.bends import count_bends
from roofbench.detectors.mpp.cells import HIGH, LOW
from roofbench.detectors.mpp.rectangles import to_world
from roofbench.detectors.mpp.rows import find_levels
from roofbench.scenes.geodata.raster import Grid

GRID = Grid(1000.0, 2000.0, 0.5, 140, 140)


def crescent(houses, degrees, wide=6.0, deep=9.0, along=0):
    """Rectangles (cells) of houses along a curve, each turned against the one before; `along`: which side is first."""
    place, angle, found = np.array([12.0, 30.0]), math.radians(-degrees * (houses - 1) / 2), []
    for _ in range(houses):
        way = np.array([math.cos(angle), math.sin(angle)])
        middle = place + way * wide / 2
        sides = (wide, deep, angle) if along == 0 else (deep, wide, angle - math.pi / 2)
        found.append([*(2 * middle), 2 * sides[0], 2 * sides[1], sides[2]])
        place, angle = place + way * wide, angle + math.radians(degrees)
    return np.array(found)


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize(("degrees", "bends"), [(0, 0), (2, 0), (8, 5), (20, 5), (60, 0)])
def test_bends_of_a_crescent(degrees, bends, along):
    number, each = count_bends(crescent(6, degrees, along=along), GRID.gsd)
    assert number == bends
    assert each.tolist() == ([1, 2, 2, 2, 2, 1] if bends else [0] * 6)


def test_far_narrow_and_unlike_rectangles_make_no_bend():
    house, other = crescent(2, 10)
    assert count_bends(np.array([house, other]), GRID.gsd)[0] == 1
    for change in ([20, 0, 0, 0, 0], [0, 0, -5, 0, 0], [0, 0, 0, 8, 0]):
        assert count_bends(np.array([house, other + change]), GRID.gsd)[0] == 0
    assert count_bends(np.empty((0, 5)), GRID.gsd)[0] == 0


def buildings(rectangles):
    """Number of buildings in a block of flat roofs of one height."""
    outlines = shapely.polygons(to_world(rectangles, GRID))
    blocks = shapely.get_parts(shapely.union_all(shapely.buffer(outlines, 0.3, join_style="mitre")))
    assert len(blocks) == 1
    x, y = GRID.west + (np.arange(140) + 0.5) / 2, GRID.north - (np.arange(140) + 0.5) / 2
    high = shapely.contains_xy(blocks[0], *np.meshgrid(x, y))
    height, state = np.where(high, 700, 0).astype(np.uint16), np.where(high, HIGH, LOW).astype(np.uint8)
    return len(find_levels(rectangles, blocks, height, state, GRID).buildings)


def test_houses_of_a_crescent_are_buildings_of_their_own():
    assert buildings(crescent(6, 9)) == 6
    assert buildings(crescent(6, 0)) == 1


def test_a_building_with_a_wing_at_each_end_is_one():
    assert buildings(crescent(3, 20, wide=9.0)) == 1
