"""The Dempster-Shafer detector: cue maps on surfaces that are known, and whole scenes."""

from dataclasses import replace

import numpy as np
import pytest

import roofbench as rb
from roofbench.core.errors import ParameterError
from roofbench.detectors.dempster_shafer.cue_maps import cue_maps
from roofbench.detectors.dempster_shafer.fusion_detector import DempsterShafer
from roofbench.scenes.builtin import hamlet

GRID = rb.Grid.covering((0, 0, 40, 40), 1.0)


def points_of(surface, *, returns=1, number=1, per_cell=1):
    """Return a point in the middle of each cell of a grid of 40 x 40 m."""
    x, y = (axis.ravel() + 0.5 for axis in np.meshgrid(np.arange(40.0), np.arange(40.0)))
    z = surface(x, y).astype(float)
    return rb.PointCloud(
        x, y, z, return_number=np.full(len(x), number, np.uint8), number_of_returns=np.full(len(x), returns, np.uint8)
    )


def maps(*clouds, window=1.0):
    columns = ("x", "y", "z", "return_number", "number_of_returns")
    cloud = rb.PointCloud(**{name: np.concatenate([getattr(one, name) for one in clouds]) for name in columns})
    return cue_maps(cloud, cloud.z.astype(np.float32), GRID, window=window, vegetation=None)


def test_a_tilted_plane_has_no_texture_and_single_returns_no_pulse_difference():
    found = maps(points_of(lambda x, y: 0.3 * x + 0.2 * y))
    assert found.strength[10:-10, 10:-10] == pytest.approx(0, abs=1e-4)
    assert (found.pulse_difference == 0).all()
    assert not found.numbered
    assert found.height[0, 0] == pytest.approx(0.3 * 0.5 + 0.2 * 39.5)


def test_a_ridge_is_directed_and_a_rough_crown_is_not():
    ridge = maps(points_of(lambda x, y: 8 - 0.5 * abs(x - 20)))
    crown = maps(points_of(lambda x, y: 6 + np.random.default_rng(0).normal(0, 1.0, len(x))))
    assert ridge.strength[20, 20] > 0.1
    assert ridge.directedness[20, 20] == pytest.approx(0, abs=1e-3)
    assert np.median(crown.directedness) > 0.5
    assert np.median(crown.strength) > np.max(ridge.strength)


def test_crowns_have_a_pulse_difference_and_walls_do_not():
    def crown(x, y):
        return np.where((abs(x - 10) < 4) & (abs(y - 10) < 4), 7.0, 0.0)

    ground = points_of(lambda x, y: 0 * x, number=2, returns=2)
    tree = points_of(crown, number=1, returns=2)
    wall = points_of(lambda x, y: np.where((abs(x - 30.5) < 0.6), 7.0, 0.0), number=1, returns=2)
    assert maps(ground, tree).pulse_difference[30, 10] == pytest.approx(7.0)
    assert maps(ground, wall).pulse_difference[:, 28:33] == pytest.approx(7.0, abs=7.0)
    assert maps(ground, tree).pulse_difference[5, 30] == 0


def test_points_of_unknown_numbers_are_first_and_last_returns():
    ground = points_of(lambda x, y: 0 * x, number=2, returns=2)
    tree = points_of(lambda x, y: np.where((abs(x - 10) < 4) & (abs(y - 10) < 4), 7.0, 0.0), number=1, returns=2)
    unknown = [replace(cloud, return_number=0 * cloud.x, number_of_returns=0 * cloud.x) for cloud in (ground, tree)]
    known, found = maps(ground, tree), maps(*unknown)
    assert (known.numbered, found.numbered) == (True, False)
    assert (found.pulse_difference == known.pulse_difference).all()


def test_without_return_numbers_the_range_of_heights_takes_their_place():
    scene = rb.make_scene("vaihingen-a-small", seed=1)
    points = replace(scene.points, return_number=None, number_of_returns=None)
    bare = rb.Scene(scene.name, scene.extent, points=points, dem=scene.dem, reference=scene.reference, crs=scene.crs)
    known = rb.Scene(
        scene.name, scene.extent, points=scene.points, dem=scene.dem, reference=scene.reference, crs=scene.crs
    )
    found = rb.detect(bare, "dempster-shafer")
    assert found.metadata["cues"] == ["height", "roughness", "range of heights"]
    quality, best = (
        rb.evaluate(rb.detect(one, "dempster-shafer"), scene.reference).pixel.quality for one in (bare, known)
    )
    assert quality > best - 0.05


