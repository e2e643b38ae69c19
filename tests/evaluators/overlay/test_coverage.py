"""Coverage of both sides against loops over polygons."""

import numpy as np
import pytest
import shapely
from builders.footprint_sets import footprints_on_a_lattice, random_detections, random_reference
from naive.systems import covered_share, main_partner, touched

import roofbench as rb
from roofbench.core.errors import CRSError
from roofbench.evaluators.overlay.coverage import counted_sets


def sets_of(seed):
    rng = np.random.default_rng(seed)
    if seed % 2:
        return [footprints_on_a_lattice(rng, int(rng.integers(0, 9))) for _ in range(2)]
    reference, _ = random_reference(rng, general=True)
    return random_detections(rng, reference), reference


@pytest.mark.parametrize("seed", range(40))
def test_shares_partners_and_numbers_are_those_of_plain_loops(seed):
    detected, reference = sets_of(seed)
    sets = counted_sets(rb.Footprints.of(detected), rb.Footprints.of(reference))
    for own, others, coverage in (
        (detected, reference, sets.of_detections),
        (reference, detected, sets.of_references),
    ):
        assert coverage.touched.tolist() == [len(touched(polygon, others)) for polygon in own]
        assert coverage.share == pytest.approx([covered_share(polygon, others) for polygon in own], abs=1e-9)
        for row, polygon in enumerate(own):
            partner = main_partner(polygon, others)
            if partner is None:
                assert (coverage.partner[row], coverage.shared[row]) == (-1, 0.0)
            else:
                best = polygon.intersection(others[partner]).area
                assert coverage.shared[row] == pytest.approx(best)
                assert polygon.intersection(others[coverage.partner[row]]).area == pytest.approx(best)


def test_a_place_that_two_detections_cover_counts_once():
    house = rb.Footprints.of([shapely.box(0, 0, 10, 10)])
    found = rb.Footprints.of([shapely.box(0, 0, 6, 10), shapely.box(4, 0, 8, 10)])
    assert counted_sets(found, house).of_references.share.tolist() == pytest.approx([0.8])


def test_ids_of_partners_are_rows_of_the_source():
    found = rb.Footprints.of([shapely.Polygon(), shapely.box(0, 0, 6, 10)])
    house = rb.Footprints.of([shapely.box(0, 0, 10, 10), shapely.box(50, 0, 60, 10)])
    coverage = counted_sets(found, house).of_references
    assert coverage.partner_ids(found).tolist() == [1, -1]


def test_what_the_area_leaves_out_covers_nothing():
    area = shapely.box(0, 0, 100, 100)
    houses = rb.Footprints.of([shapely.box(0, 0, 10, 10), shapely.box(97, 0, 107, 10)])
    sets = counted_sets(houses, houses, area=area)
    assert sets.of_detections.share.tolist() == [1.0, 0.0]
    assert (sets.left_out.detected, sets.left_out.reference_outside) == (1, 1)


def test_sets_of_two_crs_are_refused():
    one, two = (rb.Footprints.of([shapely.box(0, 0, 9, 9)], crs=crs) for crs in ("EPSG:25832", "EPSG:25833"))
    with pytest.raises(CRSError):
        counted_sets(one, two)
