"""``roofbench.evaluate`` refuses what it cannot compare, in one sentence."""

import pytest
import shapely

import roofbench as rb
from roofbench.core.errors import CRSError, InputError, ParameterError
from roofbench.evaluators.comparison import evaluate_all
from roofbench.evaluators.registry import DEFAULT, EVALUATORS

HOUSE = shapely.box(0, 0, 10, 10)
HOUSES = rb.Footprints.of([HOUSE])

WRONG_AREAS = {
    "a way to measure areas": ("pixels", r"evaluator='threshold-free\[area=pixels\]'"),
    "a line": (shapely.LineString([(0, 0), (10, 10)]), "not LineString"),
    "a bow tie": (shapely.Polygon([(0, 0), (20, 20), (20, 0), (0, 20)]), "Self-intersection"),
}


@pytest.mark.parametrize("case", WRONG_AREAS)
def test_an_area_that_is_no_valid_polygon_is_refused(case):
    area, message = WRONG_AREAS[case]
    with pytest.raises(InputError, match=message):
        rb.evaluate(HOUSES, HOUSES, area=area)


@pytest.mark.parametrize(("crs", "message"), [("EPSG:4326", "geographic"), ("EPSG:2263", "US survey foot")])
def test_a_crs_that_is_not_in_metres_is_refused(crs, message):
    houses = rb.Footprints.of([HOUSE], crs=crs)
    with pytest.raises(CRSError, match=message):
        rb.evaluate(houses, houses)


def test_a_pooled_evaluation_says_how_areas_were_measured():
    exact = rb.evaluate(HOUSES, HOUSES)
    counted = rb.evaluate(HOUSES, HOUSES, grid=rb.Grid(0, 10, 0.5, 20, 20))
    assert rb.pool([exact, exact]).notes == ("pooled over 2 evaluations", "areas exact in all 2 scenes")
    assert rb.pool([counted, counted]).notes[1] == "areas counted in pixels in all 2 scenes"
    assert rb.pool([exact, counted]).notes[1] == "areas counted in pixels in 1 of 2 scenes, exact in the others"


def test_all_evaluators_compare_the_same_sets_with_the_parameters_that_they_have():
    found = evaluate_all(HOUSES, HOUSES, matching="one-pass", minimum_area=5)
    assert set(found) == set(EVALUATORS.names())
    assert next(iter(found)) == DEFAULT
    assert found["boundary"].evaluator.matching == found[DEFAULT].evaluator.matching == "one-pass"
    assert found["iou"].evaluator.matching == "spacenet", "another set of choices"
    assert {evaluation.evaluator.minimum_area for evaluation in found.values()} == {5.0}


def test_every_evaluator_is_asked_for_by_one_word():
    found = rb.evaluate(HOUSES, HOUSES, evaluator="all", minimum_area=5)
    assert list(found) == list(evaluate_all(HOUSES, HOUSES))
    assert found["iou"].values["iou.f1"] == 1


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"matching": "nearst"}, "one of nearest, one-pass, overlap, spacenet, coco"),
        ({"minimum_aera": 5}, "did you mean 'minimum_area'"),
    ],
)
def test_a_parameter_that_no_evaluator_knows_is_refused(wrong, message):
    with pytest.raises(ParameterError, match=message):
        evaluate_all(HOUSES, HOUSES, **wrong)


@pytest.mark.parametrize("name", EVALUATORS.names())
def test_a_missing_detection_set_is_refused_by_every_evaluator(name):
    with pytest.raises(InputError, match="detected is NoneType"):
        rb.evaluate(None, HOUSES, evaluator=name)
