"""What laser and camera record follows from geometry: hand-made worlds whose answer is known."""

import dataclasses
import math

import numpy as np
import pytest

from roofbench.scenes.geodata.raster import Elevation, Grid
from roofbench.scenes.synthetic.camera import camera_position
from roofbench.scenes.synthetic.lidar import scan
from roofbench.scenes.synthetic.lighting import sun_vector, sunlit
from roofbench.scenes.synthetic.orthoimage import photograph
from roofbench.scenes.synthetic.recipe import SceneParameters
from roofbench.scenes.synthetic.reference import digitise
from roofbench.scenes.synthetic.solids import Body, Roof, Solid, Solids
from roofbench.scenes.synthetic.streams import fractal_tile, stream
from roofbench.scenes.synthetic.surface import rasterise
from roofbench.scenes.synthetic.survey import measured_dem
from roofbench.scenes.synthetic.world import make_world

WHITE, BLACK = (0.9, 0.9, 0.9, 0.9), (0.06, 0.06, 0.06, 0.06)
LEVEL = 50.0


def flat_world(*solids, seed=1, **parameters):
    """A level plain of 120 x 120 m at 50 m with nothing but these solids on it."""
    plain = {"width": 120, "height": 120, "buildings": 0, "tree_density": 0, "clutter": 0, "slope": 0, "undulation": 0}
    ideal = {"vertical_noise": 0, "horizontal_noise": 0, "dropouts": 0, "image_noise": 0, "blur": 0}
    recipe = SceneParameters(**(plain | ideal | {"elevation": LEVEL} | parameters))
    for solid in solids:
        solid.base = LEVEL
    return dataclasses.replace(make_world(recipe, seed), solids=Solids.of(list(solids)))


def tower(height, x=60.0, y=60.0, size=12.0, angle=0.0, **more):
    values = {"colour": WHITE, "wall": BLACK} | more
    return Solid(x, y, angle, size, size, height, **values)


def bright_part(image, threshold=215):
    """Centre of the pixels that show the white roof."""
    rows, columns = np.nonzero(image.values.min(axis=0) > threshold)
    x, y = image.grid.to_world(rows + 0.5, columns + 0.5)
    return x.mean(), y.mean(), len(rows)


