from dataclasses import replace

import cv2
import numpy as np
import pytest
import shapely
from shapely.affinity import rotate, translate

from roofbench.core.errors import MissingInputError
from roofbench.detectors.ndsm.ndsm_detector import NDSM, _means_inside
from roofbench.detectors.registry import make_detector
from roofbench.scenes.geodata.outlines import coverage_of_mask, trace
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid, Image
from roofbench.scenes.scene import Scene

EXTENT = (500.0, 900.0, 560.0, 960.0)
CENTRE = shapely.Point(530, 930)
RNG = np.random.default_rng(0)


class Place:
    """A place in the making: terrain, then roofs and trees put on it."""

    def __init__(self, *, density=8.0, slope=0.0, seed=0):
        self.rng = np.random.default_rng(seed)
        n = int(3600 * density)
        self.x, self.y = self.rng.uniform(500, 560, n), self.rng.uniform(900, 960, n)
        self.ground = 20 + slope * (self.x - 500)
        self.z = self.ground.copy()
        self.returns = np.ones(n, dtype=np.uint8)
        self.number = np.ones(n, dtype=np.uint8)

    def roof(self, polygon, height=6.0):
        inside = shapely.contains_xy(polygon, self.x, self.y)
        self.z[inside] = self.ground[inside].mean() + height
        return self

    def tree(self, polygon, height=8.0):
        inside = shapely.contains_xy(polygon, self.x, self.y)
        self.z[inside] = self.ground[inside] + self.rng.uniform(0, height, inside.sum())
        self.number[inside] = 3
        self.returns[inside] = self.rng.integers(1, 4, inside.sum())
        return self

    def scene(self, *, numbered=True, **more):
        z = self.z + self.rng.normal(0, 0.03, len(self.z))
        returns = (self.returns, self.number) if numbered else (None, None)
        return Scene("place", EXTENT, crs="EPSG:25832", points=PointCloud(self.x, self.y, z, *returns), **more)


def rectangle(length, width, angle=0.0, at=CENTRE):
    return rotate(shapely.box(at.x - length / 2, at.y - width / 2, at.x + length / 2, at.y + width / 2), angle)


def corners(polygon):
    return shapely.get_num_coordinates(polygon) - 1


def iou(one, two):
    return one.intersection(two).area / one.union(two).area


@pytest.mark.parametrize("angle", [0, 13, 30, 45, 71])
def test_a_box_house_is_found_within_a_cell_at_any_angle(angle):
    house = rectangle(14, 9, angle)
    found = NDSM(cell=0.5).detect(Place().roof(house).scene(), RNG)
    assert len(found) == 1
    assert shapely.hausdorff_distance(found.polygons[0].exterior, house.exterior) < 0.5
    assert corners(found.polygons[0]) == 4


@pytest.mark.parametrize("density", [3, 10, 60])
def test_a_house_is_found_at_any_density(density):
    house = rectangle(14, 9, 20)
    found = NDSM().detect(Place(density=density).roof(house).scene(), RNG)
    assert len(found) == 1
    assert iou(found.polygons[0], house) > (0.88 if density == 3 else 0.93)


def test_an_l_house_stays_one_polygon_with_six_corners():
    house = rotate(shapely.box(520, 920, 540, 928).union(shapely.box(520, 920, 528, 940)), 25, origin=CENTRE)
    found = NDSM(cell=0.5).detect(Place().roof(house).scene(), RNG)
    assert len(found) == 1
    assert corners(found.polygons[0]) == 6
    assert iou(found.polygons[0], house) > 0.94


def test_a_tree_of_the_size_of_a_house_is_dropped_with_and_without_return_numbers():
    house = rectangle(12, 9, at=translate(CENTRE, -15))
    place = Place().roof(house).tree(translate(CENTRE, 15).buffer(5))
    for numbered in (True, False):
        found = NDSM().detect(place.scene(numbered=numbered), RNG)
        assert len(found) == 1
        assert iou(found.polygons[0], house) > 0.9


@pytest.mark.parametrize("numbers", ["two", "rare"])
def test_numbers_of_returns_that_say_nothing_are_not_used(numbers):
    house = rectangle(12, 9, at=translate(CENTRE, -15))
    scene = Place().roof(house).tree(translate(CENTRE, 15).buffer(6)).scene()
    count = np.full(len(scene.points), 2, dtype=np.uint8)
    if numbers == "rare":
        count = np.where(np.arange(len(count)) % 97 == 0, 2, 1).astype(np.uint8)
    points = replace(scene.points, number_of_returns=count)
    found = NDSM().detect(Scene("odd", EXTENT, points=points), RNG)
    assert len(found) == 1
    assert iou(found.polygons[0], house) > 0.9
    assert "multiple returns" not in found.metadata["cues"]
    assert any("multiple returns" in note for note in found.metadata["notes"])


