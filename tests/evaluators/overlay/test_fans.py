"""Shared areas by fans, against GEOS and against exact rationals."""

import math
from fractions import Fraction

import numpy as np
import pytest
import shapely
from builders.outlines import star, stars
from hypothesis import assume, given
from hypothesis import strategies as st

from roofbench.evaluators.overlay.fans import fan_areas
from roofbench.evaluators.overlay.outline_arrays import outlines_of
from roofbench.scenes.geodata.footprints import Footprints


def area_of(one, two, **options):
    sides = outlines_of(Footprints.of([one])), outlines_of(Footprints.of([two]))
    row = np.zeros(1, dtype=np.int64)
    return float(fan_areas(*sides, row, row, **options)[0])


@pytest.mark.parametrize("vertices", [3, 5, 10, 30, 100])
@pytest.mark.parametrize("offset", [0.0, 6e6])
def test_shared_areas_are_those_of_geos(vertices, offset):
    one, two = stars(1, 200, vertices, offset), stars(2, 200, vertices, offset)
    rows = np.arange(200)
    found = fan_areas(outlines_of(one), outlines_of(two), rows, rows)
    # GEOS overlays coordinates of 6e6 m with errors of 1e-9 m along edges of some 10 m.
    np.testing.assert_allclose(found, shapely.area(shapely.intersection(one.polygons, two.polygons)), rtol=0, atol=1e-8)


def exact_area(one, two):
    """Clip a polygon by a convex one in rational numbers (Sutherland & Hodgman 1974)."""
    ring = [(Fraction(x), Fraction(y)) for x, y in shapely.get_coordinates(one)[:-1]]
    window = [(Fraction(x), Fraction(y)) for x, y in shapely.get_coordinates(shapely.orient_polygons(two))[:-1]]
    for (ax, ay), (bx, by) in zip(window, window[1:] + window[:1], strict=True):
        side = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in ring]
        clipped = []
        for k, (x, y) in enumerate(ring):
            (nx, ny), a, b = ring[(k + 1) % len(ring)], side[k], side[(k + 1) % len(ring)]
            if a >= 0:
                clipped.append((x, y))
            if (a > 0 > b) or (a < 0 < b):
                part = a / (a - b)
                clipped.append((x + part * (nx - x), y + part * (ny - y)))
        ring = clipped
    doubled = sum(x * ny - nx * y for (x, y), (nx, ny) in zip(ring, ring[1:] + ring[:1], strict=True))
    return abs(doubled) / 2


@pytest.mark.parametrize("offset", [0.0, 6e6])
def test_shared_areas_are_those_of_exact_rationals(offset):
    rng = np.random.default_rng(3)
    for one in stars(4, 60, 9, offset).polygons:
        two = star(rng, 3, rng.uniform(-4, 4, 2) + offset)
        assert area_of(one, two) == pytest.approx(float(exact_area(one, two)), abs=1e-12 * two.area)


@pytest.mark.parametrize("offset", [0.0, 6e6])
@pytest.mark.parametrize("slip", [0.0, 1e-9, 1e-7])
def test_edges_that_nearly_coincide_are_measured_as_exact_rationals_do(offset, slip):
    rng = np.random.default_rng(9)
    for _ in range(40):
        angle, x, y = rng.uniform(0, 360), *(rng.uniform(-4, 4, 2) + offset)
        house = shapely.affinity.rotate(shapely.box(x, y, x + 9.1, y + 7.3), angle, origin=(x, y))
        hole = shapely.affinity.rotate(shapely.box(x + 2, y + 2, x + 5, y + 4), angle, origin=(x, y))
        copy = shapely.affinity.translate(shapely.affinity.rotate(house, slip, origin=(x, y)), slip, -slip)
        exact = exact_area(house, copy) - exact_area(hole, copy)
        assert area_of(house - hole, copy) == pytest.approx(float(exact), abs=1e-12 * copy.area + 1e-9)


grid = st.integers(0, 6)
boxes = st.tuples(grid, grid, st.integers(1, 5), st.integers(1, 5))


@given(
    st.lists(boxes, min_size=1, max_size=5), st.lists(boxes, min_size=1, max_size=5), st.sampled_from([0.1, 1.0, 7.3])
)
def test_unions_of_boxes_with_common_edges_holes_and_parts(one, two, scale):
    sides = [
        shapely.union_all([shapely.box(x * scale, y * scale, (x + w) * scale, (y + h) * scale) for x, y, w, h in side])
        for side in (one, two)
    ]
    expected = shapely.area(shapely.intersection(*sides))
    smaller = min(side.area for side in sides)
    assert area_of(*sides) == pytest.approx(expected, abs=1e-11 * smaller)
    assert area_of(*sides) == pytest.approx(area_of(*sides[::-1]), abs=1e-12 * smaller)


@given(st.integers(0, 10_000), st.integers(3, 12), st.floats(0, 2 * math.pi))
def test_areas_do_not_depend_on_direction_of_rings_or_rotation(seed, vertices, angle):
    rng = np.random.default_rng(seed)
    one, two = star(rng, vertices, (0.0, 0.0)), star(rng, vertices, rng.uniform(-3, 3, 2))
    assume(one.is_valid and two.is_valid)
    area = area_of(one, two)
    assert area_of(shapely.reverse(one), two) == pytest.approx(area, abs=1e-11)
    turned = [shapely.affinity.rotate(side, angle, origin=(0, 0), use_radians=True) for side in (one, two)]
    assert area_of(*turned) == pytest.approx(area, abs=1e-10)


def test_a_hole_takes_its_ground_away():
    ring = shapely.box(0, 0, 10, 10) - shapely.box(2, 2, 8, 8)
    assert area_of(ring, shapely.box(3, 3, 7, 7)) == 0
    assert area_of(ring, shapely.box(1, 1, 5, 5)) == pytest.approx(16 - 9)


def test_polygons_that_touch_share_nothing_and_copies_share_all():
    rng = np.random.default_rng(5)
    for _ in range(50):
        angle, x = rng.uniform(0, 360), rng.uniform(0, 6e6)
        house, neighbour = (
            shapely.affinity.rotate(shapely.box(x + k, x, x + k + 7.3, x + 9.1), angle, origin=(x, x)) for k in (0, 7.3)
        )
        assert area_of(house, neighbour) <= 1e-8  # rotated corners are rounded: a sliver may be real
        assert area_of(house, house) == house.area
    assert area_of(shapely.box(0, 0, 3, 3), shapely.box(3, 0, 5, 3)) == 0
    assert area_of(shapely.box(0, 0, 3, 3), shapely.box(3, 3, 5, 5)) == 0


def test_threads_do_not_change_a_bit(monkeypatch):
    monkeypatch.setattr("roofbench.evaluators.overlay.fans._CHUNK", 16)
    sides = outlines_of(stars(6, 100, 12)), outlines_of(stars(7, 100, 8))
    rows = np.arange(100)
    alone, shared = (fan_areas(*sides, rows, rows, threads=threads) for threads in (1, 3))
    assert (alone == shared).all()
    assert (alone > 0).any()
