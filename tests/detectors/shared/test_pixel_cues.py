import numpy as np
import pytest
from naive import pixel_cues as naive_pixel_cues

from roofbench.detectors.shared.pixel_cues import chromaticity, greenness
from roofbench.scenes.geodata.raster import Grid, Image

GRID = Grid(500.0, 910.0, 1.0, 8, 10)


@pytest.mark.parametrize("gsd", [0.25, 1.0, 2.0])
def test_greenness_is_that_of_the_place_at_any_pixel_size(gsd):
    fine = Grid.covering(GRID.extent, gsd)
    column = np.broadcast_to(np.arange(fine.columns), fine.shape)
    green = column * gsd < 4
    values = np.stack([np.where(green, 80, 120), np.where(green, 160, 120), np.full(fine.shape, 90)]).astype(np.uint8)
    index = greenness(Image(values, ("red", "green", "blue"), fine), GRID, darkest=0.1)
    np.testing.assert_allclose(index[:, :3], 1 / 3, atol=0.01)
    np.testing.assert_allclose(index[:, 5:], 0, atol=0.01)


def test_shadow_and_missing_pixels_have_no_greenness():
    values = np.full((3, 8, 10), 100, dtype=np.uint8)
    values[:, :, :3] = 5
    valid = np.ones((8, 10), dtype=bool)
    valid[:, 8:] = False
    index = greenness(Image(values, ("red", "green", "blue"), GRID, valid), GRID, darkest=0.1)
    assert np.isnan(index[:, :3]).all()
    assert np.isnan(index[:, 8:]).all()
    assert (index[:, 3:8] == 0).all()


def test_a_grey_image_has_no_greenness():
    grey = Image(np.full((1, 8, 10), 100, dtype=np.uint8), ("grey",), GRID)
    assert greenness(grey, GRID, darkest=0.1) is None
    assert chromaticity(grey, GRID, darkest=0.1) is None


def test_chromaticity_is_that_of_the_tiles_in_sun_and_shade():
    values = np.array([120, 60, 60], np.uint8)[:, None, None] * np.ones(GRID.shape)
    values[:, :, 5:] *= 0.5
    values[:, 7:] = 5
    shares = chromaticity(Image(values.astype(np.uint8), ("red", "green", "blue"), GRID), GRID, darkest=0.1)
    np.testing.assert_allclose(shares[0, :7], 0.5, atol=0.01)
    np.testing.assert_allclose(shares[1, :7], 0.25, atol=0.01)
    assert np.isnan(shares[:, 7:]).all()


@pytest.mark.parametrize("gsd", [0.3, 1.0, 1.7])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_cells_have_the_means_of_pixels_that_are_averaged_one_by_one(gsd, dtype):
    rng = np.random.default_rng(2)
    # Some cells are beyond the image.
    pixels = Grid(498.3, 909.2, gsd, round(9 / gsd), round(11 / gsd))
    values = rng.integers(0, np.iinfo(dtype).max, (4, *pixels.shape)).astype(dtype)
    values[:, :, :2] = 0
    for mask in (None, rng.random(pixels.shape) < 0.8):
        image = Image(values, ("red", "green", "blue", "nir"), pixels, mask)
        index = greenness(image, GRID, darkest=0.3)
        np.testing.assert_allclose(
            index, naive_pixel_cues.cell_means(image, GRID, naive_pixel_cues.green, 0.3), atol=1e-5
        )
        for share, name in zip(chromaticity(image, GRID, darkest=0.3), ("red", "blue"), strict=True):
            expected = naive_pixel_cues.cell_means(image, GRID, naive_pixel_cues.share_of(name), 0.3)
            np.testing.assert_allclose(share, expected, atol=1e-5)