def test_most_buildings_of_the_hamlet_are_found():
    scene = hamlet(1)
    found = rb.detect(scene, "dempster-shafer")
    evaluation = rb.evaluate(found, scene.reference)
    assert evaluation.object.quality > 0.6
    assert set(found.attributes) == {"height", "support"}
    assert (found.attributes["height"] > 2).all()
    assert (found.attributes["support"] > 1 / 3).all()


def test_a_scene_of_points_alone_and_one_without_buildings():
    scene = hamlet(1)
    bare = rb.Scene("bare", scene.extent, points=scene.points)
    assert len(rb.detect(bare, "dempster-shafer")) > 5
    meadow = rb.Scene("meadow", (0, 0, 40, 40), points=points_of(lambda x, y: 0 * x))
    assert len(rb.detect(meadow, "dempster-shafer")) == 0


def test_the_second_pass_refuses_regions_and_adds_none():
    scene = hamlet(2)
    once, twice = DempsterShafer(second_pass=False).trace(scene), DempsterShafer().trace(scene)
    assert (once.accepted == once.opened).all()
    assert (twice.opened == once.opened).all()
    assert not (twice.accepted & ~twice.opened).any()


def test_bounds_in_the_wrong_order_are_refused():
    with pytest.raises(ParameterError, match="low_height must be smaller than high_height"):
        DempsterShafer(low_height=4.0)


def test_the_steps_show_every_map():
    steps = list(DempsterShafer().steps(hamlet(1), np.random.default_rng(0)))
    assert [step.name for step in steps] == ["cues", "probabilities", "classes", "support", "regions", "outlines"]
    titles = [panel.title for panel in steps[0].panels]
    assert titles[0] == "height above ground"
    assert "texture directedness" in titles
    assert "vegetation" in titles
    assert any("tree or grass" in panel.title for panel in steps[1].panels)


def test_a_cue_that_says_the_same_everywhere_is_silent_and_named():
    scene = rb.make_scene("vaihingen-a-small", seed=1)
    plain = rb.detect(scene, "dempster-shafer")
    assert plain.metadata["cues"][0] == "height"
    assert plain.metadata["notes"] == []
    grey = replace(scene.image, values=np.full_like(scene.image.values, 90))
    seen = rb.Scene(scene.name, scene.extent, points=scene.points, dem=scene.dem, image=grey)
    found = rb.detect(seen, "dempster-shafer")
    assert found.metadata["cues"] == [cue for cue in plain.metadata["cues"] if cue != "vegetation"]
    assert "'vegetation' is not used" in found.metadata["notes"][0]


@pytest.mark.parametrize(("number", "returns"), [(3, 7), (0, 2), (2, 3), (4, 3)])
def test_numbers_that_name_no_last_return_are_silent_and_buildings_are_found(number, returns):
    scene = hamlet(1)
    columns = {
        name: np.full(len(scene.points), value, np.uint8)
        for name, value in {"return_number": number, "number_of_returns": returns}.items()
    }
    odd, bare = (
        rb.Scene(scene.name, scene.extent, points=points, dem=scene.dem, image=scene.image)
        for points in (replace(scene.points, **columns), replace(scene.points, **dict.fromkeys(columns)))
    )
    found, plain = (rb.detect(one, "dempster-shafer") for one in (odd, bare))
    assert len(found) == len(plain) > 5
    assert (found.areas == plain.areas).all()
    assert "pulse difference" not in found.metadata["cues"]


def test_last_returns_alone_are_read_by_the_range_of_their_heights():
    scene = rb.make_scene("vaihingen-a-small", seed=4)
    last = scene.points.take(scene.points.return_number == scene.points.number_of_returns)
    seen = rb.Scene(scene.name, scene.extent, points=last, dem=scene.dem, crs=scene.crs)
    found = rb.detect(seen, "dempster-shafer")
    assert found.metadata["cues"] == ["height", "roughness", "range of heights"]
    assert "'pulse difference' is not used" in " ".join(found.metadata["notes"])
    assert rb.evaluate(found, scene.reference).pixel.quality > 0.5


def test_colour_infrared_that_is_read_as_red_green_blue_is_silent():
    scene = rb.make_scene("vaihingen-a-small", seed=4)
    index = scene.image.bands.index
    bands = [index("nir"), index("red"), index("green")]
    image = rb.Image(scene.image.values[bands], ("red", "green", "blue"), scene.image.grid)
    seen, bare = (
        rb.Scene(scene.name, scene.extent, points=scene.points, dem=scene.dem, crs=scene.crs, image=shown)
        for shown in (image, None)
    )
    found, plain = (rb.detect(one, "dempster-shafer") for one in (seen, bare))
    assert "'vegetation' is not used: it says the opposite" in " ".join(found.metadata["notes"])
    assert (found.areas == plain.areas).all()
