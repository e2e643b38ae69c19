"""Exact areas against unions of polygons, one by one."""

from functools import reduce

import numpy as np
import pytest
import shapely
from builders.footprint_sets import footprints_on_a_lattice, random_detections, random_reference
from hypothesis import given
from hypothesis import strategies as st

import roofbench as rb
from roofbench.evaluators.overlay.areas import AreaTally, exact_areas
from roofbench.evaluators.overlay.overlaps import overlaps_between, overlaps_within


def tally(detected, reference, pairs, alarms=(), missed=()):
    one, two = rb.Footprints.of(detected), rb.Footprints.of(reference)
    rows = [np.array([pair[side] for pair in pairs], dtype=np.int64) for side in (0, 1)]
    shared = shapely.area(shapely.intersection(one.polygons[rows[0]], two.polygons[rows[1]]))
    return exact_areas(
        one,
        two,
        (rows[0], rows[1]),
        shared,
        false_positives=np.array(alarms, dtype=np.int64),
        false_negatives=np.array(missed, dtype=np.int64),
        within=(overlaps_within(one), overlaps_within(two)),
    )


def union(polygons):
    # shapely.union_all loses a polygon of the random sets of seed 636 (GEOS 3.14.1).
    return reduce(shapely.union, polygons, shapely.Polygon())


def by_unions(detected, reference, pairs, alarms, missed):
    """T, F and M as the definition words them."""
    found = union([detected[d] & reference[r] for d, r in pairs])
    excess = union([*(detected[d] - reference[r] for d, r in pairs), *(detected[d] for d in alarms)])
    lacking = union([*(reference[r] - detected[d] for d, r in pairs), *(reference[r] for r in missed)])
    return found.area, (excess - found).area, (lacking - found).area


def test_a_shifted_pair_an_alarm_and_a_miss_by_hand():
    detected = [shapely.box(1, 0, 11, 10), shapely.box(100, 0, 104, 5)]
    reference = [shapely.box(0, 0, 10, 10), shapely.box(50, 0, 53, 10)]
    assert tally(detected, reference, [(0, 0)], alarms=[1], missed=[1]) == AreaTally(
        true_positive=90.0,
        false_positive=10.0 + 20.0,
        false_negative=10.0 + 30.0,
        pair_detected=100.0,
        pair_reference=100.0,
        pair_shared=90.0,
    )


def test_a_place_that_is_missed_once_and_found_once_is_found():
    # The second reference lies under the first pair: its ground is found already.
    found = tally(
        [shapely.box(0, 0, 10, 10)], [shapely.box(0, 0, 10, 10), shapely.box(0, 0, 5, 5)], [(0, 0)], missed=[1]
    )
    assert (found.true_positive, found.false_positive, found.false_negative) == (100.0, 0.0, 0.0)


def test_nothing_has_no_area():
    assert tally([], [], []) == AreaTally()


@pytest.mark.parametrize("lattice", [False, True], ids=["random sets", "coinciding edges"])
@given(seed=st.integers(0, 10**6))
def test_areas_are_those_of_the_unions(lattice, seed):
    rng = np.random.default_rng(seed)
    if lattice:
        detected, reference = (footprints_on_a_lattice(rng, int(rng.integers(0, 9))) for _ in range(2))
    else:
        reference, _ = random_reference(rng, general=True)
        detected = random_detections(rng, reference)
    overlaps = overlaps_between(rb.Footprints.of(detected), rb.Footprints.of(reference)).only_significant
    pairs, taken = [], (set(), set())
    for d, r in zip(overlaps.first.tolist(), overlaps.second.tolist(), strict=True):
        if d not in taken[0] and r not in taken[1]:
            pairs.append((d, r))
            taken[0].add(d)
            taken[1].add(r)
    alarms = [d for d in range(len(detected)) if d not in taken[0] and rng.random() < 0.7]
    missed = [r for r in range(len(reference)) if r not in taken[1]]
    found = tally(detected, reference, pairs, alarms, missed)
    expected = by_unions(detected, reference, pairs, alarms, missed)
    scale = max(1.0, sum(polygon.area for polygon in [*detected, *reference]))
    assert (found.true_positive, found.false_positive, found.false_negative) == pytest.approx(
        expected, abs=1e-9 * scale
    )
