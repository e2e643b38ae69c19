"""Blocks: what is built together is one footprint, along its cells."""

import math

import cv2
import numpy as np
import pytest
import shapely

from roofbench.detectors.mpp import block_cells, blocks
from roofbench.detectors.mpp.blocks import outline_blocks
from roofbench.detectors.mpp.cells import HIGH, LOW
from roofbench.detectors.mpp.rectangles import corners, inside_any
from roofbench.detectors.shared import morphology
from roofbench.scenes.geodata.outlines import coverage_of_mask, trace
from roofbench.scenes.geodata.raster import Grid

GRID = Grid.covering((0.0, 0.0, 60.0, 40.0), 0.5)


def outlined(roofs, rectangles, crowns=(), crown_height=500, *, openness=0.0, crown_openness=0.8):
    """Outline blocks where boxes (x0, y0, x1, y1), metres, are roofs, 5 m high, or rough as crowns."""
    state, score = np.full(GRID.shape, LOW), np.full(GRID.shape, -3000, np.int16)
    height, passed = np.zeros(GRID.shape, np.uint16), np.zeros(GRID.shape, np.uint8)
    for boxes, value, level, share in ((roofs, 3000, 500, 0.0), (crowns, -2000, crown_height, openness)):
        for x0, y0, x1, y1 in boxes:
            place = np.s_[80 - round(2 * y1) : 80 - round(2 * y0), round(2 * x0) : round(2 * x1)]
            state[place], score[place], height[place] = HIGH, value, level
            passed[place] = round(255 * share)
    placed = [((x0 + x1), 80 - (y0 + y1), 2 * (x1 - x0), 2 * (y1 - y0), 0.0) for x0, y0, x1, y1 in rectangles]
    rectangles = np.array(placed, dtype=float).reshape(-1, 5)
    return outline_blocks(rectangles, GRID, height, state, score, passed, crown_openness=crown_openness)


def likeness(one, two):
    return one.intersection(two).area / one.union(two).area


def test_houses_that_touch_are_one_block_and_others_another():
    houses = [(5, 5, 15, 15), (15, 5, 22, 17), (30, 5, 40, 15)]
    found = outlined(houses, houses)
    assert len(found) == 2
    assert likeness(max(found, key=shapely.area), shapely.union_all([shapely.box(*b) for b in houses[:2]])) > 0.97


def test_cells_define_the_border_of_a_block_beyond_and_inside_its_rectangles():
    found = outlined([(5, 5, 20, 15), (20, 5, 24, 9)], [(5, 5, 19, 17)])
    assert len(found) == 1
    assert likeness(found[0], shapely.union(shapely.box(5, 5, 20, 15), shapely.box(20, 5, 24, 9))) > 0.95


def test_cells_without_a_rectangle_make_no_block_and_crowns_beside_houses_are_no_part_of_one():
    house = [(5, 5, 15, 15)]
    found = outlined([*house, (40, 20, 50, 30)], house, crowns=[(15, 5, 25, 15)], crown_height=600)
    assert len(found) == 1
    assert likeness(found[0], shapely.box(5, 5, 15, 15)) > 0.93


def test_high_cells_in_a_narrow_gap_join_two_roofs_and_a_lane_separates_them():
    houses = [(5, 5, 15, 20), (18, 5, 28, 20)]
    assert len(outlined(houses, houses, crowns=[(15, 5, 18, 20)])) == 1
    assert len(outlined(houses, houses)) == 2


def test_a_crown_that_rises_above_two_houses_does_not_join_them():
    houses, crown = [(5, 5, 15, 20), (18, 5, 28, 20)], [(15, 5, 18, 20)]
    assert len(outlined(houses, houses, crowns=crown, crown_height=740)) == 1
    assert len(outlined(houses, houses, crowns=crown, crown_height=760)) == 2


def test_a_crown_as_low_as_two_houses_does_not_join_them_where_pulses_pass_it_as_they_pass_crowns():
    houses, crown = [(5, 5, 15, 20), (18, 5, 28, 20)], [(15, 5, 18, 20)]
    assert len(outlined(houses, houses, crowns=crown, openness=0.50)) == 1
    assert len(outlined(houses, houses, crowns=crown, openness=0.54)) == 2
    # The limit follows the crowns of the scene: these are closed to most pulses.
    assert len(outlined(houses, houses, crowns=crown, openness=0.28, crown_openness=0.4)) == 2
    # Where openness says nothing, rough cells in a gap may be built.
    assert len(outlined(houses, houses, crowns=crown, openness=0.62, crown_openness=math.nan)) == 1


def test_an_open_rough_place_within_one_block_is_part_of_it():
    block = [(5, 5, 15, 20), (18, 5, 28, 20), (15, 5, 18, 10)]
    assert len(outlined(block, block, crowns=[(15, 10, 18, 20)], openness=1.0)[0].interiors) == 0


