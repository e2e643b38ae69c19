import pytest
import shapely

import roofbench as rb

OVERLAPPING = rb.Footprints.of([shapely.box(0, 0, 10, 10), shapely.box(5, 5, 15, 15)])
NOTHING = rb.Footprints.empty()


@pytest.mark.parametrize(
    ("detected", "reference", "completeness", "correctness"),
    [(OVERLAPPING, NOTHING, None, 0.0), (NOTHING, OVERLAPPING, 0.0, None), (NOTHING, NOTHING, None, None)],
)
def test_an_empty_side_is_a_result_even_when_the_other_overlaps_itself(detected, reference, completeness, correctness):
    evaluation = rb.evaluate(detected, reference)
    assert evaluation.values["object.completeness"] == completeness
    assert evaluation.values["object.correctness"] == correctness
    assert len(evaluation.verdicts.detections) == len(detected)


def test_footprints_that_the_evaluation_area_clips_away_count_as_before():
    """A reference beyond the area becomes an empty multipolygon on clipping: it is left out, the rest stays."""
    inside = [shapely.box(0, 0, 10, 10), shapely.box(20, 0, 30, 10)]
    parted = shapely.MultiPolygon([shapely.box(60, 0, 64, 4), shapely.box(66, 0, 70, 4)])
    area = shapely.box(-5, -5, 40, 20)
    evaluation = rb.evaluate(rb.Footprints.of([*inside, parted]), rb.Footprints.of([*inside, parted]), area=area)
    assert evaluation.counts.true_positives == 2
    assert evaluation.pixel.quality == 1
