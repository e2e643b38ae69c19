"""The modes of the line detectors: each is the long form of its parameters, bit for bit."""

import numpy as np
import pytest
import shapely
from builders.line_scenes import GREEN_ROOF, SceneBuilder, rectangle

from roofbench.benchmark.identity.recipes import PluginRecipe, label_of
from roofbench.detectors.lines.trace import Outcome
from roofbench.detectors.registry import make_detector

PRINTED = (
    "marking=squares,neighbourhood=0.75,missed_corner=1000,vegetation=pseudo-ndvi,extension_stop=0.4,"
    "extension_part=1000,inside_margin=0,inside_share=1,rise=0,new_share=0"
)
LONG_FORM = {
    "original": f"{PRINTED},curve_step=0.15,adjustment_reference=any,adjustment_share=1",
    "improved": f"{PRINTED},curve_step=0.1,below_ground=1,entropy_threshold=0.3,adjustment=longest,"
    "vote_length=printed,texture_margin=0,edge_contrast=0,peak_ratio=1",
}


def found_in(scene, selection):
    return make_detector(selection).detect(scene, np.random.default_rng(0))


@pytest.mark.parametrize("name", list(LONG_FORM))
def test_the_paper_mode_detects_what_its_long_form_detects(name):
    builder = SceneBuilder().house(rectangle(20, 30, 15, 10, 30)).tree(15, 10, 5)
    scene = builder.house(rectangle(45, 30, 12, 8, 70), GREEN_ROOF).build().for_detection()
    short, long = found_in(scene, f"{name}[mode=paper]"), found_in(scene, f"{name}[{LONG_FORM[name]}]")
    assert len(short) > 0
    assert shapely.to_wkb(short.polygons).tolist() == shapely.to_wkb(long.polygons).tolist()
    assert short.metadata == long.metadata
    assert short.metadata != found_in(scene, name).metadata


@pytest.mark.parametrize("name", list(LONG_FORM))
def test_the_paper_mode_and_its_long_form_differ_in_their_mode_only(name):
    short, long = make_detector(f"{name}[mode=paper]"), make_detector(f"{name}[{LONG_FORM[name]}]")
    assert short.values() == {**long.values(), "mode": "paper"}


def test_label_and_key_hold_what_overrides_a_mode():
    chosen = make_detector("original[mode=paper,rise=0.1]")
    assert label_of(chosen) == "original[mode=paper,rise=0.1]"
    recipe = PluginRecipe.of(chosen)
    assert recipe.parameters["rise"] == 0.1
    assert recipe.parameters["marking"] == "squares"
    assert recipe.detector() == chosen
    assert recipe != PluginRecipe.of(make_detector("original[mode=paper]"))


def test_the_border_of_the_points_makes_lines_only_where_it_is_kept():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 30)).build()
    points = scene.points.take(scene.points.x < scene.points.x.mean())
    cut = type(scene)("cut", scene.extent, points=points, image=scene.image, dem=scene.dem).for_detection()
    dropped, kept = (make_detector(f"original[border={border}]").trace(cut) for border in ("drop", "keep"))
    assert (dropped.outcomes == Outcome.BORDER).any()
    assert not (kept.outcomes == Outcome.BORDER).any()
    assert kept.masks.primary.sum() > dropped.masks.primary.sum()
