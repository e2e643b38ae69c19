"""``roofbench scenes make`` and ``scenes list``, and the suites of synthetic scenes."""

import pytest
from typer.testing import CliRunner

import roofbench as rb
from roofbench.benchmark.suite import named_suite
from roofbench.cli.main import app
from roofbench.core.errors import ParameterError
from roofbench.scenes.synthetic import SceneParameters, preset_names


def run(*words):
    return CliRunner().invoke(app, list(words), catch_exceptions=True)


def test_make_writes_a_folder_that_opens_as_the_same_scene(tmp_path):
    made = run(
        "scenes", "make", "fairfield-small", "--seed", "3", "-p", "tree_density=40", "-o", str(tmp_path / "scene")
    )
    assert made.exit_code == 0, made.output
    assert "'fairfield-small-3[tree_density=40.0]'" in made.output
    again, memory = rb.open_scene(tmp_path / "scene"), rb.make_scene("fairfield-small", seed=3, tree_density=40)
    assert len(again.points) == len(memory.points)
    assert (again.image.values == memory.image.values).all()
    assert sorted(again.reference.building_ids.tolist()) == sorted(memory.reference.building_ids.tolist())
    assert again.facts["seed"] == 3
    assert again.facts["parameters"]["tree_density"] == 40


@pytest.mark.parametrize("setting", ["tree_density", "tree_density=many", "tree_densty=3"])
def test_a_setting_that_cannot_be_read_is_refused(tmp_path, setting):
    made = run("scenes", "make", "fairfield-small", "-p", setting, "-o", str(tmp_path / "scene"))
    assert isinstance(made.exception, ParameterError) or made.exit_code == 2
    assert not (tmp_path / "scene").exists()


def test_list_names_every_preset_with_its_facts():
    listed = run("scenes", "list").output
    assert all(name in listed for name in preset_names())
    assert "588 x 417 m" in listed


def test_list_parameters_names_every_parameter_with_its_range():
    listed = run("scenes", "list", "--parameters").output
    assert all(name in listed for name in SceneParameters.parameters())
    assert "from 0 to 300 1/ha" in listed


def test_the_suite_of_the_papers_holds_every_full_preset_with_three_seeds():
    of_roofbench = {"rows", "old-town"}  # no data sets of the papers
    full = {name for name in preset_names() if not name.endswith("-small")} - of_roofbench
    scenes = named_suite("papers").scenes
    assert {scene.place for scene in scenes} == full
    assert len(scenes) == 3 * len(full)


def test_the_sensitivity_suite_varies_one_parameter_at_a_time():
    for scene in named_suite("sensitivity").scenes:
        assert len(scene.parameters) == 1
