"""Names of scenes in tables and plots: no two scenes share one, and no scene has that of a preset."""

import roofbench as rb
from roofbench.benchmark.identity.keys import module_closure
from roofbench.benchmark.identity.recipes import SceneRecipe, preset_names
from roofbench.core.digests import digest
from roofbench.scenes.synthetic.presets import preset


def test_no_scene_is_called_like_another_one_or_like_a_preset():
    recipes = [SceneRecipe.of_preset(name, seed=seed) for name in preset_names() for seed in range(25)]
    names = [recipe.name for recipe in recipes]
    assert len(set(names)) == len(names)
    assert not set(names) & set(preset_names())
    assert {recipe.group for recipe in recipes} == set(preset_names())


def test_the_preset_that_others_continue_is_named_with_its_seed_behind_a_sign():
    one = SceneRecipe.of_preset("fairfield", seed=1)
    assert (one.name, one.group, one.word) == ("fairfield@1", "fairfield", "fairfield[seed=1]")
    varied = SceneRecipe.of_preset("fairfield", seed=1, parameters={"tree_density": 40.0})
    assert (varied.name, varied.group) == ("fairfield@1[tree_density=40]", "fairfield[tree_density=40]")
    assert SceneRecipe.of_preset("fairfield-1", seed=1).name == "fairfield-1-1"
    assert SceneRecipe.of_preset("fairfield", seed=4).name == "fairfield-4"


def test_the_key_does_not_depend_on_the_sign():
    recipe = SceneRecipe.of_preset("fairfield", seed=1)
    code = module_closure("scenes.synthetic").digest
    assert recipe.key == digest(["fairfield-1", code, preset("fairfield").values(), 1])
    assert rb.make_scene("fairfield-small", seed=1).name == "fairfield-small-1"