@pytest.mark.parametrize("noise", [0.03, 0.2, 0.3])
def test_roofs_of_a_noisy_cloud_are_found_as_its_ground_shows_the_noise(noise):
    house = rectangle(14, 9, 20)
    place = Place().roof(house).tree(translate(CENTRE, 18, 10).buffer(5))
    place.z += place.rng.normal(0, noise, len(place.z))
    found = NDSM().detect(place.scene(numbered=False), RNG)
    assert len(found) == 1
    assert iou(found.polygons[0], house) > 0.85


def test_a_house_on_a_slope_of_20_degrees_is_found_with_and_without_dem():
    slope = np.tan(np.radians(20))
    house = rectangle(12, 9, 10)
    # The uphill wall of a house 6 m high is still above the threshold.
    place = Place(slope=slope).roof(house, 6.5)
    grid = Grid.covering(EXTENT, 1.0)
    x, _ = grid.to_world(0, np.arange(grid.columns) + 0.5)
    dem = Elevation(np.tile(20 + slope * (x - 500), (grid.rows, 1)).astype(np.float32), grid)
    for scene in (place.scene(), place.scene(dem=dem)):
        found = NDSM().detect(scene, RNG)
        assert len(found) == 1
        assert iou(found.polygons[0], house) > 0.9


def test_a_courtyard_stays_a_hole_and_a_small_hole_is_filled():
    block = rectangle(30, 26, 15).difference(rectangle(14, 10, 15))
    found = NDSM().detect(Place().roof(block).scene(), RNG)
    assert len(found) == 1
    assert len(found.polygons[0].interiors) == 1
    assert iou(found.polygons[0], block) > 0.93
    chimney = rectangle(14, 9).difference(rectangle(1.2, 1.2))
    assert not NDSM().detect(Place().roof(chimney).scene(), RNG).polygons[0].interiors


def test_outliers_and_duplicates_change_nothing_that_matters():
    house = rectangle(14, 9, 20)
    place = Place().roof(house)
    plain = NDSM().detect(place.scene(), RNG).polygons[0]
    z = place.z.copy()
    z[3::401], z[7::907], z[11::1301], z[13::1709] = -999.0, 200.0, np.nan, 1e9
    spoilt = PointCloud(np.r_[place.x, place.x[:99]], np.r_[place.y, place.y[:99]], np.r_[z, z[:99]])
    found = NDSM().detect(Scene("spoilt", EXTENT, points=spoilt), RNG)
    assert len(found) == 1
    assert iou(found.polygons[0], plain) > 0.9


@pytest.mark.parametrize("n", [0, 1, 2, 7])
@pytest.mark.filterwarnings("error")
def test_hardly_any_points_give_no_footprints(n):
    place = Place()
    few = PointCloud(place.x[:n], place.y[:n], place.z[:n])
    assert len(NDSM().detect(Scene("few", EXTENT, points=few), RNG)) == 0


def test_a_scene_without_points_is_refused_in_one_sentence():
    with pytest.raises(MissingInputError, match="has no point cloud"):
        NDSM().detect(Scene("blind", EXTENT), RNG)


def test_no_building_gives_no_footprints():
    assert len(NDSM().detect(Place().scene(), RNG)) == 0


def test_all_heights_unknown_give_no_footprints():
    place = Place()
    unknown = PointCloud(place.x, place.y, np.full(len(place.x), np.nan))
    assert len(NDSM().detect(Scene("unknown", EXTENT, points=unknown), RNG)) == 0


def green_image(polygon, *, nir):
    grid = Grid.covering(EXTENT, 0.25)
    column, row = np.meshgrid(np.arange(grid.columns) + 0.5, np.arange(grid.rows) + 0.5)
    plant = shapely.contains_xy(polygon, *grid.to_world(row, column))
    grey, green = np.full(grid.shape, 120), np.where(plant, 160, 120)
    bands = [np.where(plant, 80, grey), green, grey] + ([np.where(plant, 220, grey)] if nir else [])
    names = ("red", "green", "blue", "nir")[: len(bands)]
    return Image(np.stack(bands).astype(np.uint8), names, grid)


