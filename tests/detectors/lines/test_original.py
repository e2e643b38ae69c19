"""The detector `original` end to end, on scenes made by hand."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from builders.line_scenes import GREEN_ROOF, LEAVES, SceneBuilder, corners_off, rectangle

from roofbench.core.errors import MissingInputError, ParameterError
from roofbench.detectors.lines.original import Original
from roofbench.detectors.registry import make_detector
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid, Image
from roofbench.scenes.scene import Scene


def detect(scene, **parameters):
    return Original(**parameters).detect(scene.for_detection(), np.random.default_rng(0))


@pytest.mark.parametrize("degrees", [0, 13, 30, 45, 58, 77])
def test_a_clean_rectangular_house_is_found_within_a_pixel_at_any_orientation(degrees):
    builder = SceneBuilder().house(rectangle(30, 30, 15, 10, degrees))
    found = detect(builder.build())
    truth = builder.truth()[0]
    assert len(found) == 1
    assert corners_off(found.polygons[0], truth) < 0.15 * np.sqrt(2)


def test_an_l_is_two_overlapping_rectangles():
    wings = [rectangle(30, 26, 22, 8), rectangle(23, 31, 8, 18)]
    builder = SceneBuilder().house(shapely.union_all(wings))
    found = detect(builder.build())
    assert len(found) == 2
    assert found.polygons[0].intersects(found.polygons[1])
    union = shapely.union_all(found.polygons)
    truth = builder.truth()[0]
    assert union.intersection(truth).area / union.union(truth).area > 0.9


def test_a_u_with_a_narrow_court_is_three_overlapping_rectangles():
    wings = [rectangle(30, 25, 18, 10), rectangle(24.75, 32, 7.5, 8), rectangle(35.25, 32, 7.5, 8)]
    builder = SceneBuilder().house(shapely.union_all(wings))
    found = detect(builder.build())
    truth = builder.truth()[0]
    union = shapely.union_all(found.polygons)
    assert len(found) == 3
    assert union.intersection(truth).area / union.union(truth).area > 0.9


@pytest.mark.parametrize("detector", ["original", "improved"])
def test_a_face_of_another_brightness_is_part_of_the_roof(detector):
    whole, face = rectangle(30, 30, 22, 10), rectangle(40, 30, 2, 10)
    builder = SceneBuilder().house(whole).house(face, (70, 32, 26))
    shares = {}
    for start in ("initial", "shrunk"):
        chosen = make_detector(f"{detector}[colour_from={start}]")
        found = chosen.detect(builder.build().for_detection(), np.random.default_rng(0))
        dark = shapely.intersection(shapely.union_all(found.polygons), builder.truth()[1])
        shares[start] = dark.area / face.area
    assert shares["initial"] > 0.6
    assert shares["shrunk"] < 0.3


@pytest.mark.parametrize("gsd", [0.1, 0.15, 0.2, 0.25, 0.5])
def test_the_rim_of_a_roof_in_dense_points_does_not_depend_on_the_pixels(gsd):
    builder = SceneBuilder(gsd=gsd, spacing=0.3, side=40).house(rectangle(20, 20, 14, 10, 20))
    scene = builder.build()
    scatter = np.random.default_rng(1).normal(0, 0.12, (2, len(scene.points)))
    points = replace(scene.points, x=scene.points.x + scatter[0], y=scene.points.y + scatter[1])
    moved = Scene("moved", scene.extent, crs=scene.crs, points=points, image=scene.image, dem=scene.dem)
    area = shapely.union_all(detect(moved).polygons).area
    assert area == pytest.approx(140, rel=0.06)


def test_a_tree_as_big_as_a_house_is_dropped_for_its_colour():
    builder = SceneBuilder().house(rectangle(16, 40, 15, 10, 20)).tree(42, 18, 6.0, LEAVES)
    found = detect(builder.build())
    assert len(found) == 1
    assert found.polygons[0].intersects(builder.truth()[0])


def test_a_green_roof_is_lost_by_its_colour():
    builder = SceneBuilder().house(rectangle(30, 30, 15, 10, 20), GREEN_ROOF)
    found = detect(builder.build())
    assert len(found) == 0
    assert found.metadata["lines vegetation beside it"] == 4


def test_the_printed_index_without_infrared_keeps_green_and_drops_red():
    red = SceneBuilder().house(rectangle(30, 30, 15, 10, 20)).build()
    green = SceneBuilder().house(rectangle(30, 30, 15, 10, 20), GREEN_ROOF).build()
    assert len(detect(red, vegetation="pseudo-ndvi")) == 0
    assert len(detect(green, vegetation="pseudo-ndvi")) == 1


def test_two_houses_two_metres_apart_stay_two():
    builder = SceneBuilder().house(rectangle(20, 30, 14, 10)).house(rectangle(36, 30, 14, 10))
    found = detect(builder.build())
    assert len(found) == 2
    assert not found.polygons[0].intersects(found.polygons[1])


@pytest.mark.parametrize(("gsd", "spacing"), [(0.1, 1.0), (0.25, 0.5), (0.5, 0.35)])
def test_other_ground_sampling_distances_and_point_spacings_find_the_house(gsd, spacing):
    builder = SceneBuilder(gsd=gsd, spacing=spacing).house(rectangle(30, 30, 15, 10, 30))
    found = detect(builder.build())
    assert len(found) == 1
    truth = builder.truth()[0]
    iou = found.polygons[0].intersection(truth).area / found.polygons[0].union(truth).area
    assert iou > 0.85


def test_moving_a_scene_by_whole_tiles_moves_its_result():
    here = SceneBuilder().house(rectangle(30, 30, 15, 10, 30)).tree(45, 45, 3)
    there = SceneBuilder(west=1000 + 675.0, south=2000 - 1350.0, houses=here.houses, trees=here.trees)
    moved = shapely.affinity.translate(detect(here.build()).polygons[0], 675, -1350)
    assert shapely.hausdorff_distance(moved, detect(there.build()).polygons[0]) < 1e-6


def test_the_same_scene_gives_the_same_bits():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 30)).tree(45, 45, 3).build()
    first, second = detect(scene), detect(scene)
    assert shapely.to_wkb(first.polygons).tolist() == shapely.to_wkb(second.polygons).tolist()


def test_no_building_and_no_point_give_an_empty_result():
    bare = SceneBuilder().build()
    assert len(detect(bare)) == 0
    nothing = PointCloud(np.empty(0), np.empty(0), np.empty(0))
    assert len(detect(Scene("empty", bare.extent, points=nothing, image=bare.image, dem=bare.dem))) == 0


def test_a_house_cut_by_the_border_of_the_points_makes_no_line_along_the_border():
    builder = SceneBuilder().house(rectangle(30, 0, 14, 12))
    found = Original().trace(builder.build().for_detection())
    assert len(found.final) == 1
    assert {int(outcome) for outcome in found.outcomes} <= {0, 1, 5}


def test_a_scene_without_image_or_elevation_is_refused_with_the_reason():
    scene = SceneBuilder().build()
    bare = Scene("bare", scene.extent, points=scene.points, dem=scene.dem)
    with pytest.raises(MissingInputError, match="orthoimage"):
        detect(bare)
    assert bare.lacks(Original.requires)


def test_a_grey_image_is_read_as_brightness_and_said_to_be_grey():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 30)).build()
    house = scene.reference.polygons[0] if scene.reference is not None else detect(scene).polygons[0]
    grey = Image(scene.image.values[1:2], ("grey",), scene.image.grid)
    found = detect(Scene("grey", scene.extent, points=scene.points, image=grey, dem=scene.dem))
    assert len(found) == 1
    assert found.polygons[0].intersection(house).area > 0.8 * found.polygons[0].union(house).area
    assert "grey" in found.metadata["notes"][0]
    assert "notes" not in detect(scene).metadata


def test_infrared_alone_is_read_as_brightness_and_a_single_colour_is_a_reason_to_skip():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 30)).build()
    band = scene.image.values[1:2]

    def shown(name):
        image = Image(band, (name,), scene.image.grid)
        return Scene(name, scene.extent, points=scene.points, image=image, dem=scene.dem)

    found, grey = detect(shown("nir")), detect(shown("grey"))
    assert shapely.to_wkb(found.polygons).tolist() == shapely.to_wkb(grey.polygons).tolist()
    assert found.metadata["notes"] == grey.metadata["notes"]
    assert found.metadata["cues"] == ["height"]
    assert "red, green and blue, or a grey one" in shown("blue").lacks(Original.requires)
    with pytest.raises(MissingInputError, match="grey"):
        detect(shown("blue"))


def test_colour_infrared_without_blue_is_tested_for_vegetation():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 30)).build()
    red, green = (scene.image.values[scene.image.bands.index(name)] for name in ("red", "green"))
    image = Image(np.stack([red, red, green]), ("nir", "red", "green"), scene.image.grid)
    found = detect(Scene("cir", scene.extent, points=scene.points, image=image, dem=scene.dem))
    assert len(found) == 1
    assert found.metadata["cues"] == ["height", "image vegetation"]
    assert "notes" not in found.metadata


def test_a_16_bit_image_and_another_order_of_bands_change_nothing():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 30)).build()
    values = scene.image.values[::-1].astype(np.uint16) * 257
    image = Image(values, ("blue", "green", "red"), scene.image.grid)
    other = Scene("16 bit", scene.extent, points=scene.points, image=image, dem=scene.dem)
    assert shapely.to_wkb(detect(other).polygons).tolist() == shapely.to_wkb(detect(scene).polygons).tolist()


def test_near_infrared_is_used_where_there_is_some():
    scene = SceneBuilder().house(rectangle(30, 30, 15, 10, 30), GREEN_ROOF).build()
    infrared = scene.image.values[:1]
    image = Image(np.concatenate([scene.image.values, infrared]), ("red", "green", "blue", "nir"), scene.image.grid)
    assert len(detect(Scene("rgbi", scene.extent, points=scene.points, image=image, dem=scene.dem))) == 1


def test_the_detector_is_found_by_name_and_checks_its_parameters():
    assert make_detector("original[ground_tile=500,ground=tile-mode]").changed() == {
        "ground_tile": 500.0,
        "ground": "tile-mode",
    }
    with pytest.raises(ParameterError, match="reduction"):
        make_detector("original[reduction=3]")


def test_the_former_name_of_the_ground_tile_is_answered_with_the_new_one():
    with pytest.raises(ParameterError, match="ground_tile"):
        make_detector("improved[tile_size=500]")


def test_on_a_slope_the_tile_ground_fails_and_the_point_ground_does_not():
    flat = SceneBuilder().house(rectangle(15, 45, 15, 10)).house(rectangle(45, 15, 15, 10)).build()
    slope = 0.3
    points = flat.points
    tilted = PointCloud(points.x, points.y, points.z + slope * (points.x - flat.extent[0]))
    grid = Grid(flat.dem.grid.west, flat.dem.grid.north, 1.0, 60, 60)
    dem = Elevation((10 + slope * (np.arange(60) + 0.5) * np.ones((60, 1))).astype(np.float32), grid)
    scene = Scene("slope", flat.extent, points=tilted, image=flat.image, dem=dem)
    tile, point = detect(scene, ground="tile-dem"), detect(scene)
    assert len(point) == 2
    houses = [rectangle(1015, 2045, 15, 10), rectangle(1045, 2015, 15, 10)]
    well = [
        sum(any(p.intersection(h).area / p.union(h).area > 0.8 for p in found.polygons) for h in houses)
        for found in (tile, point)
    ]
    assert well[1] == 2
    assert well[0] < 2
