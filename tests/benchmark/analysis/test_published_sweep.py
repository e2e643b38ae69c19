"""Figures of sensitivity: the curves of a sweep, and which statements of the text hold on them."""

import pandas as pd
import pytest

from roofbench.benchmark.analysis.published_sweep import (
    PUBLISHED_SWEEPS,
    Curve,
    axes_of,
    curves_of,
    published_axes,
    published_sweep,
)
from roofbench.benchmark.analysis.sweep import Axis
from roofbench.benchmark.suite import suite_of_words
from roofbench.core.errors import ParameterError, UnknownNameError
from roofbench.detectors.registry import make_detector

FIGURE = published_sweep("original", "8")


def curve(values, by_object, by_pixel):
    return Curve(tuple(values), tuple(by_object), tuple(by_pixel))


def as_printed():
    """Return curves on which every statement of the paper holds."""
    return {
        "ground_tile": curve((400, 450, 500), (0.92, 0.915, 0.91), (0.69, 0.70, 0.69)),
        "black_share": curve((0.8, 0.9, 1.0), (0.91, 0.92, 0.90), (0.705, 0.70, 0.68)),
        "vegetation_threshold": curve((40, 48, 56), (0.92, 0.915, 0.91), (0.69, 0.70, 0.69)),
        "reduction": curve((0.1, 0.15, 0.2, 0.3), (0.91, 0.915, 0.92, 0.90), (0.72, 0.71, 0.68, 0.60)),
        "colour_similarity": curve((0.3, 0.4, 0.5), (0.91, 0.92, 0.91), (0.69, 0.70, 0.69)),
    }


def test_the_statements_hold_on_curves_like_the_printed_ones():
    assert all(found.reproduced for found in FIGURE.findings(as_printed()))


def test_flat_curves_reproduce_no_sensitivity_and_say_by_how_much():
    curves = as_printed() | {"reduction": curve((0.1, 0.15, 0.2, 0.3), (0.9,) * 4, (0.7,) * 4)}
    found = {item.statement: item for item in FIGURE.findings(curves)}
    assert not found["reduction is moderately sensitive, the other four less"].reproduced
    faster = found["with a larger reduction pixel quality drops faster than object quality"]
    assert (faster.reproduced, faster.measured) == (False, "from the first to the last value: object 0.0, pixel 0.0")
    assert found["object quality is highest at reduction = 0.2"].reproduced


@pytest.mark.parametrize("figure", PUBLISHED_SWEEPS, ids=lambda item: f"{item.detector}-{item.figure}")
def test_every_parameter_of_a_figure_declares_its_values(figure):
    suite, axes = published_axes(suite_of_words(["fairfield-1-small"], [figure.detector]), figure)
    assert [axis.name for axis in axes] == list(figure.parameters)
    assert all(len(axis.values) == 5 for axis in axes)
    assert suite.detectors[0].detector.values()["ground"] == "tile-dem"


def own_values(selection):
    suite, _ = published_axes(suite_of_words(["fairfield-1-small"], [selection]), FIGURE)
    return suite.detectors[0].detector.values()


@pytest.mark.parametrize("given", [{"ground": "tile-mode"}, {"ground": "point-dem"}, {"rise": 0.1}, {"new_share": 0.2}])
def test_values_that_are_given_are_not_replaced_by_the_standard_even_where_they_are_defaults(given):
    words = ",".join(f"{name}={value}" for name, value in given.items())
    values = own_values(f"original[{words}]")
    assert {name: values[name] for name in FIGURE.standard} == {**FIGURE.standard, **given}


def test_the_standard_replaces_what_a_mode_sets():
    assert own_values("original[mode=program]")["ground"] == FIGURE.standard["ground"]
    assert own_values("original[mode=program,ground=point-dem]")["ground"] == "point-dem"


def test_an_axis_without_values_takes_the_declared_ones_or_is_refused():
    suite = suite_of_words(["fairfield-1-small"], ["original"])
    declared = make_detector("original").parameters()["reduction"].swept
    assert axes_of(["reduction", "rise=0,0.1"], suite) == [Axis("reduction", declared), Axis("rise", (0, 0.1))]
    with pytest.raises(ParameterError, match="vary='strip' declares no values: write strip=VALUE"):
        axes_of(["strip"], suite)


def test_an_unknown_figure_is_refused_with_those_there_are():
    with pytest.raises(UnknownNameError, match=r"improved: no figure '9'.*figure 8 of original"):
        published_sweep("improved", "9")


def test_the_curves_are_the_means_of_one_detector():
    rows = [
        {"detector": name, "axis": "reduction", "reduction": value, "index": index, "mean": mean}
        for name, shift in (("original", 0.0), ("other", 0.5))
        for value in (0.1, 0.2)
        for index, mean in (
            ("object.quality", value + shift),
            ("pixel.quality", 2 * value),
            ("pixel.completeness", 1.0),
        )
    ]
    assert curves_of(pd.DataFrame(rows), FIGURE, "original") == {"reduction": curve((0.1, 0.2), (0.1, 0.2), (0.2, 0.4))}
