"""One recipe and one seed are one scene, bit for bit, wherever it is made; each parameter changes one thing."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import roofbench as rb
from roofbench.scenes.synthetic.make import scene_of
from roofbench.scenes.synthetic.presets import preset
from roofbench.scenes.synthetic.world import make_world

DIGEST = """
import sys, roofbench as rb
sys.stdout.write(rb.make_scene("knox-small", seed=5).content_hash)
"""


def trees_of(name, seed=4, **parameters):
    return make_world(preset(name, **parameters), seed).trees


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits_in_other_processes_and_with_other_thread_counts():
    here = rb.make_scene("knox-small", seed=5).content_hash
    root = str(Path(rb.__file__).resolve().parent.parent)
    for threads in ("1", "3"):
        environment = os.environ | {"PYTHONPATH": root, "NUMBA_NUM_THREADS": threads, "OMP_NUM_THREADS": threads}
        done = subprocess.run(
            [sys.executable, "-c", DIGEST], env=environment, capture_output=True, text=True, check=True
        )
        assert done.stdout == here


def test_pieces_do_not_depend_on_the_order_in_which_they_are_asked_for():
    one, other = (rb.make_scene("fairfield-small", seed=2) for _ in range(2))
    _ = one.image, one.points, one.reference
    _ = other.reference, other.points, other.image
    assert one.content_hash == other.content_hash


def test_another_seed_gives_another_scene():
    assert (
        rb.make_scene("fairfield-small", seed=1).content_hash != rb.make_scene("fairfield-small", seed=2).content_hash
    )


def test_the_trees_at_a_lower_density_are_among_those_at_a_higher_one():
    few, many = trees_of("knox-small", tree_density=20), trees_of("knox-small", tree_density=40)
    assert set(few.candidate) < set(many.candidate)
    rows = np.searchsorted(np.sort(many.candidate), few.candidate)
    same = np.argsort(many.candidate)[rows]
    for column in ("x", "y", "height", "radius", "colour"):
        np.testing.assert_array_equal(getattr(few, column), getattr(many, column)[same])


@pytest.mark.parametrize("density", [0, 17, 60])
def test_there_are_as_many_trees_as_asked_for(density):
    assert len(trees_of("fairfield-small", tree_density=density)) == round(1.21 * density)


@pytest.mark.parametrize(
    "change",
    [
        {"tree_density": 60},
        {"tree_gap": 6},
        {"green_roof_share": 0.7},
        {"point_spacing": 1.0},
        {"registration_shift": 2},
        {"sun_elevation": 25},
        {"slope": 12},
        {"vertical_noise": 0.3},
        {"clutter": 0},
    ],
)
def test_a_parameter_that_is_not_about_buildings_leaves_them_in_place(change):
    plain, turned = (
        rb.make_scene("fairfield-small", seed=3, digitised="ground", **more).reference for more in ({}, change)
    )
    for one, other in zip(plain.polygons, turned.polygons, strict=True):
        assert one.equals(other)


def test_green_roofs_of_a_small_share_stay_green_in_a_larger_one():
    def green(share):
        scene = make_world(preset("moonee-ponds-small", green_roof_share=share), 1)
        plain = make_world(preset("moonee-ponds-small", green_roof_share=0.0), 1)
        return set(np.flatnonzero((scene.solids.colour != plain.solids.colour).any(axis=1)).tolist())

    assert green(0.2) < green(0.6) < green(1.0)


def test_fewer_buildings_are_among_more_buildings():
    few, many = (rb.make_scene("fairfield-small", seed=3, buildings=n).reference for n in (5, 12))
    texts = {polygon.wkt for polygon in many.polygons}
    assert all(polygon.wkt in texts for polygon in few.polygons)


def test_the_name_holds_preset_seed_and_changes():
    assert rb.make_scene("knox-small", seed=3, tree_density=40).name == "knox-small-3[tree_density=40.0]"
    assert scene_of(preset("knox-small"), seed=1, name="own").name == "own"
