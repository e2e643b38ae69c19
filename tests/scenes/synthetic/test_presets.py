"""Presets hold the facts that the papers print, and the small ones are small versions of them."""

import math

import numpy as np
import pytest

import roofbench as rb
from roofbench.scenes.synthetic import preset_names
from roofbench.scenes.synthetic.buildings import build
from roofbench.scenes.synthetic.layout import plan_layout
from roofbench.scenes.synthetic.parcels import plan_sites
from roofbench.scenes.synthetic.presets import preset
from roofbench.scenes.synthetic.solids import Body
from roofbench.scenes.synthetic.terrain import natural_terrain

# Printed: extent (m), buildings (Fairfield: reference entities), lowest and highest ground (m), bands, GSD (m), pulse,
# point spacing (m).
# Awrangjeb et al. 2010, section 4.3, and 2011, section 3.
AWRANGJEB = {
    "fairfield": ((588, 417), 370, (1, 23), ("red", "green", "blue"), 0.15, "last", 0.5),
    "fairfield-1": ((248, 210), 70, None, ("red", "green", "blue"), 0.15, "last", 0.5),
    "fairfield-2": ((155, 219), 62, None, ("red", "green", "blue"), 0.15, "last", 0.5),
    "fairfield-3": ((228, 189), 60, None, ("red", "green", "blue"), 0.15, "last", 0.5),
    "moonee-ponds": ((447, 447), 250, (23, 43), ("red", "green", "blue", "nir"), 0.10, "first", 1.0),
    "knox": ((400, 400), 130, (110, 270), ("red", "green", "blue"), 0.10, "first", 1.0),
}
# Printed: detected rectangles, about as many as references, and points.
# Yu et al. 2013, section 3; the two areas of Toronto have 1.45 km2 in all.
YU = {
    "toronto-a": (130, 1_755_589),
    "toronto-b": (153, 1_928_393),
    "vaihingen-a": (263, 3_775_182),
    "vaihingen-b": (290, 3_582_656),
}
SMALL = [name for name in preset_names() if name.endswith("-small")]


def counted(reference, name):
    """What a preset's number counts: buildings at Moonee Ponds, Knox and in rows, rectangles elsewhere."""
    return (
        len(set(reference.building_ids.tolist()))
        if name.startswith(("moonee", "knox", "rows", "old-town"))
        else len(reference)
    )


@pytest.mark.parametrize("name", AWRANGJEB)
def test_a_preset_has_the_printed_extent_buildings_relief_and_points(name):
    extent, buildings, relief, bands, _, pulse, spacing = AWRANGJEB[name]
    scene = rb.make_scene(name, seed=1)
    xmin, ymin, xmax, ymax = scene.extent
    assert (xmax - xmin, ymax - ymin) == extent
    assert counted(scene.reference, name) == buildings
    if relief is not None:
        low, high = float(scene.dem.values.min()), float(scene.dem.values.max())
        assert low == pytest.approx(relief[0], abs=1.0)
        assert high - low == pytest.approx(relief[1] - relief[0], rel=0.08)
    assert scene.facts["parameters"]["pulse"] == pulse
    assert scene.facts["parameters"]["bands"] == "rgbi"[: len(bands)]
    # A few pulses return nothing.
    assert math.sqrt(extent[0] * extent[1] / len(scene.points)) == pytest.approx(spacing, rel=0.04)
    assert scene.points.return_number is None


@pytest.mark.parametrize("name", YU)
def test_the_scenes_of_2013_have_the_printed_outlines_and_points(name):
    buildings, points = YU[name]
    scene = rb.make_scene(name, seed=1)
    assert counted(scene.reference, name) == buildings
    assert len(scene.points) == pytest.approx(points, rel=0.05)
    assert scene.points.return_number.max() > 1


def test_the_areas_of_toronto_add_up_to_the_printed_one():
    recipes = [preset("toronto-a"), preset("toronto-b")]
    assert sum(recipe.width * recipe.height for recipe in recipes) == pytest.approx(1.45e6, rel=0.005)


