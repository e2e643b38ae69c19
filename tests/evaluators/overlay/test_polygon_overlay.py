"""Overlays by GEOS: what is checked, since it can lose polygons."""

import numpy as np
import pytest
import shapely

from roofbench.evaluators.overlay.polygon_overlay import united_area

HOUSES = np.array([shapely.box(0, 0, 5, 9), shapely.box(5, 0, 9, 9), shapely.box(8, 4, 12, 8)])


def test_a_union_that_lost_a_polygon_is_made_anew(monkeypatch):
    assert united_area(HOUSES) == pytest.approx(81 + 3 * 4)
    monkeypatch.setattr("shapely.union", lambda one, two: two)
    assert united_area(HOUSES) == pytest.approx(81 + 3 * 4)


def test_a_block_that_the_union_lost_is_joined_nevertheless(monkeypatch):
    from roofbench import Footprints

    expected = Footprints.of(HOUSES).joined(0.1).areas
    original = shapely.union_all
    monkeypatch.setattr(
        "roofbench.scenes.geodata.footprints.shapely.union_all", lambda parts, **options: original(parts[:-1])
    )
    assert Footprints.of(HOUSES).joined(0.1).areas == pytest.approx(expected)
