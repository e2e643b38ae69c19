"""Corners, turning functions and bands of matched footprints: worked by hand, and against plain loops."""

import numpy as np
import pytest
import shapely
from naive.systems import band_iou, turning_distance
from shapely import affinity

import roofbench as rb
from roofbench.evaluators.overlay import corner_matching, overlaps, turning
from roofbench.evaluators.overlay.corner_matching import match_corners
from roofbench.evaluators.overlay.pair_shapes import boundary_iou
from roofbench.evaluators.overlay.turning import turning_distances


def house(x, width=10.0, y=0.0, depth=10.0):
    return shapely.box(x, y, x + width, y + depth)


L_SHAPE = house(0, 20) | house(0, 10, depth=20)


def evaluate(name, detected, reference, **more):
    return rb.evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference), evaluator=name, **more)


def test_corner_errors_by_hand():
    # A square moved by 0.6 m along a side: four corners 0.6 m off. One of 10 m x 12 m: two corners match exactly.
    found = evaluate("boundary", [house(0.6), house(50, depth=12)], [house(0), house(50)])
    assert found.values["corner.distance"] == pytest.approx(4 * 0.6 / 6)
    assert found.values["corner.completeness"] == found.values["corner.correctness"] == 6 / 8
    assert evaluate("boundary", [house(0.6)], [house(0)], corner_radius=0.5).values["corner.distance"] is None
    # A vertex in the middle of a side costs correctness, not completeness.
    five = shapely.Polygon([(0, 0), (5, 0), (10, 0), (10, 10), (0, 10)])
    values = evaluate("boundary", [five], [house(0)]).values
    assert (values["corner.completeness"], values["corner.correctness"]) == (1.0, 4 / 5)


def test_each_corner_is_matched_once_and_the_nearest_first():
    double = shapely.Polygon([(0, 0), (10, 0), (10, 10), (0.4, 10), (0, 9.5)])  # two corners near (0, 10): 0.4 and 0.5
    matched = match_corners(np.array([double]), np.array([house(0)]), 1.0)
    assert matched.counts.tolist() == [4]
    assert matched.distances.tolist() == pytest.approx([0.4])


@pytest.mark.parametrize("chunk", [1, 40, 1 << 20])
def test_corners_are_matched_whatever_the_number_at_once(chunk, monkeypatch):
    polygons, others = np.array([house(0), house(50), house(99, 3)]), np.array([house(0.3), house(50.1), house(99, 4)])
    whole = match_corners(polygons, others, 2.0)
    monkeypatch.setattr(corner_matching, "_CHUNK", chunk)
    parts = match_corners(polygons, others, 2.0)
    assert parts.counts.tolist() == whole.counts.tolist() == [4, 4, 4]
    assert parts.distances.tolist() == whole.distances.tolist()


def test_turning_functions_compare_shapes_only():
    small = affinity.rotate(affinity.scale(L_SHAPE, 0.3, 0.3), 33)
    others = [L_SHAPE, small, shapely.reverse(L_SHAPE), L_SHAPE | house(500, 1, depth=1)]
    distances = turning_distances(np.array([L_SHAPE] * 4), np.array(others))
    assert distances == pytest.approx(np.zeros(4), abs=2e-7)
    longer = L_SHAPE | house(20)
    assert turning_distances(np.array([longer]), np.array([affinity.scale(longer, -1, 1)]))[0] > 0.1
    # Square and 2 x 1: a right angle apart on a sixth of the way, see `turning_distances`.
    two_to_one = turning_distances(np.array([house(0)]), np.array([house(0, 20)]))[0]
    assert two_to_one == pytest.approx(np.pi / 2 * np.sqrt(5) / 6)
    values = evaluate("boundary", [house(0, 20)], [house(0)]).values
    assert values["regularity.turning_distance"] == pytest.approx(two_to_one)


def test_turning_functions_of_very_many_vertices_are_compared_on_a_lattice(monkeypatch):
    rng = np.random.default_rng(3)
    angles = np.linspace(0, 2 * np.pi, 9)[:-1]
    stars = [
        np.array([shapely.Polygon(np.c_[r * np.cos(angles), r * np.sin(angles)]) for r in rng.uniform(5, 9, (6, 8))])
        for _ in range(2)
    ]
    exact = turning_distances(*stars)
    assert exact == pytest.approx([turning_distance(one, two) for one, two in zip(*stars, strict=True)], abs=1e-6)
    monkeypatch.setattr(turning, "_CHUNK", 1)
    assert turning_distances(*stars) == pytest.approx(exact, abs=1e-3)


def test_many_outlines_have_the_boundary_iou_of_few(monkeypatch):
    houses = [L_SHAPE, house(0, 1.5), house(0) - shapely.box(3, 3, 6, 6), house(0) | house(20, 3)]
    others = [affinity.translate(one, 0.7, -0.4) for one in houses]
    few = boundary_iou(np.array(houses), np.array(others), 1.0)
    monkeypatch.setattr(overlaps, "_MANY_OUTLINES", 0)
    assert boundary_iou(np.array(houses), np.array(others), 1.0) == pytest.approx(few, abs=1e-9)
    assert few == pytest.approx([band_iou(one, two, 1.0) for one, two in zip(houses, others, strict=True)], abs=1e-7)
