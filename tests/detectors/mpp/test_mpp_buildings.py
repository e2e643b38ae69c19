"""A building is its rectangle's part of the block, or the rectangle where that is as good."""

import numpy as np
import pytest
import shapely
from naive import mpp as naive_mpp

from roofbench.detectors.mpp.buildings import _lead, outline_buildings
from roofbench.scenes.geodata.raster import Grid

GRID = Grid(1000.0, 2000.0, 0.5, 200, 200)


def world(*boxes):
    """Polygons from boxes in cells (left, top, right, bottom), y downwards."""
    return shapely.union_all(
        [shapely.box(1000 + x0 / 2, 2000 - y1 / 2, 1000 + x1 / 2, 2000 - y0 / 2) for x0, y0, x1, y1 in boxes]
    )


def agreement(first, second):
    return first.intersection(second).area / first.union(second).area


def test_a_rectangle_that_describes_its_block_stays_and_one_that_does_not_becomes_the_block():
    rectangles = np.array([[30.0, 30.0, 40.0, 20.0, 0.0], [130.0, 30.0, 40.0, 40.0, 0.0]])
    blocks = np.array([world((10, 20, 51, 40)), world((110, 10, 150, 50), (120, 50, 150, 65))])
    first, second = outline_buildings(rectangles, blocks, GRID)
    assert first.equals(world((10, 20, 50, 40)))
    assert second.equals(blocks[1])


@pytest.mark.parametrize("angle", [0.0, 0.4])
def test_houses_of_a_block_meet_in_their_party_wall_and_have_all_of_it(angle):
    # Three houses in a row, and cells of the block two metres beyond their backs.
    cos, sin = np.cos(angle), np.sin(angle)
    place = np.array([[-16.0, 0.0], [0.0, 0.0], [16.0, 0.0]]) @ np.array([[cos, sin], [-sin, cos]]) + 100.0
    rectangles = np.column_stack([place, np.full(3, 16.0), np.full(3, 24.0), np.full(3, angle)])
    block = world((76, 88, 124, 116))
    block = shapely.affinity.rotate(block, -np.degrees(angle), origin=(1050.0, 1950.0))
    parts = outline_buildings(rectangles, np.array([block]), GRID)
    assert agreement(shapely.union_all(parts), block) > 0.995
    for k, part in enumerate(parts):
        assert part.area == pytest.approx(8.0 * 14.0, rel=0.02)
        assert part.intersection(shapely.union_all(np.delete(parts, k))).area < 1e-6
        corners = shapely.get_coordinates(part)
        assert np.hypot(*np.diff(corners, axis=0).T).min() > 1e-7


def test_a_courtyard_stays_open_and_what_is_far_from_all_rectangles_belongs_to_none():
    rectangles = np.array([[40.0, 50.0, 20.0, 60.0, 0.0], [90.0, 50.0, 20.0, 60.0, 0.0]])
    block = world((30, 20, 100, 80)).difference(world((55, 35, 75, 65)))
    far = block.union(world((100, 45, 190, 55)))
    left, right = outline_buildings(rectangles, np.array([far]), GRID)
    assert left.intersection(world((55, 35, 75, 65))).area == 0
    assert agreement(left.union(right).intersection(block), block) > 0.99
    assert right.bounds[2] == pytest.approx(1050 + 10, abs=0.3)


def test_rectangles_without_a_block_and_scenes_without_anything():
    alone = np.array([[30.0, 30.0, 40.0, 20.0, 0.0]])
    assert outline_buildings(alone, np.empty(0, object), GRID)[0].equals(world((10, 20, 50, 40)))
    assert outline_buildings(alone, np.array([world((100, 100, 120, 120))]), GRID)[0].equals(world((10, 20, 50, 40)))
    assert len(outline_buildings(np.empty((0, 5)), np.array([world((0, 0, 9, 9))]), GRID)) == 0


def test_the_lead_of_a_rectangle_equals_that_of_one_place_at_a_time():
    rng = np.random.default_rng(4)
    rectangles = np.column_stack([rng.uniform(-5, 25, (4, 2)), rng.uniform(4, 12, (4, 2)), rng.uniform(0, np.pi, 4)])
    turns = np.stack([np.cos(rectangles[:, 4]), np.sin(rectangles[:, 4])], axis=1)
    lead = _lead(rectangles, turns, (3, -6), 8.0, (14, 17))
    for row in range(14):
        for column in range(17):
            near = [naive_mpp.nearness(one, column - 5.5, row + 3.5) for one in rectangles]
            assert lead[row, column] == pytest.approx(0.5 + min(8.0, *near[1:]) - near[0], abs=1e-5)


def test_a_zone_is_cut_off_beyond_its_block_without_a_trace():
    # A narrow block, of which the nearer rectangle gets its part although the zone is much larger.
    rectangles = np.array([[30.0, 30.0, 20.0, 20.0, 0.0], [60.0, 30.0, 20.0, 20.0, 0.0]])
    block = world((20, 20, 70, 40), (40, 20, 44, 50))
    first, second = outline_buildings(rectangles, np.array([block]), GRID, always=True)
    assert first.union(second).symmetric_difference(block).area < 0.1
    assert first.area == pytest.approx(world((20, 20, 45, 40), (40, 20, 44, 50)).area, abs=0.2)


def test_outlines_that_are_not_wanted_are_rectangles_and_change_no_other():
    rectangles = np.array([[30.0, 30.0, 20.0, 20.0, 0.0], [52.0, 30.0, 20.0, 20.0, 0.0], [85.0, 30.0, 20.0, 20.0, 0.0]])
    blocks = np.array([world((20, 20, 64, 44)), world((75, 20, 95, 46))])
    every = outline_buildings(rectangles, blocks, GRID)
    some = outline_buildings(rectangles, blocks, GRID, wanted=np.array([True, True, False]))
    assert some[0].equals(every[0])
    assert some[1].equals(every[1])
    assert not every[2].equals(some[2])
    assert some[2].equals(world((75, 20, 95, 40)))
