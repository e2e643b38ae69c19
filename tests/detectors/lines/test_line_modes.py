"""The modes of the line detectors: each is the long form of its parameters, bit for bit."""

import numpy as np
import pytest
import shapely
from builders.line_scenes import GREEN_ROOF, SceneBuilder, rectangle

from roofbench.benchmark.identity.recipes import PluginRecipe, label_of
from roofbench.core.errors import ParameterError
from roofbench.detectors.lines.trace import Outcome
from roofbench.detectors.registry import make_detector

PRINTED = (
    "largest_pixel=1000,marking=squares,neighbourhood=0.75,missed_corner=1000,vegetation=pseudo-ndvi,extension_stop=0.4,"
    "extension_part=1000,inside_margin=0,inside_share=1,colour_from=shrunk,rise=0,new_share=0,same_overlap=1"
)
PROGRAM = (
    "largest_pixel=1000,ground=point-dem,below_ground=1,marking=cells,neighbourhood=0.75,curve_step=0.25,missed_corner=1000,"
    "inside_test=strip,band_width=2,vegetation=sigma,nir_threshold=25.5,rectangle_extension=1.5,extension_stop=0.4,"
    "extension_part=1000,inside_margin=0,inside_share=1,least_rectangle=2,reduction=0.3,filled_share=0.7,colour_bins=tenths,"
    "colour_smoothing=0.5,strip_stop=0.35,final_order=independent,rise_from=gap,colour_from=shrunk,rise=0,new_share=0,"
    "same_overlap=1"
)
#: (detector, mode) to the parameters that the mode sets.
LONG_FORM = {
    ("original", "paper"): f"{PRINTED},ground=tile-dem,curve_step=0.15,adjustment_reference=any,adjustment_share=1",
    ("improved", "paper"): f"{PRINTED},curve_step=0.1,below_ground=1,entropy=mean,entropy_threshold=0.3,"
    "adjustment=longest,voting=true,texture=tests,vote_length=printed,texture_margin=0,edge_contrast=0,peak_ratio=1",
    ("original", "program"): f"{PROGRAM},adjustment_reference=none",
    ("improved", "program"): f"{PROGRAM},entropy=share,entropy_threshold=0.3,entropy_offset=1,green_extension=same,"
    "vegetation_side=inside,adjustment=none,texture=tests,texture_margin=0,edge_blur=1.41,edge_contrast=0,peaks=bins,"
    "area_per_edge=none",
}


def found_in(scene, selection):
    return make_detector(selection).detect(scene, np.random.default_rng(0))


@pytest.mark.parametrize(("name", "mode"), list(LONG_FORM))
def test_a_mode_detects_what_its_long_form_detects(name, mode):
    builder = SceneBuilder().house(rectangle(20, 30, 15, 10, 30)).tree(15, 10, 5)
    scene = builder.house(rectangle(45, 30, 12, 8, 70), GREEN_ROOF).build().for_detection()
    short, long = found_in(scene, f"{name}[mode={mode}]"), found_in(scene, f"{name}[{LONG_FORM[name, mode]}]")
    assert short.metadata["initial rectangles"] > 0
    assert shapely.to_wkb(short.polygons).tolist() == shapely.to_wkb(long.polygons).tolist()
    assert short.metadata == long.metadata
    assert short.metadata != found_in(scene, name).metadata


@pytest.mark.parametrize(("name", "mode"), list(LONG_FORM))
def test_a_mode_and_its_long_form_differ_in_their_mode_only(name, mode):
    short, long = make_detector(f"{name}[mode={mode}]"), make_detector(f"{name}[{LONG_FORM[name, mode]}]")
    assert short.values() == {**long.values(), "mode": mode}


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


def test_a_mode_that_is_given_twice_is_refused():
    with pytest.raises(ParameterError, match=r"gives mode twice"):
        make_detector("original[mode=paper,mode=program]")
