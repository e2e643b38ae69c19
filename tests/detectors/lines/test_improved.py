"""The detector `improved` end to end, on scenes made by hand."""

import numpy as np
import pytest
import shapely
from builders.line_scenes import GREEN_ROOF, LEAVES, SceneBuilder, corners_off, rectangle

from roofbench.detectors.lines.improved import Improved
from roofbench.detectors.lines.original import Original
from roofbench.detectors.lines.trace import Outcome
from roofbench.detectors.registry import make_detector
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.scene import Scene

AUTUMN = (120, 95, 60)


def detect(scene, **parameters):
    return Improved(**parameters).detect(scene.for_detection(), np.random.default_rng(0))


@pytest.mark.parametrize("degrees", [0, 13, 30, 45, 58, 77])
def test_a_clean_rectangular_house_is_found_within_a_pixel_at_any_orientation(degrees):
    builder = SceneBuilder().house(rectangle(30, 30, 15, 10, degrees))
    found = detect(builder.build())
    truth = builder.truth()[0]
    assert len(found) == 1
    assert corners_off(found.polygons[0], truth) < 0.15 * np.sqrt(2)


def test_a_green_roof_is_found_because_its_texture_is_smooth():
    builder = SceneBuilder().house(rectangle(30, 30, 15, 10, 20), GREEN_ROOF)
    found = detect(builder.build())
    assert len(found) == 1
    assert found.metadata["lines kept by entropy"] == 4
    truth = builder.truth()[0]
    assert found.polygons[0].intersection(truth).area / found.polygons[0].union(truth).area > 0.9


def test_the_index_alone_loses_the_green_roof():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 20), GREEN_ROOF).build()
    assert len(detect(scene, entropy="mean", entropy_threshold=0.0)) == 0


@pytest.mark.parametrize("colour", [LEAVES, AUTUMN])
def test_a_tree_as_big_as_a_house_is_dropped_whatever_its_colour(colour):
    builder = SceneBuilder().house(rectangle(16, 40, 15, 10, 20)).tree(42, 18, 6.0, colour)
    found = detect(builder.build())
    assert len(found) == 1
    assert found.polygons[0].intersects(builder.truth()[0])


def test_the_tests_of_texture_drop_what_the_votes_leave_of_a_brown_tree():
    scene = SceneBuilder(seed=3).tree(30, 30, 7.0, AUTUMN).build()
    assert len(detect(scene, voting=False, texture="none")) > 0
    assert len(detect(scene, voting=False, texture="tests")) == 0


def test_votes_and_tests_are_optional_and_their_absence_computes_neither():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 20)).build().for_detection()
    trace = Improved(voting=False, texture="none").trace(scene)
    assert trace.votes is None
    assert trace.texture is None
    assert len(trace.final) == 1


def test_a_line_with_a_poor_vote_is_dropped_with_that_reason():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 20)).build().for_detection()
    trace = Improved(voting=True, majority=1.0).trace(scene)
    assert (trace.outcomes == Outcome.OUTVOTED).all()
    assert len(trace.final) == 0


def test_an_l_is_two_overlapping_rectangles():
    wings = [rectangle(30, 26, 22, 8), rectangle(23, 31, 8, 18)]
    builder = SceneBuilder().house(shapely.union_all(wings))
    found = detect(builder.build())
    assert len(found) == 2
    assert found.polygons[0].intersects(found.polygons[1])


def test_nothing_in_the_scene_gives_an_empty_result():
    bare = SceneBuilder().build()
    assert len(detect(bare)) == 0
    nothing = PointCloud(np.empty(0), np.empty(0), np.empty(0))
    assert len(detect(Scene("empty", bare.extent, points=nothing, image=bare.image, dem=bare.dem))) == 0


@pytest.mark.parametrize("choice", ["bases", "longest", "neighbours", "none"])
def test_every_kind_of_adjustment_finds_the_house(choice):
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 20)).build()
    assert len(detect(scene, adjustment=choice)) == 1


def test_the_detector_is_found_by_name_and_reads_its_switches():
    detector = make_detector("improved[voting=true,entropy_threshold=0.3]")
    assert detector.changed() == {"voting": True, "entropy_threshold": 0.3}


OTHER_VALUES = {"tile_pixel": "image", "vote_length": "printed", "peaks": "bins"}


@pytest.mark.parametrize("base", [{"voting": False, "texture": "none"}, {"ground": "tile-mode"}], ids=["plain", "tile"])
def test_parameters_that_are_declared_without_effect_have_none(base):
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 20)).tree(12, 48, 5.0, LEAVES).build()
    before = detect(scene, **base)
    changed = Improved(**base)
    assert len(changed.unused()) >= 2
    for name in changed.unused():
        value = OTHER_VALUES[name] if name in OTHER_VALUES else 1.37 * getattr(changed, name)
        object.__setattr__(changed, name, value)
    after = changed.detect(scene.for_detection(), np.random.default_rng(0))
    assert [polygon.wkb for polygon in after.polygons] == [polygon.wkb for polygon in before.polygons]
    assert len(before) > 0


def test_curve_points_and_corners_follow_the_spacing_of_dense_points_in_original_alone():
    scene = SceneBuilder(spacing=0.3).house(rectangle(30, 30, 15, 10, 20)).build()
    as_in_print = {"curve_step": 0.15, "missed_corner": 0.2}
    assert detect(scene).polygons.tolist() == detect(scene, **as_in_print).polygons.tolist()
    original = [
        Original(**values).detect(scene.for_detection(), np.random.default_rng(0)).polygons.tolist()
        for values in ({}, as_in_print)
    ]
    assert original[0] != original[1]