@pytest.mark.parametrize("nir", [False, True])
def test_a_smooth_green_hedge_is_separated_from_a_roof_by_the_image(nir):
    house, hedge = rectangle(12, 9, at=translate(CENTRE, -15)), rectangle(8, 6, at=translate(CENTRE, 15))
    place = Place().roof(house).roof(hedge, 4.0)
    only_laser = NDSM(roughness=None, penetration=None)
    assert len(only_laser.detect(place.scene(numbered=False), RNG)) == 2
    found = only_laser.detect(place.scene(numbered=False, image=green_image(hedge, nir=nir)), RNG)
    assert len(found) == 1
    assert iou(found.polygons[0], house) > 0.9


def test_rectangles_on_request():
    house = rotate(shapely.box(520, 920, 540, 928).union(shapely.box(520, 920, 528, 940)), 25, origin=CENTRE)
    found = NDSM(outline="rectangle").detect(Place().roof(house).scene(), RNG)
    assert [corners(polygon) for polygon in found.polygons] == [4]
    assert iou(found.polygons[0], shapely.minimum_rotated_rectangle(house)) > 0.9


def test_each_footprint_has_its_height_and_its_likeness_to_a_tree():
    found = NDSM().detect(Place().roof(rectangle(14, 9), 7.0).scene(), RNG)
    assert found.attributes["height"][0] == pytest.approx(7.0, abs=0.2)
    assert found.attributes["tree_likeness"][0] < -0.8
    assert found.crs == "EPSG:25832"


def test_the_same_points_in_another_order_give_the_same_footprints():
    place = Place().roof(rectangle(14, 9, 33)).tree(translate(CENTRE, 15, 15).buffer(4))
    scene = place.scene()
    order = np.random.default_rng(1).permutation(len(scene.points))
    shuffled = Scene("shuffled", EXTENT, points=scene.points.take(order))
    one, two = (NDSM().detect(s, RNG).polygons for s in (scene, shuffled))
    np.testing.assert_allclose(shapely.get_coordinates(one), shapely.get_coordinates(two), atol=1e-6)


def test_points_that_are_there_twice_count_once():
    place = Place().roof(rectangle(14, 9, 33)).tree(translate(CENTRE, 15, 15).buffer(4))
    scene = place.scene()
    twice = Scene("twice", EXTENT, points=scene.points.take(np.repeat(np.arange(len(scene.points)), 2)), dem=scene.dem)
    # The ground is filtered from all points.
    one, two = (NDSM().detect(s, RNG).polygons for s in (scene, twice))
    assert len(one) == len(two) == 1
    assert iou(one[0], two[0]) > 0.995


def test_it_is_found_by_name():
    assert make_detector("ndsm[height=3,outline=rectangle]") == NDSM(height=3, outline="rectangle")


def test_the_steps_hold_the_heights_cues_mask_and_outlines():
    place = Place().roof(rectangle(14, 9, 20)).tree(translate(CENTRE, 18, 10).buffer(4))
    scene = place.scene(image=green_image(translate(CENTRE, 18, 10).buffer(4), nir=False))
    steps = {step.name: step for step in NDSM().steps(scene, RNG)}
    assert list(steps) == ["heights", "cues", "likeness", "mask", "outlines"]
    assert {panel.title for panel in steps["cues"].panels} >= {"roughness", "image vegetation"}
    (panel,) = steps["outlines"].panels
    heights, traced, footprints = panel.layers
    assert heights.scale.unit == "m"
    assert len(traced.polygons) >= len(footprints.polygons) == len(NDSM().detect(scene, RNG)) == 1


def test_a_scene_without_points_has_steps_too():
    none = np.empty(0)
    steps = list(NDSM().steps(Scene("empty", EXTENT, points=PointCloud(none, none, none)), RNG))
    assert len(steps[-1].panels[0].layers[-1].polygons) == 0


def test_means_inside_traced_polygons_equal_those_of_the_cells_whose_centres_they_contain():
    rng = np.random.default_rng(8)
    grid = Grid(10.0, 50.0, 0.5, 60, 70)
    mask = cv2.GaussianBlur(rng.normal(size=grid.shape), (0, 0), 1.0) > 0.02
    values = rng.normal(size=grid.shape).astype(np.float32)
    values[rng.random(grid.shape) < 0.3] = np.nan
    polygons = trace(coverage_of_mask(mask), grid)
    assert (shapely.get_num_interior_rings(polygons) > 0).any()
    row, column = np.indices(grid.shape) + 0.5
    x, y = grid.to_world(row, column)
    known = np.isfinite(values)
    held = [values[shapely.contains_xy(polygon, x, y) & known] for polygon in polygons]
    expected = [inside.mean() if len(inside) else np.nan for inside in held]
    np.testing.assert_allclose(_means_inside(polygons, mask, grid, values)[0], expected, rtol=1e-6)
