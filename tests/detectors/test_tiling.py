"""Tiling: every place has one owner, and the seam pass leaves one footprint for each building."""

import dataclasses

import numpy as np
import pytest
import shapely
from harness.effort import examples
from hypothesis import example, given
from hypothesis import strategies as st

from roofbench.detectors.mpp.mpp_detector import MPP
from roofbench.detectors.ndsm.ndsm_detector import NDSM
from roofbench.detectors.registry import DETECTORS
from roofbench.detectors.seams import join_strips, join_tiles, tile_facts
from roofbench.detectors.tiling import CUT, SPARE, Tile, owned, stream_of, tiles_over
from roofbench.scenes.geodata.footprints import Footprints, stacked

WHOLE = (0.0, 0.0, 300.0, 100.0)
LEFT, MIDDLE, RIGHT = tiles_over(WHOLE, 100.0)


def part(*boxes, cut=False, spare=False, **columns):
    polygons = [shapely.box(*box) for box in boxes]
    attributes = {CUT: np.full(len(boxes), cut), SPARE: np.full(len(boxes), spare)}
    attributes |= {name: np.array(values) for name, values in columns.items()}
    return Footprints.of(polygons, attributes=attributes)


def joined(parts, **options):
    found, seams = join_tiles(parts, crs=None, **options)
    return [tuple(bounds) for bounds in shapely.bounds(found.polygons).tolist()], seams


coordinate = st.floats(-1e4, 1e4)


@given(st.tuples(coordinate, coordinate), st.tuples(coordinate, coordinate), st.floats(16, 700))
@example((0.0, -5e-324), (0.0, -1.0), 16.0)
def test_every_centre_has_one_owner_also_beyond_the_scene(corner, centre, side):
    whole = (*corner, corner[0] + 900, corner[1] + 700)
    owners = [tile for tile in tiles_over(whole, side) if tile.owns(np.array([centre]), whole)[0]]
    assert len(owners) == 1


def test_the_grid_of_tiles_does_not_depend_on_the_scene():
    assert set(tiles_over((100, 100, 200, 200), 64)) <= set(tiles_over((-900, -900, 900, 900), 64))


def test_a_core_is_half_open():
    centres = np.array([[100.0, 50.0]])
    assert not LEFT.owns(centres, WHOLE)[0]
    assert MIDDLE.owns(centres, WHOLE)[0]


def test_the_random_stream_of_a_tile_follows_from_seed_and_place():
    def draws(seed, tile):
        return stream_of(seed, tile, NDSM()).integers(2**62, size=2).tolist()

    seen = [draws(seed, tile) for seed in (0, 1) for tile in (LEFT, MIDDLE, Tile(-3, -2, 100.0))]
    assert len({tuple(values) for values in seen}) == 6
    assert draws(0, LEFT) == draws(0, LEFT)
    # The sampler derives its streams from absolute places itself.
    assert stream_of(0, LEFT, MPP()).integers(2**62) == stream_of(0, MIDDLE, MPP()).integers(2**62)


def test_a_footprint_at_the_rim_of_the_halo_is_cut_but_not_at_the_rim_of_the_scene():
    found = part((0, 10, 20, 20), (40, 40, 50, 50), (70, 10, 120, 20))
    assert owned(found, LEFT, (0.0, 0.0, 120.0, 100.0), WHOLE).attributes[CUT].tolist() == [False, False, True]


def test_what_two_tiles_found_stays_once_where_it_lies_deeper():
    parts = {LEFT: part((90, 10, 109, 20)), MIDDLE: part((91, 10, 112, 20), (150, 10, 160, 20))}
    boxes, seams = joined(parts)
    assert boxes == [(91, 10, 112, 20), (150, 10, 160, 20)]
    assert tuple(seams) == (1, 0, 0, 0)


def test_overlaps_within_a_tile_stay():
    boxes, seams = joined({LEFT: part((10, 10, 30, 20), (11, 10, 31, 20))})
    assert len(boxes) == 2
    assert not any(seams)


def test_a_cut_footprint_gives_way_to_the_whole_of_it():
    parts = {LEFT: part((60, 10, 120, 20), cut=True), MIDDLE: part((60, 10, 200, 20))}
    boxes, seams = joined(parts)
    assert boxes == [(60, 10, 200, 20)]
    assert tuple(seams) == (0, 1, 0, 0)


def test_cut_parts_of_which_no_tile_sees_the_whole_are_joined():
    parts = {
        LEFT: part((10, 10, 120, 20), cut=True),
        MIDDLE: part((80, 10, 220, 20), cut=True),
        RIGHT: part((180, 10, 290, 20), cut=True),
    }
    boxes, seams = joined(parts)
    assert boxes == [(10, 10, 290, 20)]
    assert tuple(seams) == (0, 0, 3, 0)


