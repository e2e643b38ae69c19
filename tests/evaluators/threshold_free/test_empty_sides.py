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
