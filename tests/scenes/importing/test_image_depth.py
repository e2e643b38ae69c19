"""Colours of fewer bits than their files have: scaled to 16 bit, with one depth for tiles of a set, and a note."""

import laspy
import numpy as np
import pytest
import rasterio
from builders.small_scenes import CRS, SOUTH, WEST, cloud
from rasterio import Affine

import roofbench as rb
from roofbench.scenes.geodata.colour_depth import scaled_to_16_bit
from roofbench.scenes.geodata.las_files import write_points
from roofbench.scenes.importing.tile_index import index_folder


def image(path, values, *, west=WEST, **more):
    """Write bands of random values from a tenth to all of the largest."""
    size, rng = 40, np.random.default_rng(1)
    top = np.array(values)[:, None, None]
    cells = (top * rng.uniform(0.1, 1, (len(values), size, size))).round().astype(np.uint16)
    cells[:, 5, 5] = top[:, 0, 0]
    profile = {"count": len(values), "dtype": "uint16", "width": size, "height": size, "crs": CRS, "driver": "GTiff"}
    with rasterio.open(path, "w", transform=Affine(1, 0, west, 0, -1, SOUTH + 40), **profile, **more) as target:
        target.write(cells)
    return cells


def imported(folder, *ortho, **more):
    write_points(cloud(), folder / "points.laz", crs=CRS)
    request = rb.ImportRequest(points=folder / "points.laz", ortho=ortho, bands=("red", "green", "blue"), **more)
    return rb.import_scene(folder / "scene", request)


def notes_on_depth(scene):
    return [note for note in scene.facts.get("notes", ()) if "scaled to 16 bit" in note]


@pytest.mark.parametrize("bits", [8, 10, 11, 12, 14])
def test_an_image_of_fewer_bits_is_scaled_and_noted(tmp_path, bits):
    top = (1 << bits) - 1
    cells = image(tmp_path / "a.tif", (top, top // 2, top))
    scene = imported(tmp_path, tmp_path / "a.tif")
    np.testing.assert_allclose(scene.image.values / 65535, cells / top, atol=1e-5)
    (note,) = notes_on_depth(scene)
    assert note.startswith(
        f"a.tif: the values reach at most {top} of 65535, so they were taken for values of {bits} bit"
    )


def test_an_image_of_16_bit_stays_as_it_is(tmp_path):
    cells = image(tmp_path / "a.tif", (40000, 20000, 9000))
    scene = imported(tmp_path, tmp_path / "a.tif")
    assert np.array_equal(scene.image.values, cells)
    assert notes_on_depth(scene) == []


def test_the_number_of_bits_that_a_file_names_counts(tmp_path):
    cells = image(tmp_path / "a.tif", (900, 900, 900), nbits=12)
    scene = imported(tmp_path, tmp_path / "a.tif")
    np.testing.assert_allclose(scene.image.values / 65535, cells / 4095, atol=1e-5)


def test_a_dark_tile_and_infrared_have_the_depth_of_the_others(tmp_path):
    bright = image(tmp_path / "a.tif", (4000, 3000, 3000), west=WEST - 20)
    dark = image(tmp_path / "b.tif", (700, 200, 200), west=WEST + 20)
    infrared = image(tmp_path / "n.tif", (1500,))
    scene = imported(tmp_path, tmp_path / "a.tif", tmp_path / "b.tif", nir=tmp_path / "n.tif")
    values = scene.image.values / 65535
    np.testing.assert_allclose(values[:3, :, :20], bright[:, :, 20:] / 4095, atol=1e-5)
    np.testing.assert_allclose(values[:3, :, 20:], dark[:, :, :20] / 4095, atol=1e-5)
    np.testing.assert_allclose(values[3], infrared[0] / 4095, atol=1e-5)


@pytest.mark.parametrize("bits", [10, 12])
def test_points_of_fewer_bits_are_scaled_and_noted(tmp_path, bits):
    write_points(cloud(colour=True), tmp_path / "own.laz", crs=CRS)
    data = laspy.read(tmp_path / "own.laz")
    data.header.generating_software = "another"
    top, rng = (1 << bits) - 1, np.random.default_rng(0)
    for name in ("red", "green", "blue"):
        data[name] = rng.integers(top // 8, top, len(data)).astype(np.uint16)
    data["red"][0] = top
    data.write(tmp_path / "points.las")
    scene = rb.import_scene(
        tmp_path / "scene", rb.ImportRequest(points=tmp_path / "points.las", ortho_from_points=True)
    )
    (note,) = notes_on_depth(scene)
    assert note.startswith(f"points.las: the values reach at most {top} of 65535")
    assert np.median(scene.image.values) == pytest.approx(255 * 9 / 16, rel=0.1)


def test_tiles_are_scaled_alike_in_every_window(tmp_path):
    west = image(tmp_path / "a.tif", (4000, 3000, 3000))
    image(tmp_path / "b.tif", (700, 200, 200), west=WEST + 40)
    write_points(cloud(size=80.0), tmp_path / "points.laz", crs=CRS)
    found = index_folder(tmp_path)
    (note,) = found.notes
    assert note.startswith("2 images: the values reach at most 4095 of 65535, so they were taken for values of 12 bit")
    scene = found.scene
    assert np.array_equal(scene.image.values[:, -40:, :40], scaled_to_16_bit(west, 12))
    part = scene.window((WEST + 42, SOUTH, WEST + 60, SOUTH + 20)).image
    assert part.values.max() < 65535 * 0.2
