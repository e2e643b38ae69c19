"""Images made of the colours of points, and images that were processed."""

import numpy as np
import pytest

import roofbench as rb


def scene(**parameters):
    return rb.make_scene("fairfield-1-small", seed=3, width=60, height=60, buildings=3, **parameters)


@pytest.fixture(scope="module")
def taken():
    return scene().image


def test_points_have_the_colour_of_the_pixel_they_lie_in(taken):
    made = scene(point_colours=True)
    row, column = (value.astype(int) for value in made.image.grid.to_pixel(made.points.x, made.points.y))
    np.testing.assert_array_equal(made.image.values, taken.values)
    np.testing.assert_array_equal(made.points.colour, taken.values[:, row, column].T.astype(np.uint16) * 257)
    assert scene().points.colour is None


@pytest.mark.parametrize("fill", ["nearest", "interpolated"])
def test_an_image_of_points_has_pixels_by_their_density_and_the_colours_of_the_photograph(taken, fill):
    dense, thin = (scene(image_from=fill, point_spacing=spacing).image for spacing in (0.3, 1.0))
    assert (dense.grid.gsd, thin.grid.gsd) == (pytest.approx(0.21), pytest.approx(0.7))
    for image in (dense, thin):
        np.testing.assert_allclose(image.values.mean(axis=(1, 2)), taken.values.mean(axis=(1, 2)), atol=3)


def test_nearest_repeats_pixels_and_interpolation_does_not():
    nearest, linear = (
        scene(image_from=fill, point_spacing=1.0).image.values.astype(int) for fill in ("nearest", "interpolated")
    )
    repeated = [(np.diff(values, axis=2) == 0).all(axis=0).mean() for values in (nearest, linear)]
    assert repeated[0] > 0.2 > 4 * repeated[1]


def test_processing_changes_contrast_as_named(taken):
    def contrast(processing):
        values = scene(image_processing=processing).image.values.astype(float)
        assert values.shape == taken.values.shape
        return np.abs(np.diff(values, axis=2)).mean()

    measured = {name: contrast(name) for name in ("none", "resampled", "compressed", "sharpened", "blurred")}
    assert measured["sharpened"] > 1.5 * measured["none"]
    assert measured["none"] > measured["compressed"]
    assert measured["none"] > 2 * measured["resampled"]
    assert measured["none"] > 2 * measured["blurred"]