@pytest.mark.parametrize("height", [10.0, 30.0, 60.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_roof_leans_outwards_by_the_relief_displacement(height, seed):
    world = flat_world(tower(height), seed=seed, view_angle=15, gsd=0.2, sun_elevation=89)
    x, y, _ = bright_part(photograph(world, (0.0, 0.0)))
    camera = camera_position(world.recipe, seed)
    flying, away = camera[2] - LEVEL, math.hypot(60 - camera[0], 60 - camera[1])
    displacement = away * height / (flying - height)
    outwards = (60 - camera[0]) / away, (60 - camera[1]) / away
    assert x - 60 == pytest.approx(displacement * outwards[0], abs=0.25)
    assert y - 60 == pytest.approx(displacement * outwards[1], abs=0.25)


def test_seen_from_straight_above_a_roof_lies_on_its_footprint():
    world = flat_world(tower(8, angle=0.4), view_angle=0, flying_height=9000, gsd=0.1, sun_elevation=90)
    x, y, count = bright_part(photograph(world, (0.0, 0.0)))
    assert (x, y) == pytest.approx((60, 60), abs=0.1)
    assert count * 0.01 == pytest.approx(144, rel=0.02)


def test_the_registration_shift_moves_the_image_and_nothing_else():
    plain, shifted = (flat_world(tower(8), view_angle=0, registration_shift=length, gsd=0.1) for length in (0, 2))
    x, y, _ = bright_part(photograph(plain, (0.0, 0.0)))
    other_x, other_y, _ = bright_part(photograph(shifted, (0.0, 0.0)))
    assert math.hypot(other_x - x, other_y - y) == pytest.approx(2.0, abs=0.1)
    np.testing.assert_array_equal(scan(plain, (0.0, 0.0)).z, scan(shifted, (0.0, 0.0)).z)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_reference_digitised_in_the_image_lies_where_the_roof_is_seen(seed):
    parameters = {"view_angle": 12, "registration_shift": 1.5, "sun_elevation": 89, "gsd": 0.1, "digitised": "image"}
    world = flat_world(tower(25.0, x=70.0, y=50.0, angle=0.3), seed=seed, **parameters)
    image = photograph(world, (0.0, 0.0))
    rows, columns = np.nonzero(image.values.min(axis=0) > 215)
    x, y = image.grid.to_world(rows + 0.5, columns + 0.5)
    outline = digitise(world, (0.0, 0.0)).polygons[0]
    assert outline.bounds == pytest.approx((x.min(), y.min(), x.max(), y.max()), abs=0.3)
    assert math.hypot(outline.centroid.x - 70, outline.centroid.y - 50) > 1
    ground = digitise(dataclasses.replace(world, recipe=SceneParameters()), (0.0, 0.0)).polygons[0].centroid
    assert (ground.x, ground.y) == pytest.approx((70, 50), abs=0.01)


@pytest.mark.parametrize("elevation", [25.0, 45.0, 70.0])
@pytest.mark.parametrize("azimuth", [0.0, 90.0, 200.0, 300.0])
def test_a_shadow_is_as_long_as_the_sun_is_low(elevation, azimuth):
    height, size = 12.0, 16.0
    turn = math.radians(90 - azimuth)  # so that the shadow falls along the tower's own axis
    world = flat_world(tower(height, size=size, angle=turn), sun_elevation=elevation, sun_azimuth=azimuth, gsd=0.2)
    surface = rasterise(world, Grid.covering((0, 0, 120, 120), 0.2), fractal_tile(stream(1, "texture"), 64, 4, 0.8))
    dark = ~sunlit(surface, world.recipe)
    assert dark.sum() * 0.04 / size == pytest.approx(height / math.tan(math.radians(elevation)), rel=0.05, abs=0.3)
    rows, columns = np.nonzero(dark)
    x, y = surface.grid.to_world(rows + 0.5, columns + 0.5)
    east, north, _ = sun_vector(world.recipe)
    assert (x.mean() - 60) * east + (y.mean() - 60) * north < 0


def test_the_sunlit_face_of_a_roof_is_brighter_than_the_shaded_one():
    house = tower(4, size=20, roof=Roof.GABLE, pitch=0.6, colour=(0.5, 0.5, 0.5, 0.5))
    world = flat_world(house, sun_azimuth=0, sun_elevation=45, view_angle=0, gsd=0.2)
    image = photograph(world, (0.0, 0.0)).values.astype(float)
    # The ridge runs from west to east; rows count from the north.
    north_face, south_face = image[:, 260:290, 270:330].mean(), image[:, 310:340, 270:330].mean()
    assert north_face > 1.4 * south_face


def test_pulses_find_the_height_of_roof_and_ground():
    world = flat_world(tower(9.0), scan_angle=0)
    cloud = scan(world, (0.0, 0.0))
    on = (np.abs(cloud.x - 60) < 5.5) & (np.abs(cloud.y - 60) < 5.5)
    off = np.maximum(np.abs(cloud.x - 60), np.abs(cloud.y - 60)) > 7
    assert np.abs(cloud.z[on] - LEVEL - 9).max() < 0.011
    assert cloud.z[off].max() < LEVEL + 0.12  # grass


def test_off_nadir_walls_return_points_and_the_ground_behind_them_none():
    tall = tower(60.0, size=20.0)
    world = flat_world(tall, scan_angle=20, point_spacing=0.4, pulse="first")
    cloud = scan(world, (0.0, 0.0))
    inside = np.maximum(np.abs(cloud.x - 60), np.abs(cloud.y - 60)) < 10.3
    walls = inside & (cloud.z > LEVEL + 2) & (cloud.z < LEVEL + 58)
    assert walls.sum() > 100
    assert np.all(np.maximum(np.abs(cloud.x - 60), np.abs(cloud.y - 60))[walls] > 9.5)
    # The shadow of the laser: fewer ground points on one side of the tower than on the other.
    ring = (np.hypot(cloud.x - 60, cloud.y - 60) < 24) & (cloud.z < LEVEL + 1) & ~inside
    sides = np.histogram(np.arctan2(cloud.y[ring] - 60, cloud.x[ring] - 60), 8)[0]
    assert sides.min() < 0.55 * sides.max()


def grove(**parameters):
    recipe = SceneParameters(width=80, height=80, buildings=0, tree_density=120, clutter=0, **parameters)
    return make_world(recipe, 3)


def test_first_pulses_stay_in_the_crowns_and_last_pulses_come_through():
    def high(pulse):
        world = grove(pulse=pulse)
        cloud = scan(world, (0.0, 0.0))
        return float(np.mean(cloud.z - world.terrain.sample(cloud.x, cloud.y) > 2))

    assert high("first") > 1.5 * high("last")
    assert high("last") > 0.02


def test_all_returns_hold_first_and_last_ones():
    clouds = {pulse: scan(grove(pulse=pulse), (0.0, 0.0)) for pulse in ("first", "last", "all")}
    every = clouds["all"]
    assert (every.return_number == 1).sum() == pytest.approx(len(clouds["first"]), rel=0.01)
    assert (every.return_number == every.number_of_returns).sum() == pytest.approx(len(clouds["last"]), rel=0.01)
    assert every.number_of_returns.max() >= 3
    first = every.take(every.return_number == 1)
    np.testing.assert_array_equal(np.sort(first.z), np.sort(clouds["first"].z))


def test_a_tree_higher_up_a_pulse_hides_the_roof_below_it():
    recipe = SceneParameters(width=110, height=110, buildings=6, tree_density=150, tree_gap=-2, pulse="first", slope=0)
    world = make_world(recipe, 2)
    cloud = scan(world, (0.0, 0.0))
    bare = dataclasses.replace(world, trees=make_world(dataclasses.replace(recipe, tree_density=0), 2).trees)
    assert (cloud.classification == 6).sum() < 0.97 * (scan(bare, (0.0, 0.0)).classification == 6).sum()


def test_water_returns_hardly_a_pulse():
    world = flat_world()
    pool = np.array([[60.0, 60.0, 0.0, 20.0, 20.0, 4.0]])
    cloud = scan(dataclasses.replace(world, patches=pool), (0.0, 0.0))
    wet = (np.abs(cloud.x - 60) < 9) & (np.abs(cloud.y - 60) < 9)
    dry = (np.abs(cloud.x - 25) < 9) & (np.abs(cloud.y - 25) < 9)
    assert wet.sum() < 0.15 * dry.sum()


@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.4])
def test_vertical_noise_has_the_deviation_asked_for(sigma):
    world = flat_world(tower(9.0, size=60), scan_angle=0, vertical_noise=sigma)
    cloud = scan(world, (0.0, 0.0))
    on = (np.abs(cloud.x - 60) < 28) & (np.abs(cloud.y - 60) < 28)
    assert float(np.std(cloud.z[on])) == pytest.approx(sigma, rel=0.05, abs=0.004)


