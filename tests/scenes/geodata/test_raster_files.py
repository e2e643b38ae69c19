import numpy as np
import pytest
import rasterio
from builders import small_scenes
from rasterio import Affine
from rasterio.enums import ColorInterp

import roofbench as rb
from roofbench.core.errors import InputError
from roofbench.scenes.geodata.image_bands import looks_like_values
from roofbench.scenes.geodata.raster_files import (
    read_elevation,
    read_image,
    write_elevation,
    write_image,
)
from roofbench.scenes.geodata.raster_headers import read_raster_header
from roofbench.scenes.geodata.raster_mosaic import mosaic_elevation, mosaic_image

CRS, WEST, SOUTH = small_scenes.CRS, small_scenes.WEST, small_scenes.SOUTH
NORTH_UP = Affine(0.5, 0, WEST, 0, -0.5, SOUTH + 40)


def write(path, values, *, transform=NORTH_UP, nodata=None, **more):
    profile = {"driver": "GTiff", "crs": CRS, "transform": transform, "nodata": nodata, "dtype": values.dtype, **more}
    count, height, width = values.shape
    return rasterio.open(path, "w", count=count, height=height, width=width, **profile)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize(
    "bands", [("grey",), ("red", "green", "blue"), ("red", "green", "blue", "nir"), ("nir", "red")]
)
def test_images_come_back_with_bands_and_mask(tmp_path, bands, dtype):
    before = small_scenes.image(bands=bands, dtype=dtype)
    valid = np.random.default_rng(0).random(before.grid.shape) > 0.3
    before = rb.Image(before.values, bands, before.grid, valid)
    write_image(before, tmp_path / "image.tif", crs=CRS)
    after = read_image(tmp_path / "image.tif")
    np.testing.assert_array_equal(after.values, before.values)
    np.testing.assert_array_equal(after.valid, valid)
    assert (after.bands, after.grid) == (bands, before.grid)


def test_elevation_comes_back_with_its_gaps(tmp_path):
    before = small_scenes.scene().dem
    write_elevation(before, tmp_path / "dem.tif", crs=CRS)
    after = read_elevation(tmp_path / "dem.tif")
    np.testing.assert_array_equal(after.values, before.values)
    assert after.grid == before.grid


def test_no_data_and_alpha_are_both_a_mask(tmp_path):
    values = np.full((3, 80, 80), 9, np.uint8)
    values[:, :20] = 0
    with write(tmp_path / "nodata.tif", values, nodata=0) as target:
        target.write(values)
    alpha = np.concatenate([values, np.where(values[:1] > 0, 255, 0).astype(np.uint8)])
    with write(tmp_path / "alpha.tif", alpha) as target:
        target.write(alpha)
        target.colorinterp = [ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha]
    for name in ("nodata.tif", "alpha.tif"):
        image = read_image(tmp_path / name)
        assert image.bands == ("red", "green", "blue")
        assert not image.valid[:20].any()
        assert image.valid[20:].all()
        warped = mosaic_image([read_raster_header(tmp_path / name)], image.grid, crs=CRS)
        np.testing.assert_array_equal(warped.valid, image.valid)
        np.testing.assert_array_equal(warped.values, image.values)


def test_scaled_heights_are_metres(tmp_path):
    raw = np.arange(6400, dtype=np.int16).reshape(1, 80, 80)
    with write(tmp_path / "scaled.tif", raw) as target:
        target.write(raw)
        target.scales, target.offsets = (0.01,), (100.0,)
    after = read_elevation(tmp_path / "scaled.tif")
    np.testing.assert_allclose(after.values, raw[0] * 0.01 + 100, rtol=1e-6)
    mosaic = mosaic_elevation([read_raster_header(tmp_path / "scaled.tif")], after.grid, crs=CRS)
    np.testing.assert_allclose(mosaic.values, after.values, rtol=1e-6)


def test_a_ramp_resampled_by_half_a_cell_keeps_its_slope(tmp_path):
    """Heights that rise by 1 m per metre to the east: the value at a cell's centre is its x."""
    x = WEST + (np.arange(80) + 0.5) * 0.5
    ramp = np.broadcast_to(x - WEST, (80, 80)).astype(np.float32)
    write_elevation(rb.Elevation(ramp, rb.Grid(WEST, SOUTH + 40, 0.5, 80, 80)), tmp_path / "ramp.tif", crs=CRS)
    grid = rb.Grid(WEST + 5.25, SOUTH + 30.1, 0.5, 30, 40)
    moved = mosaic_elevation([read_raster_header(tmp_path / "ramp.tif")], grid, crs=CRS)
    np.testing.assert_allclose(moved.values, np.broadcast_to(5.5 + 0.5 * np.arange(40), (30, 40)), atol=0.01)


