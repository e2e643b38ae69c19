"""Shared, missed and false areas against exact rational numbers."""

import numpy as np
import pytest
import shapely
from builders.footprint_sets import footprints_on_a_lattice, random_detections, random_reference
from harness import effort
from hypothesis import example, given
from hypothesis import strategies as st
from naive.exact_areas import exact_areas, snapped

import roofbench as rb
from roofbench.evaluators.threshold_free.evaluator import ThresholdFree


def scene(seed, kind):
    rng = np.random.default_rng(seed)
    if kind == "lattice":
        return [footprints_on_a_lattice(rng, rng.integers(1, 6)) for _ in range(2)]
    reference, _ = random_reference(rng, general=kind == "polygons")
    sides = random_detections(rng, reference), reference
    return [[new for polygon in side if (new := snapped(polygon)) is not None] for side in sides]


def assert_exact(detected, reference):
    evaluation = ThresholdFree().evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference))
    count = len(detected)
    partner = evaluation.graph.correspondence.of_detection.tolist()
    false = evaluation.verdicts.detections["verdict"].to_numpy() == "FP"
    pairs = [(d, count + r) for d, r in enumerate(partner) if r >= 0]
    taken = {r for _, r in pairs}
    wrong = {d for d in range(count) if false[d]}
    missed = {count + r for r in range(len(reference))} - taken

    def true_positive(inside):
        return any(d in inside and r in inside for d, r in pairs)

    def commission(inside):
        return not true_positive(inside) and (inside & wrong or any(d in inside and r not in inside for d, r in pairs))

    def omission(inside):
        return not true_positive(inside) and (inside & missed or any(r in inside and d not in inside for d, r in pairs))

    overlaps = evaluation.graph.overlaps
    shared = [
        lambda inside, d=int(d), r=count + int(r): d in inside and r in inside
        for d, r in zip(overlaps.first, overlaps.second, strict=True)
    ]
    exact = exact_areas([*detected, *reference], [true_positive, commission, omission, *shared])
    areas = evaluation.tallies.areas
    found = [areas.true_positive, areas.false_positive, areas.false_negative, *overlaps.area]
    scale = max(1.0, float(sum(exact[:3])))
    assert found == pytest.approx([float(value) for value in exact], rel=1e-9, abs=1e-9 * scale)


@pytest.mark.parametrize("kind", ["rectangles", "polygons", "lattice"])
@pytest.mark.parametrize("seed", range(effort.of(5, 1000)))
def test_areas_are_those_of_exact_rationals(seed, kind):
    assert_exact(*scene(seed, kind))


def box(x, y, width, depth):
    return shapely.box(x, y, x + width, y + depth)


#: Scenes that once were wrong in some program, or that search found near a rule's border.
ADVERSARIAL = {
    "a common edge, moved by the smallest step": ([box(0, 0, 10, 10)], [box(10 - 1 / 64, 0, 10, 10)]),
    "a corner that touches an edge": ([shapely.Polygon([(0, 0), (10, 5), (0, 10)])], [box(10, 0, 5, 10)]),
    "one in the court of another": ([box(4, 4, 2, 2)], [box(0, 0, 10, 10) - box(3, 3, 4, 4)]),
    "the same twice": ([box(0, 0, 10, 10), box(0, 0, 10, 10)], [box(0, 0, 10, 10), box(0, 0, 10, 10)]),
    "a sliver of one step": ([box(0, 0, 100, 1 / 64)], [box(0, 0, 100, 10)]),
    "far from the origin": ([box(6e6, 5e5, 10, 10)], [box(6e6 + 1 / 64, 5e5, 10, 10)]),
    "teeth in teeth": (
        [shapely.union_all([box(0, 0, 1, 9), *(box(1, 2 * k, 8, 1) for k in range(5))])],
        [shapely.union_all([box(9, 0, 1, 10), *(box(2, 2 * k + 1, 8, 1) for k in range(4))])],
    ),
    "a star on a square": (
        [shapely.Polygon([(8, 0), (9, 7), (16, 8), (9, 9), (8, 16), (7, 9), (0, 8), (7, 7)])],
        [box(4, 4, 8, 8)],
    ),
    "a chain in which each covers half of the next": (
        [box(10 * k, 0, 10, 10) for k in range(4)],
        [box(10 * k + 5, 0, 10, 10) for k in range(4)],
    ),
}


@pytest.mark.parametrize("name", ADVERSARIAL)
def test_areas_of_adversarial_scenes_are_exact(name):
    detected, reference = ADVERSARIAL[name]
    assert_exact(detected, reference)
    assert_exact(reference, detected)


steps = st.integers(0, 12)
triangles = st.tuples(*[st.tuples(steps, steps)] * 3).map(shapely.Polygon).filter(lambda shape: shape.area > 0)
boxes = st.tuples(steps, steps, st.integers(1, 6), st.integers(1, 6)).map(lambda found: box(*found))
sides = st.lists(triangles | boxes, min_size=1, max_size=4)


@effort.examples(40)
@given(sides, sides)
@example([box(0, 0, 2, 2), box(1, 1, 2, 2)], [box(0, 0, 3, 3)])
@example([shapely.Polygon([(0, 0), (2, 2), (0, 2)])], [shapely.Polygon([(0, 0), (2, 2), (2, 0)])])
@example([shapely.Polygon([(0, 0), (12, 1), (12, 0)])], [shapely.Polygon([(0, 0), (12, 1), (0, 1)]), box(0, 0, 1, 1)])
def test_areas_of_whatever_shares_edges_and_corners_are_exact(detected, reference):
    assert_exact(detected, reference)
