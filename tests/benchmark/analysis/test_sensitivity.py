"""Lines of stored sweeps: every point of a line is over the same scenes."""

import json
from dataclasses import replace

from roofbench.benchmark.analysis.sensitivity import stored_sensitivities
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.benchmark.plan import KeyedEvaluator
from roofbench.benchmark.store.records import RunRow
from roofbench.detectors.registry import make_detector
from roofbench.evaluators.registry import make_evaluator
from roofbench.reports.sensitivity import sensitivity_figure

KEYED = KeyedEvaluator.of(make_evaluator("threshold-free"))
DEFAULTS = make_detector("ndsm").values()


class Stored:
    """Rows of runs of ndsm, and their values of object quality."""

    def __init__(self):
        self.rows, self.values = [], {}

    def add(self, quality, *, seed=1, scene=None, **parameters):
        number = len(self.rows) + 1
        recipe = SceneRecipe.of_preset("knox-small", seed=seed, parameters=scene or {})
        changed = ",".join(f"{name}={value}" for name, value in parameters.items())
        facts = dict.fromkeys(RunRow._fields, "") | {
            "id": number,
            "detector": "ndsm",
            "label": f"ndsm[{changed}]" if changed else "ndsm",
            "parameters_text": json.dumps({**DEFAULTS, **parameters}),
            "seed": 0,
            "scene": recipe.name,
            "recipe_text": json.dumps(recipe.to_dict()),
            "status": "ok",
        }
        self.rows.append(RunRow(**facts))
        self.values[number] = {"object.quality": quality}

    def line(self):
        lines = stored_sensitivities(self.rows, self.values, KEYED, level=0.8, chosen=["object.quality"])
        (line,) = lines
        return line


def points_of(line):
    return [(point.value, round(point.mean, 6), point.scenes) for point in line.points]


def test_a_single_run_at_another_value_is_not_joined_to_means_over_three_scenes():
    stored = Stored()
    for seed in (1, 2, 3):
        for slope in (5, 10):
            stored.add(0.9 - slope / 100 + seed / 100, seed=seed, scene={"slope": slope})
    stored.add(0.1, seed=1, scene={"slope": 15.5})
    line = stored.line()
    assert points_of(line) == [(5, 0.87, 3), (10, 0.82, 3)]
    assert line.left_out == (15.5,)
    assert line.break_down.value is None
    (panel,) = sensitivity_figure([line]).axes
    assert "left out (other scenes): 15.5" in panel.get_xlabel()


def test_further_scenes_at_one_value_do_not_enter_its_mean():
    stored = Stored()
    for seed in (1, 2):
        for slope in (5, 10):
            stored.add(0.5, seed=seed, scene={"slope": slope})
    for seed in (3, 4, 5):
        stored.add(1.0, seed=seed, scene={"slope": 10})
    assert points_of(stored.line()) == [(5, 0.5, 2), (10, 0.5, 2)]


def test_parameters_of_the_detector_are_compared_on_the_same_scenes():
    stored = Stored()
    for seed in (1, 2):
        stored.add(0.6, seed=seed)
        stored.add(0.4, seed=seed, height=4.0)
    stored.add(1.0, seed=1, height=6.0)
    line = stored.line()
    assert points_of(line) == [(DEFAULTS["height"], 0.6, 2), (4.0, 0.4, 2)]
    assert line.left_out == (6.0,)


def test_a_point_with_fewer_defined_scenes_says_so_in_the_figure():
    stored = Stored()
    for seed in (1, 2):
        stored.add(0.6, seed=seed, scene={"slope": 5})
        stored.add(0.4 if seed == 1 else None, seed=seed, scene={"slope": 10})
    line = stored.line()
    assert points_of(line) == [(5, 0.6, 2), (10, 0.4, 1)]
    (panel,) = sensitivity_figure([line]).axes
    assert [text.get_text() for text in panel.texts] == ["n = 1"]


def test_the_figure_names_its_marks_and_keeps_break_downs_apart():
    stored = Stored()
    for seed in (1, 2):
        for slope, quality in ((5, 0.9), (10, 0.7)):
            stored.add(quality, seed=seed, scene={"slope": slope})
    line = stored.line()
    figure = sensitivity_figure([line, replace(line, detector="other")], level=0.8)
    (panel,) = figure.axes
    triangles = [mark.get_ydata()[0] for mark in panel.lines if mark.get_marker() == "v"]
    assert len(set(triangles)) == len(triangles) == 2
    (legend,) = figure.legends
    assert {"95 % interval", "80 %", "passes the level"} <= {text.get_text() for text in legend.get_texts()}


def test_a_sweep_without_the_default_is_a_line():
    stored = Stored()
    for height in (2.0, 3.0, 4.0):
        stored.add(height / 10, height=height)
    line = stored.line()
    assert (line.axis, line.detector, line.default) == ("height", "ndsm", DEFAULTS["height"])
    assert points_of(line) == [(2.0, 0.2, 1), (3.0, 0.3, 1), (4.0, 0.4, 1)]


def test_a_sweep_beside_another_changed_parameter_names_it():
    stored = Stored()
    for height in (2.0, 3.0):
        stored.add(0.5, height=height, opening=2.0)
    stored.add(0.6, height=3.0)
    lines = stored_sensitivities(stored.rows, stored.values, KEYED, level=0.8, chosen=["object.quality"])
    assert [(line.axis, line.detector) for line in lines] == [
        ("height", "ndsm[opening=2]"),
        ("opening", "ndsm[height=3]"),
    ]


def test_points_that_are_undefined_on_different_scenes_all_say_their_number():
    stored = Stored()
    for height, undefined in ((2.0, 1), (3.0, 2)):
        for seed in (1, 2):
            stored.add(None if seed == undefined else 0.5, seed=seed, height=height)
    (panel,) = sensitivity_figure([stored.line()]).axes
    assert [text.get_text() for text in panel.texts] == ["n = 1", "n = 1"]