def test_a_house_that_its_owner_lost_in_a_neighbour_is_added_from_the_tile_that_found_it():
    """The middle tile sees one block of two houses, centred in the left one; the left tile sees both."""
    found = part((80, 10, 99, 20), (101, 10, 114, 20))
    left = owned(Footprints(polygons=found.polygons), LEFT, (0.0, 0.0, 164.0, 100.0), WHOLE)
    assert left.attributes[SPARE].tolist() == [False, True]
    block = Footprints.of([shapely.box(80, 10, 114, 20)])
    middle = owned(block, MIDDLE, (36.0, 0.0, 264.0, 100.0), WHOLE)
    assert middle.attributes[SPARE].tolist() == [True]
    boxes, seams = joined({LEFT: left, MIDDLE: middle})
    assert boxes == [(80, 10, 99, 20), (101, 10, 114, 20)]
    assert tuple(seams) == (0, 0, 0, 1)


def test_a_spare_footprint_is_not_added_where_its_owner_has_one():
    left, middle = part((101, 10, 114, 20), spare=True), part((101, 10, 115, 20), (130, 10, 140, 20))
    assert joined({LEFT: left, MIDDLE: middle})[0] == [(101, 10, 115, 20), (130, 10, 140, 20)]


def test_a_spare_footprint_that_the_rim_cuts_is_left_out():
    found = Footprints.of([shapely.box(101, 10, 120, 20)])
    assert len(owned(found, LEFT, (0.0, 0.0, 120.0, 100.0), WHOLE)) == 0


def test_the_order_of_the_parts_does_not_matter():
    rng = np.random.default_rng(0)
    boxes = [(x, y, x + 12, y + 12) for x, y in rng.uniform(0, 280, (60, 2)).tolist()]
    parts = {tile: part(*boxes[n::3]) for n, tile in enumerate((LEFT, MIDDLE, RIGHT))}
    turned = dict(reversed(parts.items()))
    assert joined(parts) == joined(turned)


@given(st.integers(0, 2**32 - 1), st.floats(5.0, 60.0))
@examples(20)
def test_strips_joined_one_by_one_are_those_of_all_tiles_together(seed, size):
    """Joined together they are where no strip is settled before the last has come."""
    rng = np.random.default_rng(seed)
    tiles = tiles_over((0.0, 0.0, 200.0, 600.0), 100.0)
    parts = {}
    for tile in tiles:
        corner = rng.uniform(-30.0, 130.0 - size / 2, (6, 2)) + tile.core[:2]
        found = Footprints.of([shapely.box(x, y, x + size, y + rng.uniform(5.0, size)) for x, y in corner])
        columns = {"part_of": np.arange(6) // 2, "note": np.array(["a" * (1 + tile.row)] * 6)}
        window = (tile.core[0] - 40, tile.core[1] - 40, tile.core[2] + 40, tile.core[3] + 40)
        parts[tile] = owned(dataclasses.replace(found, attributes=columns), tile, window, (0.0, 0.0, 200.0, 600.0))
    facts = tile_facts(parts.items())
    late = facts._replace(lowest=dict.fromkeys(facts.lowest, -np.inf))
    sets = [list(join_strips(sorted(parts.items()), given_facts, numbers=["part_of"])) for given_facts in (facts, late)]
    one, together = (stacked([strip for strip, _ in strips]) for strips in sets)
    assert shapely.to_wkb(one.polygons).tolist() == shapely.to_wkb(together.polygons).tolist()
    assert one.ids.tolist() == list(range(len(one)))
    for name in ("part_of", "note"):
        assert one.attributes[name].tolist() == together.attributes[name].tolist()
    assert (
        np.sum([done for _, done in sets[0]], axis=0).tolist() == np.sum([done for _, done in sets[1]], axis=0).tolist()
    )


def test_a_strip_is_complete_before_the_last_one_has_come():
    parts = [(Tile(row, 0, 100.0), part((10, 100 * row + 10, 30, 100 * row + 90))) for row in range(4)]
    read = []

    def following():
        for item in parts:
            read.append(item[0].row)
            yield item

    strips = join_strips(following(), tile_facts(parts))
    first, _ = next(strips)
    assert len(first) == 1
    assert read == [0, 1]  # the next row is looked at only to know that the first is complete
    assert [len(strip) for strip, _ in strips] == [1, 1, 1]


def test_an_attribute_that_some_tiles_lack_is_left_out():
    found, _ = join_tiles({LEFT: part((1, 1, 9, 9), height=[3.0]), RIGHT: part((210, 1, 219, 9))}, crs=None)
    assert len(found) == 2
    assert not found.attributes


def test_numbers_and_building_ids_stay_unique_over_tiles():
    one = part((10, 10, 20, 20), (20, 10, 30, 20), part_of=[0, 0])
    two = part((150, 10, 160, 20), part_of=[0])
    found, _ = join_tiles({LEFT: one, MIDDLE: two}, crs=None, numbers=("part_of",))
    assert found.attributes["part_of"].tolist() == [0, 0, 1]
    assert CUT not in found.attributes


def test_no_tile_with_footprints_is_a_result():
    found, seams = join_tiles({LEFT: Footprints.empty()}, crs="EPSG:25832")
    assert len(found) == 0
    assert found.crs == "EPSG:25832"
    assert not any(seams)


@pytest.mark.parametrize("name", ["improved", "mpp", "mpp-printed", "ndsm", "original"])
def test_every_detector_declares_a_halo(name):
    assert 0 < DETECTORS.get(name).build().halo < 1000
