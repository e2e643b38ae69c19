"""Union areas of groups by slabs, against GEOS, and sums and groups against plain loops."""

import math
from functools import reduce
from itertools import pairwise

import numpy as np
import pytest
import shapely
from builders.footprint_sets import footprints_on_a_lattice, random_detections, random_reference
from builders.outlines import stars
from hypothesis import given
from hypothesis import strategies as st

import roofbench as rb
from roofbench.evaluators.overlay.exact_sum import exact_sum
from roofbench.evaluators.overlay.groups import Members, connected_groups
from roofbench.evaluators.overlay.outline_arrays import outlines_of, polygons_of
from roofbench.evaluators.overlay.united import united_areas


def united(one, two, members, **options):
    sides = outlines_of(rb.Footprints.of(one)), outlines_of(rb.Footprints.of(two))
    start = np.cumsum([0, *map(len, members)])
    rows = np.array([row for group in members for row in group], dtype=np.int64).reshape(-1, 2)
    return united_areas(*sides, Members(start, rows[:, 0].copy(), rows[:, 1].copy()), **options)


def by_geos(one, two, group):
    ground = [one[d] if r < 0 else one[d] & two[r] for d, r in group]
    return reduce(shapely.union, ground, shapely.Polygon()).area


@pytest.mark.parametrize("lattice", [False, True], ids=["random sets", "coinciding edges"])
@pytest.mark.parametrize("offset", [0.0, 6e6])
@given(seed=st.integers(0, 10**6))
def test_united_areas_are_those_of_geos(lattice, offset, seed):
    rng = np.random.default_rng(seed)
    if lattice:
        one, two = (footprints_on_a_lattice(rng, int(rng.integers(2, 9))) for _ in range(2))
    else:
        two, _ = random_reference(rng, general=True)
        one = random_detections(rng, two)
    one, two = ([shapely.affinity.translate(p, offset, offset) for p in side] for side in (one, two))
    if not one or not two:
        return
    groups = [
        [
            (int(rng.integers(len(one))), int(rng.integers(len(two))) if rng.random() < 0.5 else -1)
            for _ in range(rng.integers(1, 7))
        ]
        for _ in range(3)
    ]
    expected = [by_geos(one, two, group) for group in groups]
    np.testing.assert_allclose(united(one, two, groups), expected, rtol=0, atol=1e-9 if offset == 0 else 1e-5)


def test_holes_and_parts_count():
    ring = shapely.box(0, 0, 10, 10) - shapely.box(4, 4, 6, 6)
    pair = shapely.MultiPolygon([shapely.box(20, 0, 22, 2), shapely.box(24, 0, 26, 2)])
    sides = [ring, pair, shapely.box(5, 5, 25, 7)]
    assert united(sides, sides, [[(0, -1)], [(1, -1)], [(0, -1), (2, -1)], [(1, -1), (2, -1), (0, 2)]]).tolist() == [
        96.0,
        8.0,
        96.0 + 1.0 + 15 * 2.0,
        8.0 + 40.0,
    ]


def test_neither_the_order_of_members_nor_threads_change_a_bit(monkeypatch):
    monkeypatch.setattr("roofbench.evaluators.overlay.united._CHUNK", 2)
    polygons = list(stars(3, 40, 12, 6e6).polygons)
    rng = np.random.default_rng(1)
    groups = [[(int(d), int(r)) for d, r in rng.integers(0, 40, (6, 2))] for _ in range(20)]
    turned = [shapely.Polygon(np.roll(shapely.get_coordinates(p)[:-1], 3, axis=0)[::-1]) for p in polygons]
    found = united(polygons, polygons, groups, threads=1)
    assert (united(turned, polygons, [group[::-1] for group in groups], threads=2) == found).all()


def test_groups_with_very_many_crossings_are_left_to_an_overlay():
    combs = [
        shapely.union_all([shapely.box(0, 0, 100, 1), *(shapely.box(k, 0, k + 0.5, 100) for k in range(100))]),
        shapely.union_all([shapely.box(0, 0, 1, 100), *(shapely.box(0, k, 100, k + 0.5) for k in range(100))]),
    ]
    turned = [shapely.affinity.rotate(comb, 10, origin=(0, 0)) for comb in combs]
    assert np.isnan(united(turned, turned, [[(0, -1), (1, -1)]])).all()


def test_outlines_become_polygons_again():
    ring = shapely.box(0, 0, 10, 10) - shapely.box(4, 4, 6, 6)
    polygons = [shapely.MultiPolygon([ring, shapely.box(20, 0, 22, 2)]), ring, shapely.box(0, 0, 1, 2)]
    again = polygons_of(outlines_of(rb.Footprints.of(polygons)), np.arange(3))
    assert [one.normalize() == two.normalize() for one, two in zip(again, polygons, strict=True)] == [True] * 3


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e200, max_value=1e200)))
def test_sums_are_those_of_fsum(values):
    array = np.array(values, dtype=np.float64)
    assert exact_sum(array[:3], array[3:]) == math.fsum(values)


@given(st.lists(st.tuples(st.integers(0, 30), st.integers(0, 30)), max_size=40))
def test_groups_are_those_of_a_plain_search(links):
    first, second = (np.array([link[side] for link in links], dtype=np.int64) for side in (0, 1))
    start, nodes = connected_groups(first, second)
    found = [nodes[a:b].tolist() for a, b in pairwise(start)]
    expected = []
    for node in sorted({node for link in links for node in link}):
        if not any(node in group for group in expected):
            group, waiting = set(), [node]
            while waiting:
                here = waiting.pop()
                if here not in group:
                    group.add(here)
                    waiting += [other for link in links if here in link for other in link]
            expected.append(sorted(group))
    assert found == expected


@pytest.mark.parametrize("along", [(5.0, 0.0), (0.0, 5.0), (4.0, 3.0)])
def test_long_rows_of_houses_are_one_group(along):
    count = 3000
    houses = [shapely.box(0, 0.1 * (k % 7), 5.5, 6) for k in range(count)]
    row = [shapely.affinity.translate(house, k * along[0], k * along[1]) for k, house in enumerate(houses)]
    groups = Members(np.array([0, count]), np.arange(count), np.full(count, -1))
    outlines = outlines_of(rb.Footprints.of(row))
    found = united_areas(outlines, outlines, groups)
    assert found[0] == pytest.approx(shapely.union_all(row).area, rel=1e-9)


@pytest.mark.parametrize("offset", [0.0, 6e6])
def test_dense_blocks_are_measured_strip_by_strip(offset):
    rng = np.random.default_rng(5)
    court = shapely.box(-6, -5, 6, 5) - shapely.box(-1, -1, 1, 1)
    sides = [
        [
            shapely.affinity.translate(
                shapely.affinity.rotate(court, angle), offset + 9 * (k % 50), offset + 9 * (k // 50)
            )
            for k, angle in enumerate(rng.uniform(0, 180, 2500))
        ]
        for _ in range(2)
    ]
    alone, pairs = [(k, -1) for k in range(2500)], [(k, k) for k in range(2500)]
    found = united(*sides, [alone, pairs])
    expected = [shapely.union_all(sides[0]).area, shapely.union_all(shapely.intersection(*sides)).area]
    np.testing.assert_allclose(found, expected, rtol=1e-11 if offset == 0 else 1e-8)
    assert (united(*sides, [alone[::-1], pairs[::-1]]) == found).all()
