"""Infrared of another type, depth, cell size or number of bands beside an orthoimage: one scale, or one sentence."""

import numpy as np
import pytest
import rasterio
from rasterio import Affine

import roofbench as rb
from roofbench.core.errors import InputError
from roofbench.scenes.geodata.raster import Grid

CRS = "EPSG:25832"
GRID = Grid(500_000.0, 5_400_100.0, 0.5, 120, 160)


def picture():
    """Return red, green, blue and near infrared, 0..1: grey roofs on lawn, with texture."""
    rng = np.random.default_rng(0)
    light = 0.3 + 0.5 * rng.random((GRID.rows // 8, GRID.columns // 8)).repeat(8, 0).repeat(8, 1)
    light *= rng.uniform(0.9, 1.1, GRID.shape)
    roof = np.indices(GRID.shape).sum(axis=0) // 40 % 2 == 0
    lawn = np.stack([0.5 * light, 0.7 * light, 0.4 * light, 1.1 * light])
    grey = np.stack([light, light, 0.97 * light, 0.9 * light])
    noise = rng.uniform(0.98, 1.02, (4, *GRID.shape))
    return np.clip(np.where(roof, grey, lawn) * noise, 0, 1)


RED, GREEN, BLUE, NIR = PICTURE = picture()


def write(path, shares, dtype="uint8", *, white=255, grid=GRID, crs=CRS, names=(), photometric=None, **profile):
    values = np.asarray(shares) * white
    values = values.astype(dtype) if np.dtype(dtype).kind == "f" else np.rint(values).astype(dtype)
    size = {"height": grid.rows, "width": grid.columns, "count": len(values), "dtype": dtype}
    colours = {"photometric": photometric} if photometric else {}
    with rasterio.open(
        path, "w", driver="GTiff", crs=crs, transform=Affine(*grid.transform), **size, **profile, **colours
    ) as target:
        target.write(values)
        for band, name in enumerate(names, start=1):
            target.set_band_description(band, name)
    return path


@pytest.fixture
def ortho(tmp_path):
    return write(tmp_path / "rgb.tif", PICTURE[:3], photometric="RGB")


def imported(folder, *ortho, **more):
    folder.mkdir(exist_ok=True)
    return rb.import_scene(folder / "scene", rb.ImportRequest(ortho=ortho, **more))


def shares_of(scene):
    assert scene.image.bands == ("red", "green", "blue", "nir")
    return scene.image.values / np.iinfo(scene.image.values.dtype).max


@pytest.mark.parametrize(
    ("dtype", "white", "least"),
    [
        ("uint8", 255, 0),
        ("uint16", 65535, 0),
        ("uint16", 4095, 0),
        ("float32", 1.0, 0),
        ("float32", 100.0, 0),
        ("int16", 10_000, 0),
        ("uint16", 900, 0.02),
    ],
)
def test_infrared_of_any_type_gets_the_scale_of_the_colours(ortho, tmp_path, dtype, white, least):
    file = write(tmp_path / "ir.tif", NIR[None], dtype, white=white)
    by_name, by_option = imported(tmp_path, ortho, file), imported(tmp_path / "b", ortho, nir=file)
    for scene in (by_name, by_option):
        # Of 900 the depth is 10 bit, 1023.
        np.testing.assert_allclose(shares_of(scene)[3], NIR, atol=0.005 + 8 * least)
        np.testing.assert_allclose(shares_of(scene)[:3], PICTURE[:3], atol=0.003)
    said = " ".join(by_name.facts["notes"])
    assert "ir.tif: taken for near infrared of the orthoimage" in said
    assert ("values were converted to uint8" in said) == (dtype != "uint8")


def test_an_orthoimage_of_16_bit_takes_infrared_of_8(tmp_path):
    deep = write(tmp_path / "deep.tif", PICTURE[:3], "uint16", white=65535, photometric="RGB")
    scene = imported(tmp_path, deep, write(tmp_path / "ir.tif", NIR[None]))
    assert scene.image.values.dtype == np.uint16
    np.testing.assert_allclose(shares_of(scene), PICTURE, atol=0.003)


@pytest.mark.parametrize("gain", [0.01, 0.2, 3.0])
def test_a_scale_on_which_grey_surfaces_are_not_grey_is_corrected_and_noted(ortho, tmp_path, gain):
    # Up to 3, the values are taken for percent.
    scene = imported(tmp_path, ortho, write(tmp_path / "ir.tif", gain * NIR[None], "float32", white=1))
    red, nir = shares_of(scene)[[0, 3]]
    assert abs(np.median((nir - red) / (nir + red) - (NIR - RED) / (NIR + RED))) < 0.08
    assert any("near infrared was multiplied by" in note for note in scene.facts["notes"])


@pytest.mark.parametrize(("dtype", "white"), [("uint8", 255), ("uint16", 65535), ("uint16", 1600), ("float32", 1.0)])
@pytest.mark.parametrize("name", ["cir.tif", "another.tif"])
def test_colour_infrared_gives_its_infrared_on_the_scale_of_its_red(ortho, tmp_path, name, dtype, white):
    cir = write(tmp_path / name, np.stack([NIR, RED, GREEN]), dtype, white=white, photometric="RGB")
    scene = imported(tmp_path, ortho, cir)
    np.testing.assert_allclose(shares_of(scene)[3], NIR, atol=0.01)
    said = " ".join(scene.facts["notes"])
    assert "taken for nir, red, green, its second and third band are red and green of the orthoimage" in said
    first = imported(tmp_path / "b", cir, ortho)
    np.testing.assert_array_equal(first.image.values, scene.image.values)


def test_descriptions_say_which_band_is_infrared(ortho, tmp_path):
    file = write(
        tmp_path / "x.tif", np.stack([GREEN, NIR, RED]), "uint16", white=65535, names=("green", "near infrared", "red")
    )
    np.testing.assert_allclose(shares_of(imported(tmp_path, ortho, file))[3], NIR, atol=0.005)
    alone = write(tmp_path / "y.tif", NIR[None], "uint16", white=65535, names=("B8 - NIR",))
    np.testing.assert_allclose(shares_of(imported(tmp_path / "b", ortho, alone))[3], NIR, atol=0.005)


def test_infrared_of_other_cells_and_crs_is_resampled(ortho, tmp_path):
    coarse = Grid(GRID.west, GRID.north, 1.0, 60, 80)
    mean = np.stack([NIR, RED, GREEN]).reshape(3, 60, 2, 80, 2).mean(axis=(2, 4))
    shifted = Grid(GRID.west + 0.2, GRID.north - 0.1, 0.5, 120, 160)
    for folder, file in (
        ("a", write(tmp_path / "coarse.tif", mean, grid=coarse, photometric="RGB")),
        ("b", write(tmp_path / "shifted.tif", np.stack([NIR, RED, GREEN]), grid=shifted, photometric="RGB")),
    ):
        scene = imported(tmp_path / folder, ortho, file)
        # The extent of both may be a cell longer.
        assert np.median(abs(shares_of(scene)[3][:120, :160] - NIR)) < 0.03
        assert any(f"{file.name} was resampled" in note for note in scene.facts["notes"])


def test_borders_without_infrared_are_left_out(ortho, tmp_path):
    values = NIR.copy()
    values[:10] = 0
    file = write(tmp_path / "nir.tif", values[None], "uint16", white=65535, nodata=0)
    scene = imported(tmp_path, ortho, file)
    assert not scene.image.valid[:10].any()
    assert scene.image.valid[10:].mean() > 0.999


@pytest.mark.parametrize(
    ("name", "shares", "words"),
    [
        ("nir.tif", (RED > 0.5)[None], "as a mask does"),
        ("ir.tif", RED[None], "equals the red band"),
        ("nir16.tif", (0.3 * RED + 0.6 * GREEN + 0.1 * BLUE)[None], "as grey values are"),
        ("grey.tif", NIR[None], "nir="),
        ("copy.tif", PICTURE[:3] * 0.5, "with other values"),
    ],
)
def test_what_is_no_infrared_is_refused(ortho, tmp_path, name, shares, words):
    file = write(tmp_path / name, shares)
    with pytest.raises(InputError, match=words):
        imported(tmp_path, ortho, file)


def test_three_bands_that_nothing_says_to_be_infrared_are_refused_as_such(ortho, tmp_path):
    file = write(tmp_path / "three.tif", np.stack([RED, NIR, BLUE]))
    with pytest.raises(InputError, match="expected near infrared alone or with its bands named"):
        imported(tmp_path, ortho, nir=file)


@pytest.mark.parametrize("profile", [{}, {"compress": "jpeg", "photometric": "YCBCR"}])
def test_three_equal_bands_are_one_grey_band(tmp_path, profile):
    file = write(tmp_path / "scan.tif", np.stack([GREEN] * 3), **profile)
    scene = imported(tmp_path, file)
    assert scene.image.bands == ("grey",)
    assert any("so that the image is grey" in note for note in scene.facts["notes"])
    assert imported(tmp_path / "b", write(tmp_path / "c.tif", PICTURE[:3])).image.bands == ("red", "green", "blue")
