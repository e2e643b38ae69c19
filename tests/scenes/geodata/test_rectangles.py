import numpy as np
import pytest
import shapely
from harness.effort import examples, of
from hypothesis import example, given
from hypothesis import strategies as st
from shapely import Polygon, affinity, box

import roofbench as rb
from roofbench.scenes.geodata.rectangles import _cell_areas, as_rectangles, decompose

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
    # Without a grid, overlays of outlines that nearly coincide fail or lose areas.
    covered = shapely.union_all([Polygon(part) for part in parts], grid_size=1e-7)
    common = shapely.intersection(polygon, covered, grid_size=1e-7).area
    return common / (polygon.area + covered.area - common)


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


def fit_of(shape, **options):
    """Return the number of rectangles of a shape and their agreement."""
    rectangles, fit = as_rectangles(rb.Footprints.of([shape]), **options)
    assert len(rectangles.quadrilaterals[0]) == len(rectangles)
    return len(rectangles), fit.agreement


@pytest.mark.parametrize("name", SHAPES)
def test_no_rotation_size_or_place_changes_the_rectangles(name):
    shape, count = SHAPES[name]
    rng = np.random.default_rng(0)
    for angle in np.linspace(0, np.pi, of(3001 if name == "T" else 501, 30_001)):
        scale = 10 ** rng.uniform(-1, 3) / 30
        turned = affinity.rotate(affinity.scale(shape, scale, scale), angle, use_radians=True)
        placed = affinity.translate(turned, *rng.uniform(-6e6, 6e6, 2))
        found, similar = fit_of(placed, tolerance=0.5 * scale, smallest=4 * scale**2)
        assert (found, similar > 0.999) == (count, True), (angle, scale)


sides, turns = st.floats(5, 40), st.floats(0, 180)
places = st.floats(-6e6, 6e6)


@given(sides, sides, sides, sides, st.floats(0, 90), st.integers(0, 3))
@examples(60)
def test_two_rectangles_with_a_common_corner_are_found_again(width, depth, arm, thickness, angle, corner):
    shape = shapely.union(box(0, 0, width, depth), box(0, 0, min(thickness, width), depth + arm))
    turned = affinity.rotate(affinity.rotate(shape, 90 * corner), angle)
    assert agreement(turned, decompose(turned)) > 0.9


def crossing(width, depth, length, thickness, turn, other, shift):
    first, second = box(-width / 2, -depth / 2, width / 2, depth / 2), box(0, 0, length, thickness)
    return shapely.union(affinity.rotate(first, turn), affinity.translate(affinity.rotate(second, other), *shift))


@given(sides, sides, sides, sides, turns, turns, st.tuples(st.floats(-10, 5), st.floats(-10, 5)), places, places)
@example(5.0, 5.0, 5.0, 5.0, 0.0, 84.0, (0.0, -3.5), 0.0, 0.0)
@example(5.0, 5.0, 5.0, 5.0, 0.0, 39.0, (1.75, 1.625), 0.0, 0.0)
@example(5.0, 38.0, 38.0, 5.0, 104.5, 16.5, (-7.0, 2.0), 0.0, 0.0)  # 2 degrees apart
@examples(300)
def test_rectangles_that_cross_at_any_angle_are_covered(width, depth, length, thickness, turn, other, shift, x, y):
    pair = crossing(width, depth, length, thickness, turn, other, shift)
    # By default a rectangle brings at least 4 m2, which is a tenth of two squares of 5 m.
    found, similar = fit_of(affinity.translate(pair, x, y), smallest=0.02 * pair.area)
    assert similar > 0.85
    assert found <= 8


@given(st.floats(3, 9), st.floats(3, 9), st.floats(10, 40), st.floats(10, 40), turns, places, places)
@examples(300)
def test_a_cross_is_two_rectangles(across, thick, width, depth, angle, x, y):
    cross = shapely.union(box(-width, -across, width, across), box(-thick, -depth, thick, depth))
    found, similar = fit_of(affinity.translate(affinity.rotate(cross, angle), x, y))
    assert found <= 2
    # At worst the box around both, which has shares t and u of its sides, counts as much as one of the two: what lies
    # outside, (1 - t)(1 - u), is at most (1 - t) / 4 of the box then, so u >= 3/4, and with t >= u at most 1/16.
    assert similar > 15 / 16 - 1e-6


@given(st.integers(0, 2**32 - 1))
@examples(60)
def test_the_areas_of_cells_are_those_of_overlays(seed):
    rng = np.random.default_rng(seed)
    angles, radii = np.sort(rng.uniform(0, 2 * np.pi, 12)), rng.uniform(2, 10, 12)
    outer = Polygon(np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)).buffer(0)
    polygon = shapely.difference(outer, shapely.Point(rng.uniform(-3, 3, 2)).buffer(1.5, quad_segs=2))
    rings = shapely.get_rings(shapely.orient_polygons(shapely.get_parts(polygon)))
    edges = np.concatenate([np.stack([p[:-1], p[1:]], axis=1) for p in map(shapely.get_coordinates, rings)])
    x, y = np.sort(rng.uniform(-12, 12, 6)), np.sort(rng.uniform(-12, 12, 5))
    cells = box(*np.meshgrid(x[:-1], y[:-1]), *np.meshgrid(x[1:], y[1:]))
    expected = shapely.area(shapely.intersection(polygon, cells))
    assert _cell_areas(edges, x, y) == pytest.approx(expected, abs=1e-9)


def test_areas_of_cells_without_edges_or_cells_are_zero_or_none():
    lines = np.array([0.0, 1.0, 2.0])
    assert _cell_areas(np.empty((0, 2, 2)), lines, lines[:2]).tolist() == [[0.0, 0.0]]
    assert _cell_areas(np.empty((0, 2, 2)), lines[:0], lines).shape == (2, 0)
