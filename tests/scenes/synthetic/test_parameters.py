"""Impossible recipes are refused with the parameter, its range and what to do."""

import pytest

import roofbench as rb
from roofbench.core.errors import ParameterError, UnknownNameError
from roofbench.scenes.synthetic import SceneParameters


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"tree_density": -1}, r"tree_density must be from 0 to 300 1/ha, not -1"),
        ({"slope": 90}, r"slope must be from 0 to 40 deg, not 90"),
        ({"pulse": "second"}, r"pulse must be one of first, last, all, single, not 'second'"),
        ({"tree_densty": 3}, r"no parameter 'tree_densty' \(did you mean 'tree_density'\?\)"),
        ({"point_spacing": 0}, r"point_spacing must be from 0.1 to 5 m, not 0"),
        ({"parcel_depth": 150}, r"parcel_depth of 150 m does not fit 110 x 110 m: it must be at most 102 m here"),
    ],
)
def test_a_bad_parameter_is_named_with_its_range(parameters, message):
    with pytest.raises(ParameterError, match=message):
        rb.make_scene("fairfield-small", **parameters)


def test_too_many_buildings_for_the_extent_are_refused_with_the_number_that_fits():
    with pytest.raises(ParameterError, match=r"buildings must be at most \d+ on 110 x 110 m with parcels of"):
        _ = rb.make_scene("knox-small", buildings=500, width=110, height=110).reference
    rectangles = r"buildings \(rectangles of the reference\) must be at most \d+ on 110 x 110 m with parcels of"
    with pytest.raises(ParameterError, match=rectangles):
        _ = rb.make_scene("fairfield-small", buildings=500).reference


@pytest.mark.parametrize("seed", [-1, 1.5, True])
def test_a_seed_is_a_whole_number_of_at_least_0(seed):
    with pytest.raises(ParameterError, match="seed must be a whole number of at least 0"):
        rb.make_scene("fairfield-small", seed=seed)


def test_an_unknown_preset_is_answered_with_the_nearest():
    with pytest.raises(UnknownNameError, match=r"no preset called 'fairfeld' \(did you mean 'fairfield'\?\)"):
        rb.make_scene("fairfeld")


def test_every_parameter_says_what_it_means():
    for rule in SceneParameters.parameters().values():
        assert rule.doc, rule.name
        assert rule.type is bool or rule.choices or (rule.minimum is not None and rule.maximum is not None), rule.name