def test_the_dem_is_the_bare_earth_but_for_its_own_error():
    world = make_world(SceneParameters(buildings=0, tree_density=0, clutter=0, slope=4, dem_error=0.3), 1)
    dem = measured_dem(world, (0.0, 0.0))
    x, y = np.meshgrid(np.arange(5.5, 245), np.arange(5.5, 245))
    error = dem.sample(x, y) - world.terrain.sample(x, y)
    assert float(error.std()) == pytest.approx(0.3, rel=0.15)
    exact = measured_dem(dataclasses.replace(world, recipe=dataclasses.replace(world.recipe, dem_error=0)), (0.0, 0.0))
    np.testing.assert_allclose(exact.sample(x, y), world.terrain.sample(x, y), atol=0.01)


@pytest.mark.parametrize("slope", [0.0, 15.0])
def test_the_dem_errs_more_on_slopes_by_its_error_in_place(slope):
    world = make_world(
        SceneParameters(buildings=0, tree_density=0, clutter=0, slope=slope, undulation=0, dem_error=0.2), 1
    )
    x, y = np.meshgrid(np.arange(5.5, 245), np.arange(5.5, 245))
    error = measured_dem(world, (0.0, 0.0)).sample(x, y) - world.terrain.sample(x, y)
    expected = math.hypot(0.2, 3 * 0.2 * math.tan(math.radians(slope)))
    assert float(error.std()) == pytest.approx(expected, rel=0.2)


def test_the_dem_knows_the_pad_below_a_house_only_by_its_rim():
    """Below a building it is interpolated from the ground around, which is uphill higher than downhill."""
    recipe = SceneParameters(
        buildings=20, slope=12, undulation=0, terracing=1, dem_error=0, tree_density=0, clutter=0, outbuildings=0
    )
    world = make_world(recipe, 1)
    dem = measured_dem(world, (0.0, 0.0))
    solids = world.solids
    rises, levels = [], []
    for row in np.flatnonzero((solids.body == Body.BUILDING) & (solids.areas > 80)):
        x, y, angle, length, width = solids.rectangle[row]
        along, across = (np.array(pair) for pair in np.meshgrid((-0.45, 0.45), (-0.45, 0.45)))
        east = x + math.cos(angle) * along * length - math.sin(angle) * across * width
        north = y + math.sin(angle) * along * length + math.cos(angle) * across * width
        levels.append(np.ptp(world.terrain.sample(east, north)))
        rises.append(np.ptp(dem.sample(east, north)))
    assert np.median(rises) > 3 * np.median(levels)


def test_solids_agree_between_laser_and_camera():
    house = Solid(60.0, 60.0, 0.7, 24.0, 14.0, 4.0, roof=Roof.HIP, pitch=0.5, body=Body.BUILDING)
    world = flat_world(house, scan_angle=0)
    surface = rasterise(world, Grid.covering((0, 0, 120, 120), 0.1), fractal_tile(stream(1, "texture"), 64, 4, 0.8))
    cloud = scan(world, (0.0, 0.0))
    top = Elevation(surface.z, surface.grid).sample(cloud.x, cloud.y)
    inner = np.hypot(cloud.x - 60, cloud.y - 60) < 6.5
    np.testing.assert_allclose(cloud.z[inner], top[inner], atol=0.06)
