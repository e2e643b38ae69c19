"""Compiled vertex distances against GEOS."""

import numpy as np
import pytest
import shapely
from builders.outlines import stars

from roofbench.evaluators.overlay.outline_distances import pair_distances, polis_distances
from roofbench.evaluators.overlay.vertex_distances import vertex_distances
from roofbench.scenes.geodata.footprints import Footprints


@pytest.mark.parametrize("offset", [0.0, 6e6])
def test_vertex_distances_are_those_of_geos(offset):
    ring = shapely.box(0, 0, 10, 10) - shapely.box(2, 3, 5, 8)
    parts = shapely.union_all([shapely.box(0, 0, 3, 3), shapely.box(5, 5, 9, 9) - shapely.box(6, 6, 7, 7)])
    moved = [shapely.affinity.translate(polygon, offset, offset) for polygon in (ring, parts, shapely.box(1, 1, 4, 9))]
    one = Footprints.of([*stars(1, 50, 10, offset).polygons, *moved])
    two = Footprints.of([*stars(2, 50, 7, offset).polygons, *moved[::-1]])
    rows = np.arange(len(one))
    expected = polis_distances(one.polygons, two.polygons)
    np.testing.assert_allclose(
        vertex_distances(one.rings, two.rings, rows, rows), expected, rtol=0, atol=1e-12 + 4e-16 * offset
    )
    assert (expected > 0).sum() >= 50


def test_many_pairs_give_the_distances_of_few(monkeypatch):
    one, two = stars(3, 30, 9), stars(4, 30, 12)
    pairs = np.arange(30), np.arange(30)
    few = pair_distances(one, two, pairs)
    monkeypatch.setattr("roofbench.evaluators.overlay.outline_distances._MANY_OUTLINES", 1)
    monkeypatch.setattr("roofbench.evaluators.overlay.vertex_distances._CHUNK", 8)
    many = pair_distances(one, two, pairs)
    np.testing.assert_allclose(many.polis, few.polis, rtol=0, atol=1e-12)


def test_many_quadrilaterals_have_the_corner_distances_of_few(monkeypatch):
    rng = np.random.default_rng(5)
    corners = np.array([(0.0, 0), (9, 1), (10, 8), (-1, 7)])
    one, two = (
        [
            np.roll(corners + rng.normal(0, 0.5, (4, 2)), int(rng.integers(4)), axis=0)[:: rng.choice([-1, 1])]
            for _ in range(40)
        ]
        for _ in range(2)
    )
    sides = Footprints.from_rectangles(one), Footprints.from_rectangles(two)
    pairs = np.arange(40), np.arange(40)
    few = pair_distances(*sides, pairs)
    monkeypatch.setattr("roofbench.evaluators.overlay.outline_distances._MANY_PAIRS", 1)
    many = pair_distances(*sides, pairs)
    assert many.by_corners.all()
    np.testing.assert_allclose(many.outline, few.outline, rtol=0, atol=1e-12)
    np.testing.assert_allclose(many.polis, few.polis, rtol=0, atol=1e-12)


def test_many_polygons_are_checked_as_few_are(monkeypatch):
    monkeypatch.setattr("roofbench.scenes.geodata.polygon_repair._CHUNK", 8)
    bow_tie = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
    dart = shapely.Polygon([(0, 0), (4, 0), (1, 1), (0, 4)])
    flat = shapely.Polygon([(6e6, 6e6), (6e6 + 10, 6e6), (6e6 + 20, 6e6 + 1e-9), (6e6 + 5, 6e6 + 3)])
    polygons = [*stars(3, 30, 9).polygons, shapely.box(0, 0, 1, 1), bow_tie, dart, flat, shapely.box(3, 0, 2, 1)]
    found = Footprints.of(polygons)
    assert [repair.id for repair in found.repairs] == np.flatnonzero(~shapely.is_valid(polygons)).tolist() == [31]


@pytest.mark.parametrize("many", [False, True], ids=["few", "many"])
def test_long_outlines_have_the_same_distances_by_an_index(monkeypatch, many):
    """Without it the time of a pair is the product of the numbers of vertices: hours for a million on each side."""
    ring = shapely.box(0, 0, 10, 10) - shapely.box(2, 3, 5, 8)
    parts = shapely.union_all([shapely.box(0, 0, 3, 3), shapely.box(5, 5, 9, 9) - shapely.box(6, 6, 7, 7)])
    one = Footprints.of([*stars(3, 30, 9).polygons, shapely.segmentize(ring, 0.1), shapely.segmentize(parts, 0.3)])
    two = Footprints.of([*stars(4, 30, 120).polygons, parts, shapely.segmentize(ring, 0.01)])
    pairs = np.arange(32), np.arange(32)
    plain = pair_distances(one, two, pairs)
    monkeypatch.setattr("roofbench.evaluators.overlay.outline_distances._LONG", 100)
    monkeypatch.setattr("roofbench.evaluators.overlay.outline_distances._CHUNK", 64)
    if many:
        monkeypatch.setattr("roofbench.evaluators.overlay.outline_distances._MANY_OUTLINES", 1)
    indexed = pair_distances(one, two, pairs)
    np.testing.assert_allclose(indexed.polis, plain.polis, rtol=0, atol=1e-12)
    np.testing.assert_allclose(indexed.outline, plain.outline, rtol=0, atol=1e-12)
