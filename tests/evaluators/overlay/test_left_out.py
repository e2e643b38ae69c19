"""The evaluation area and the minimum size decide which footprints count."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.evaluators.overlay.left_out import (
    LeftOut,
    clipped,
    counted_detections,
    counted_references,
    left_out_notes,
    repair_notes,
)
from roofbench.evaluators.overlay.overlaps import overlaps_between

AREA = shapely.box(0, 0, 100, 100)


def house(x, size=10.0):
    return shapely.box(x, 0, x + size, size)


def test_references_count_by_their_centre_and_their_size():
    reference = rb.Footprints.of([house(0), house(95.1), house(94.9), house(50, 2), house(200, 2)])
    counted = counted_references(reference, area=AREA, minimum_area=5.0)
    assert counted.mask.tolist() == [True, False, True, False, False]
    # What lies outside says so, even where it is too small, too.
    outside, small = "left out: its centre lies outside the evaluation area", "left out: smaller than the minimum area"
    assert counted.reasons.tolist() == ["", outside, "", small, outside]
    assert counted_references(reference).mask.all()


def test_detections_without_a_match_are_left_out_outside_or_on_left_out_references_only():
    reference = rb.Footprints.of([house(0), house(97), house(20, 2)])
    detected = rb.Footprints.of([house(1), house(98), house(93), house(20, 3), house(60), house(9.5, 12)])
    references = counted_references(reference, area=AREA, minimum_area=5.0)
    overlaps = overlaps_between(detected, reference).only_significant
    matched = np.array([True, False, False, False, False, False])
    counted = counted_detections(detected, overlaps, references, matched=matched, area=AREA)
    # Row 5 overlaps a reference that counts and one that does not: it counts.
    assert counted.mask.tolist() == [True, False, False, False, True, True]
    left_out = LeftOut.of(counted, references)
    assert left_out == LeftOut(detected=3, reference_outside=1, reference_small=1)
    assert list(left_out_notes(left_out)) == [
        "3 detections left out: outside the evaluation area, or on references that are left out",
        "1 reference outside the evaluation area left out",
        "1 reference below the minimum area left out",
    ]


def test_a_match_counts_wherever_its_centre_lies():
    detected = rb.Footprints.of([house(96)])
    references = counted_references(rb.Footprints.of([house(94)]), area=AREA)
    overlaps = overlaps_between(detected, rb.Footprints.of([house(94)])).only_significant
    assert counted_detections(detected, overlaps, references, matched=np.array([True]), area=AREA).mask.all()


def test_footprints_are_cut_at_the_area():
    cut = clipped(rb.Footprints.of([house(95), house(10), house(300), house(100)]), AREA)
    assert shapely.area(cut.polygons).tolist() == [50.0, 100.0, 0.0, 0.0]
    assert shapely.get_dimensions(cut.polygons[3]) in (-1, 2), "no line is left of what only touches"


def test_repairs_are_reported_by_source_action_and_row():
    bow_tie = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
    some = rb.Footprints.of([bow_tie, *[shapely.Polygon()] * 12, house(0)], source="a.gpkg")
    one, two = repair_notes(some)
    assert one == f"a.gpkg: 1 feature {some.repairs[0].action}: 0"
    assert two == "a.gpkg: 12 features left out: 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 and 2 more"


@pytest.mark.parametrize("area", [None, AREA])
def test_empty_sets_have_nothing_to_leave_out(area):
    nothing = rb.Footprints.empty()
    references = counted_references(nothing, area=area, minimum_area=3.0)
    overlaps = overlaps_between(nothing, nothing)
    counted = counted_detections(nothing, overlaps, references, matched=np.zeros(0, dtype=bool), area=area)
    assert LeftOut.of(counted, references) == LeftOut()
