import numpy as np
import pytest
import shapely
from harness.effort import examples
from hypothesis import given
from hypothesis import strategies as st
from shapely import Polygon, affinity, box

import roofbench as rb
from roofbench.scenes.geodata.rectangles import as_rectangles, decompose

L_SHAPE = shapely.union(box(0, 0, 20, 8), box(0, 0, 7, 25))
SHAPES = {
    "I": (box(0, 0, 12, 8), 1),
    "L": (L_SHAPE, 2),
    "T": (shapely.union(box(0, 10, 30, 20), box(10, 0, 18, 20)), 2),
    "U": (shapely.union_all([box(0, 0, 6, 20), box(0, 0, 30, 6), box(24, 0, 30, 20)]), 3),
    "C with a court": (shapely.difference(box(0, 0, 40, 40), box(10, 10, 30, 30)), 4),
    "plus": (shapely.union(box(10, 0, 20, 30), box(0, 10, 30, 20)), 2),
    "steps": (shapely.union_all([box(0, 0, 10, 30), box(10, 0, 20, 20), box(20, 0, 30, 10)]), 3),
}


def agreement(polygon, parts):
    covered = shapely.union_all([Polygon(part) for part in parts])
    return shapely.intersection(polygon, covered).area / shapely.union(polygon, covered).area


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("angle", [0, 17, 45, 80])
def test_a_right_angled_shape_is_exactly_its_rectangles(name, angle):
    shape, count = SHAPES[name]
    turned = affinity.translate(affinity.rotate(shape, angle), 500_000, 5_700_000)
    parts = decompose(turned)
    assert len(parts) == count
    assert agreement(turned, parts) > 0.999


def test_the_parts_of_an_l_overlap_in_its_corner():
    long, short = (Polygon(part) for part in decompose(L_SHAPE))
    assert sorted([long.area, short.area]) == pytest.approx([160, 175])
    assert shapely.intersection(long, short).area == pytest.approx(56)


def test_rectangles_have_right_angles():
    for part in decompose(affinity.rotate(SHAPES["U"][0], 33)):
        edges = np.roll(part, -1, axis=0) - part
        assert abs((edges * np.roll(edges, -1, axis=0)).sum(axis=1)).max() < 1e-6


def test_a_bay_window_and_a_bent_wall_do_not_multiply_the_parts():
    corners = [(0, 0), (15, 0.2), (15, 10), (9, 10.1), (9, 10.6), (6, 10.6), (6, 10), (0, 9.8)]
    parts = decompose(Polygon(corners))
    assert len(parts) == 1
    assert agreement(Polygon(corners), parts) > 0.95


def test_a_wing_in_another_direction_gets_its_own_direction():
    wing = affinity.rotate(box(18, 0, 50, 10), 30, origin=(18, 5))
    shape = shapely.union(box(0, 0, 22, 40), wing)
    parts = decompose(shape)
    assert agreement(shape, parts) > 0.9
    assert any(abs(np.degrees(np.arctan2(*(part[1] - part[0])[::-1])) % 90 - 30) < 2 for part in parts)


def test_a_round_tower_becomes_a_few_rectangles():
    tower = shapely.Point(0, 0).buffer(10, quad_segs=32)
    parts = decompose(tower)
    assert len(parts) <= 9
    assert agreement(tower, parts) > 0.85


@pytest.mark.parametrize(
    "tiny",
    [box(0, 0, 0.1, 0.1), Polygon([(0, 0), (1, 0), (0, 1)]), box(0, 0, 30, 0.01), Polygon([(0, 0), (30, 0), (0, 0.2)])],
)
def test_even_the_smallest_footprint_gives_a_rectangle(tiny):
    parts = decompose(tiny)
    assert len(parts) >= 1
    assert all(Polygon(part).area > 0 for part in parts)


def test_a_multipolygon_keeps_all_its_parts():
    both = shapely.union(box(0, 0, 10, 10), affinity.rotate(box(40, 0, 60, 10), 20))
    assert agreement(both, decompose(both)) > 0.99


def test_rectangles_share_the_building_of_their_footprint():
    footprints = rb.Footprints.of(
        [box(100, 0, 110, 10), None, L_SHAPE, box(20, 0, 25, 8)],
        building_ids=["p", "?", "q", "q"],
        attributes={"height": [3.0, 0.0, 5.0, 6.0]},
        crs="EPSG:25832",
    )
    rectangles, fit = as_rectangles(footprints)
    assert len(rectangles.quadrilaterals[0]) == len(rectangles) == 4
    assert rectangles.building_ids.tolist() == ["p", "q", "q", "q"]
    assert rectangles.attributes["footprint"].tolist() == [0, 2, 2, 3]
    assert rectangles.attributes["height"].tolist() == [3.0, 5.0, 5.0, 6.0]
    assert rectangles.crs == "EPSG:25832"
    assert (fit.footprints, fit.rectangles, fit.poor) == (3, 4, ())
    assert fit.agreement == pytest.approx(1.0)


def test_without_building_ids_the_footprint_is_the_building():
    rectangles, _ = as_rectangles(rb.Footprints.of([L_SHAPE, affinity.translate(L_SHAPE, 100)]))
    assert rectangles.building_codes.tolist() == [0, 0, 1, 1]


def test_footprints_that_do_not_fit_are_named():
    ring = shapely.difference(shapely.Point(0, 0).buffer(30), shapely.Point(0, 0).buffer(27))
    _, fit = as_rectangles(rb.Footprints.of([box(100, 0, 110, 10), ring]))
    assert fit.poor == (1,)
    assert fit.agreement < 0.9


def test_no_footprints_give_no_rectangles():
    rectangles, fit = as_rectangles(rb.Footprints.empty(crs="EPSG:25832"))
    assert (len(rectangles), fit.agreement, rectangles.crs) == (0, 1.0, "EPSG:25832")


sides = st.floats(5, 40)


@given(sides, sides, sides, sides, st.floats(0, 90), st.integers(0, 3))
@examples(60)
def test_two_crossing_rectangles_are_found_again(width, depth, arm, thickness, angle, corner):
    shape = shapely.union(box(0, 0, width, depth), box(0, 0, min(thickness, width), depth + arm))
    turned = affinity.rotate(affinity.rotate(shape, 90 * corner), angle)
    assert agreement(turned, decompose(turned)) > 0.9


@given(st.floats(0, 360), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
@examples(30)
def test_turning_and_moving_changes_nothing(angle, east, north):
    turned = affinity.translate(affinity.rotate(SHAPES["T"][0], angle), east, north)
    parts = decompose(turned)
    assert len(parts) == 2
    assert agreement(turned, parts) > 0.999
