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
    np.testing.assert_allclose(vertex_distances(one, two, rows, rows), expected, rtol=0, atol=1e-12 + 4e-16 * offset)
    assert (expected > 0).sum() >= 50


def test_many_pairs_give_the_distances_of_few(monkeypatch):
    one, two = stars(3, 30, 9), stars(4, 30, 12)
    pairs = np.arange(30), np.arange(30)
    few = pair_distances(one, two, pairs)
    monkeypatch.setattr("roofbench.evaluators.overlay.outline_distances._MANY_OUTLINES", 1)
    monkeypatch.setattr("roofbench.evaluators.overlay.outline_distances._MOST_VERTEX_PAIRS", 130)
    monkeypatch.setattr("roofbench.evaluators.overlay.vertex_distances._CHUNK", 8)
    many = pair_distances(one, two, pairs)
    np.testing.assert_allclose(many.polis, few.polis, rtol=0, atol=1e-12)