def test_a_tall_rough_place_within_one_block_is_part_of_it():
    block = [(5, 5, 15, 20), (18, 5, 28, 20), (15, 5, 18, 10)]
    found = outlined(block, block, crowns=[(15, 10, 18, 20)], crown_height=900)
    assert len(found) == 1
    assert likeness(found[0], shapely.box(5, 5, 28, 20)) > 0.97


def test_the_rough_rim_of_a_roof_belongs_to_it_and_what_is_higher_or_lower_does_not():
    built, high = np.zeros((20, 20), bool), np.zeros((20, 20), bool)
    built[5:15, 3:10], high[5:15, 3:14] = True, True
    for level, width in ((500, 2), (550, 2), (551, 0), (449, 0)):
        height = np.where(built, 500, level).astype(np.uint16)
        assert block_cells._with_rims(built, height, high, 2).sum() == 70 + 10 * width


def test_a_crown_beside_a_house_at_the_height_of_its_eaves_is_no_rim_of_it():
    house, crown = [(5, 5, 15, 20)], [(15, 5, 18, 20)]
    rim = outlined(house, house, crowns=crown, openness=0.3)[0].area
    assert rim == pytest.approx(11 * 15, rel=0.02)
    assert outlined(house, house, crowns=crown, openness=0.9)[0].area == pytest.approx(10 * 15, rel=0.04)
    assert outlined(house, house, crowns=crown, openness=0.9, crown_openness=math.nan)[0].area == rim


def test_rims_do_not_join_two_blocks():
    rng = np.random.default_rng(3)
    for seed in range(5):
        built = smooth_noise(seed)
        height = rng.integers(480, 520, built.shape).astype(np.uint16)
        grown = block_cells._with_rims(built, height, np.ones_like(built), 2)
        assert (grown & built).sum() == built.sum() < grown.sum()
        labels = cv2.connectedComponents(built.astype(np.uint8), connectivity=4)[1]
        owners = cv2.connectedComponents(grown.astype(np.uint8), connectivity=4)[1]
        # Each grown part holds one block, as far as blocks did not touch by corners before.
        for part in range(1, owners.max() + 1):
            inside = np.unique(labels[(owners == part) & built])
            assert len(inside) <= 1


def test_a_courtyard_is_a_hole():
    wings = [(5, 5, 30, 11), (5, 21, 30, 27), (5, 11, 11, 21), (24, 11, 30, 21)]
    found = outlined(wings, wings)
    assert len(found) == 1
    assert len(found[0].interiors) == 1
    assert found[0].area == pytest.approx(25 * 22 - 13 * 10, rel=0.03)


def test_no_rectangle_no_block():
    assert len(outlined([(5, 5, 15, 15)], [])) == 0


def test_cells_inside_rectangles_are_those_whose_centre_is():
    rng = np.random.default_rng(4)
    rectangles = np.column_stack(
        [rng.uniform(-5, 45, 12), rng.uniform(-5, 35, 12), rng.uniform(2, 20, (12, 2)), rng.uniform(0, 3, 12)]
    )
    y, x = np.mgrid[:30, :40] + 0.5
    union = shapely.union_all(shapely.polygons(corners(rectangles)))
    np.testing.assert_array_equal(inside_any(rectangles, (30, 40)), shapely.contains_xy(union, x, y))


def smooth_noise(seed, shape=(90, 70)):
    """A mask of blobs, some of which touch by corners alone."""
    values = np.random.default_rng(seed).normal(size=shape)
    for _ in range(2):
        values = values + np.roll(values, 1, 0) + np.roll(values, 1, 1)
    return values > 0.5


@pytest.mark.parametrize("strip", [1, 13, 40])
def test_blocks_traced_in_strips_are_those_traced_at_once(monkeypatch, strip):
    mask, grid = smooth_noise(1), Grid(4000.0, 9000.0, 0.75, 90, 70)
    whole = trace(coverage_of_mask(mask), grid)
    monkeypatch.setattr(blocks, "_STRIP", strip)
    parts = blocks._traced(mask, grid)
    assert len(whole) > 20
    assert sorted(shapely.to_wkb(shapely.normalize(parts)).tolist()) == sorted(
        shapely.to_wkb(shapely.normalize(whole)).tolist()
    )
    assert len(blocks._traced(np.zeros_like(mask), grid)) == 0


@pytest.mark.parametrize("radius", [2.0, 5.0])
@pytest.mark.parametrize("band", [1, 7, 64])
def test_a_mask_opened_in_bands_is_that_opened_at_once(monkeypatch, radius, band):
    mask = np.kron(smooth_noise(2, (30, 24)), np.ones((5, 5), bool))
    whole = morphology.opened(mask, radius)
    assert 0 < whole.sum() < mask.sum()
    monkeypatch.setattr(morphology, "_BAND", band)
    np.testing.assert_array_equal(morphology.opened(mask, radius), whole)