@pytest.mark.parametrize("name", SMALL)
def test_a_small_version_differs_in_size_alone(name):
    small, full = preset(name).values(), preset(name.removesuffix("-small")).values()
    differing = {key for key in small if small[key] != full[key]}
    assert differing <= {"width", "height", "buildings", "hall_share", "park_share", "open_share", "undulation"}
    assert small["width"] * small["height"] <= 260**2


@pytest.mark.parametrize("name", SMALL)
def test_a_small_version_holds_its_buildings_with_every_seed(name):
    for seed in range(12):
        assert counted(rb.make_scene(name, seed=seed).reference, name) == preset(name).buildings


@pytest.mark.parametrize("name", ["fairfield-1", "fairfield-2", "fairfield-3"])
def test_the_parts_of_fairfield_are_built_up(name):
    """Most parcels carry a building, most of them of one rectangle: what the printed density implies."""
    recipe = preset(name)
    built = []
    for seed in range(5):
        sites = plan_sites(plan_layout(recipe, seed), recipe, seed)
        town = build(sites, natural_terrain(recipe, seed), recipe, seed)
        margin = np.hypot(sites.width, sites.depth) / 2
        whole = (np.minimum(sites.x, sites.y) > margin) & (sites.x < recipe.width - margin)
        whole &= sites.y < recipe.height - margin
        built.append(town.built[whole].mean())
        assert (np.bincount([part.owner for part in town.solids if part.body == Body.BUILDING]) == 1).mean() > 0.6
    assert np.mean(built) > 0.8


@pytest.mark.slow
def test_every_seed_of_fairfield_has_room_for_its_entities():
    for name in ("fairfield-1", "fairfield-2", "fairfield-3"):
        for seed in range(100, 130):
            assert len(rb.make_scene(name, seed=seed).reference) == preset(name).buildings


def test_an_image_has_the_printed_cell_size_and_bands():
    image = rb.make_scene("moonee-ponds-small", seed=2).image
    assert (image.grid.gsd, image.bands) == (0.1, ("red", "green", "blue", "nir"))
    assert image.values.shape == (4, 1100, 1100)
    assert rb.make_scene("knox-small", bands="none").image is None


def test_knox_is_hilly_and_wooded_where_fairfield_is_neither():
    knox, fairfield = (rb.make_scene(name, seed=3) for name in ("knox-small", "fairfield-small"))

    def tall(scene):
        height = scene.points.z - scene.dem.sample(scene.points.x, scene.points.y)
        return float(np.mean((height > 2.5) & (scene.points.classification == 5)))

    assert np.ptp(knox.dem.values) > 20 > 10 > np.ptp(fairfield.dem.values)
    assert tall(knox) > 0.15
    assert tall(fairfield) < 0.06


@pytest.mark.parametrize(("name", "least", "most"), [("moonee-ponds", 0.0, 0.02), ("knox", 0.25, 1.0)])
def test_a_height_threshold_by_tiles_fails_on_the_slopes_of_knox_alone(name, least, most):
    """One ground height per 450 px tile, as in the paper of 2010: how much bare ground rises above it by 2.5 m."""
    scene = rb.make_scene(name, seed=1)
    cloud, tile = scene.points, 450 * AWRANGJEB[name][4]
    column, row = ((cloud.x - scene.extent[0]) // tile).astype(int), ((cloud.y - scene.extent[1]) // tile).astype(int)
    number = row * 1000 + column
    ground = scene.dem.sample(cloud.x, cloud.y)
    level = np.bincount(number, ground) / np.maximum(np.bincount(number), 1)
    bare = cloud.classification == 2
    above = float(np.mean(cloud.z[bare] > level[number[bare]] + 2.5))
    assert least <= above <= most


def test_seeds_count_from_one_and_the_built_in_scene_is_made_by_the_same_name():
    assert rb.make_scene("knox-small").name == "knox-small-1"
    assert rb.make_scene("hamlet").name == "hamlet-1"
    assert rb.make_scene("hamlet", seed=2).content_hash != rb.make_scene("hamlet").content_hash
