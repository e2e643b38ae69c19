"""Outlines of classes, images of coloured points, and surfaces: what is derived from points."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.core.errors import InputError
from roofbench.scenes.geodata.coloured_points import image_from_points
from roofbench.scenes.geodata.surfaces import highest_surface, mean_intensity
from roofbench.scenes.importing.class_outlines import outlines_of_class

EXTENT = (0.0, 0.0, 60.0, 50.0)


def cloud(count=60_000, *, building=None, seed=0, colour=None):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, 60, count), rng.uniform(0, 50, count)
    inside = np.zeros(count, bool) if building is None else shapely.contains_xy(building, x, y)
    return rb.PointCloud(
        x=x,
        y=y,
        z=np.where(inside, 8.0, 0.0),
        return_number=np.ones(count, np.uint8),
        intensity=np.where(inside, 900, 100).astype(np.uint16),
        classification=np.where(inside, 6, 2).astype(np.uint8),
        colour=None if colour is None else colour(x, y),
    )


def agreement(one, two):
    return shapely.intersection(one, two).area / shapely.union(one, two).area


@pytest.mark.parametrize("angle", [0, 20, 45])
def test_an_outline_follows_its_building(angle):
    building = shapely.affinity.rotate(shapely.box(15, 15, 45, 35), angle)
    outlines = outlines_of_class(cloud(building=building), EXTENT)
    assert len(outlines) == 1
    assert agreement(outlines.polygons[0], building) > 0.93
    assert len(outlines.polygons[0].exterior.coords) <= 14, "stair steps are simplified"


def test_courts_stay_open_and_chimneys_do_not_pierce():
    court, chimney = shapely.box(25, 20, 35, 30), shapely.box(16, 16, 16.8, 16.8)
    building = shapely.box(10, 10, 50, 40).difference(court).difference(chimney)
    (outline,) = outlines_of_class(cloud(building=building), EXTENT).polygons
    assert len(outline.interiors) == 1
    assert outline.area == pytest.approx(1100, rel=0.05)


def test_small_things_and_single_points_are_dropped():
    shed, car = shapely.box(5, 5, 11, 10), shapely.box(30, 30, 32, 33)
    points = cloud(building=shapely.union(shed, car))
    points.classification[:20] = 6
    outlines = outlines_of_class(points, EXTENT)
    assert len(outlines) == 1
    assert shapely.intersects(outlines.polygons[0], shed)
    assert len(outlines_of_class(points, EXTENT, minimum_area=2)) == 2


def test_houses_two_metres_apart_stay_two():
    row = shapely.union(shapely.box(5, 10, 25, 30), shapely.box(27, 10, 47, 30))
    assert len(outlines_of_class(cloud(building=row), EXTENT)) == 2


def test_a_building_at_the_border_is_not_cut_further():
    building = shapely.box(0, 0, 20, 50)
    (outline,) = outlines_of_class(cloud(building=building), EXTENT).polygons
    assert agreement(outline, building) > 0.93


def test_without_classes_there_is_nothing_to_trace():
    with pytest.raises(InputError, match="not classified"):
        outlines_of_class(cloud().unclassified(), EXTENT)


def half_and_half(x, y):
    """Red in the west, green in the north of the east, blue in its south."""
    west, north = x < 30, y > 25
    red, green, blue = west, ~west & north, ~west & ~north
    return (np.stack([red, green, blue], axis=1) * 65_535).astype(np.uint16)


def test_colours_come_where_their_points_are():
    image = image_from_points(cloud(colour=half_and_half), EXTENT)
    assert (image.bands, image.values.dtype) == (("red", "green", "blue"), np.uint8)
    for x, y, band in ((10, 25, 0), (50, 40, 1), (50, 10, 2)):
        row, column = (int(value) for value in image.grid.to_pixel(x, y))
        expected = np.zeros(3)
        expected[band] = 255
        np.testing.assert_array_equal(image.values[:, row, column], expected)


def test_the_cell_size_follows_the_density():
    assert image_from_points(cloud(300_000, colour=half_and_half), EXTENT).grid.gsd == 0.1
    assert image_from_points(cloud(12_000, colour=half_and_half), EXTENT).grid.gsd == 0.5
    assert image_from_points(cloud(12_000, colour=half_and_half), EXTENT, gsd=0.25).grid.gsd == 0.25


def test_gaps_are_filled_near_points_and_left_open_beyond():
    points = cloud(colour=half_and_half)
    image = image_from_points(points.take((points.x < 20) | (points.x > 40)), EXTENT, gsd=0.5)
    row, columns = 50, (np.array([20.25, 21.25, 30, 38.75, 39.75]) / 0.5).astype(int)
    assert image.valid[row, columns].tolist() == [True, True, False, True, True]
    assert image.values[0, row, columns[1]] == 255
    assert image.values[:, row, columns[2]].tolist() == [0, 0, 0]


def test_gaps_are_interpolated_or_take_the_nearest_colour():
    x = np.array([0.5, 3.5])
    grey = np.repeat(np.array([[10], [40]], np.uint16) * 257, 3, axis=1)
    points = rb.PointCloud(x=x, y=np.full(2, 0.5), z=np.zeros(2), colour=grey)
    linear, nearest = (
        image_from_points(points, (0, 0, 4, 1), gsd=1.0, fill=fill) for fill in ("interpolated", "nearest")
    )
    assert nearest.values[0, 0].tolist() == [10, 10, 40, 40]
    # Weights 1 and 1/16 at distances 1 and 2, cells with points keep their colour.
    assert linear.values[0, 0].tolist() == [10, 12, 38, 40]


def test_later_returns_do_not_colour_the_image():
    points = cloud(colour=half_and_half)
    points.return_number[points.x > 30] = 2
    image = image_from_points(points, EXTENT, gsd=0.5)
    assert not image.valid[:, 80:].any()


def test_a_surface_holds_the_highest_point_of_each_cell():
    points = rb.PointCloud(x=np.array([0.5, 0.6, 1.5]), y=np.array([0.5, 0.4, 1.5]), z=np.array([1.0, 3.0, 2.0]))
    surface = highest_surface(points, rb.Grid(0, 2, 1, 2, 2))
    np.testing.assert_array_equal(surface.values, [[np.nan, 2], [3, np.nan]])
    assert mean_intensity(points, surface.grid) is None


def test_intensity_is_averaged_per_cell():
    points = cloud(building=shapely.box(10, 10, 20, 20))
    mean = mean_intensity(points, rb.Grid(0, 50, 10, 5, 6))
    assert mean.values[3, 1] == pytest.approx(900)
    assert mean.values[0, 0] == pytest.approx(100)