def test_of_overlapping_tiles_the_first_with_data_wins(tmp_path):
    for name, value, rows in (("a.tif", 10, slice(0, 60)), ("b.tif", 20, slice(20, 80))):
        values = np.zeros((1, 80, 80), np.uint8)
        values[:, rows] = value
        with write(tmp_path / name, values, nodata=0) as target:
            target.write(values)
    headers = [read_raster_header(tmp_path / name) for name in ("a.tif", "b.tif")]
    mosaic = mosaic_image(headers, headers[0].grid, crs=CRS)
    assert mosaic.valid is None
    assert (mosaic.values[0, :60] == 10).all()
    assert (mosaic.values[0, 60:] == 20).all()


def test_a_mosaic_larger_than_its_rows_at_a_time_has_no_seam(tmp_path):
    grid = rb.Grid(WEST, SOUTH + 600, 0.5, 1200, 10)
    values = (np.arange(1200) % 251).astype(np.uint8)[None, :, None] * np.ones((1, 1, 10), np.uint8)
    write_image(rb.Image(values, ("grey",), grid), tmp_path / "tall.tif", crs=CRS)
    mosaic = mosaic_image([read_raster_header(tmp_path / "tall.tif")], grid, crs=CRS)
    np.testing.assert_array_equal(mosaic.values, values)


def test_a_colour_table_and_oblong_cells_are_refused(tmp_path):
    values = np.ones((1, 80, 80), np.uint8)
    with write(tmp_path / "table.tif", values) as target:
        target.write(values)
        target.write_colormap(1, {1: (255, 0, 0, 255)})
    with pytest.raises(InputError, match=r"table\.tif has a colour table instead of bands: expand it"):
        read_raster_header(tmp_path / "table.tif")
    with write(tmp_path / "oblong.tif", values, transform=Affine(0.5, 0, WEST, 0, -0.25, SOUTH + 20)) as target:
        target.write(values)
    with pytest.raises(InputError, match=r"oblong\.tif: its cells are not square"):
        read_image(tmp_path / "oblong.tif")


def test_oblong_cells_can_be_resampled(tmp_path):
    values = np.repeat(np.arange(80, dtype=np.uint8)[None, :, None], 40, axis=2)
    with write(tmp_path / "oblong.tif", values, transform=Affine(1.0, 0, WEST, 0, -0.5, SOUTH + 40)) as target:
        target.write(values)
    header = read_raster_header(tmp_path / "oblong.tif")
    assert not header.square
    assert header.grid.extent == (WEST, SOUTH, WEST + 40, SOUTH + 40)
    square = mosaic_image([header], rb.Grid(WEST, SOUTH + 40, 0.5, 80, 80), crs=CRS)
    np.testing.assert_allclose(square.values[0].mean(axis=1), np.arange(80), atol=1)


def test_near_infrared_that_is_marked_as_alpha_can_be_named(tmp_path):
    values = np.random.default_rng(0).integers(0, 255, (4, 80, 80)).astype(np.uint8)
    values[3, :40] = 0  # dark water: transparent, were it alpha
    with write(tmp_path / "rgbi.tif", values) as target:
        target.write(values)
        target.colorinterp = [ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha]
    header = read_raster_header(tmp_path / "rgbi.tif")
    assert looks_like_values(header)
    names = ("red", "green", "blue", "nir")
    image = read_image(tmp_path / "rgbi.tif", bands=names)
    np.testing.assert_array_equal(image.values, values)
    assert (image.bands, image.valid) == (names, None)
    mosaic = mosaic_image([header], image.grid, crs=CRS, bands=names)
    np.testing.assert_array_equal(mosaic.values, values)
    assert mosaic.valid is None
    masked = read_image(tmp_path / "rgbi.tif", bands=("red", "green", "blue", "-"))
    assert masked.bands == ("red", "green", "blue")
    np.testing.assert_array_equal(masked.valid, values[3] > 0)


def test_a_mask_in_the_alpha_band_does_not_look_like_values(tmp_path):
    values = np.full((4, 80, 80), 255, np.uint8)
    values[3, :20] = 0
    with write(tmp_path / "rgba.tif", values) as target:
        target.write(values)
        target.colorinterp = [ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha]
    assert not looks_like_values(read_raster_header(tmp_path / "rgba.tif"))


@pytest.mark.parametrize(
    "transform",
    [
        (1, 0, WEST, 0, -1, np.nan),
        (1, 0, 1e300, 0, -1, SOUTH),
        (1, np.nan, WEST, 0, -1, SOUTH),
        (1, 0, 0, 0, -1e-30, 0),
    ],
)
def test_a_transform_that_is_that_of_no_image_is_refused(tmp_path, transform):
    with write(tmp_path / "dem.tif", np.zeros((1, 4, 4), np.float32), transform=Affine(*transform)):
        pass
    with pytest.raises(InputError, match="affine transform"):
        read_raster_header(tmp_path / "dem.tif")
