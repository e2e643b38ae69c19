"""Tiled import: files stay as they are, and the folder is the scene that they show."""

import dataclasses

import numpy as np
import pytest
import rasterio
from builders.small_scenes import CRS, SOUTH, WEST, cloud, image, scene
from harness.command_line import run
from rasterio import Affine

from roofbench.core.errors import InputError, OutputError, ParameterError
from roofbench.scenes.folder import open_scene, read_manifest
from roofbench.scenes.geodata.las_files import write_points
from roofbench.scenes.geodata.raster_files import write_elevation, write_image
from roofbench.scenes.geodata.vector_files import write_footprints
from roofbench.scenes.importing.request import ImportRequest
from roofbench.scenes.importing.tile_index import index_folder
from roofbench.scenes.importing.tiled_import import import_tiles

HALVES = [(WEST, SOUTH, WEST + 20, SOUTH + 40), (WEST + 20, SOUTH, WEST + 40, SOUTH + 40)]


@pytest.fixture
def files(tmp_path):
    """Two point files and two images of a small scene, its DEM, reference and area."""
    folder, whole = tmp_path / "files", scene()
    folder.mkdir()
    for number, half in enumerate(HALVES):
        write_points(whole.window(half).points, folder / f"{number}.laz", crs=CRS)
        write_image(whole.window(half).image, folder / f"{number}.tif", crs=CRS)
    write_elevation(whole.dem, folder / "ground.tif", crs=CRS)
    write_footprints(whole.reference, folder / "register.gpkg")
    return folder


def request(files, **changes):
    values = {
        "points": sorted(files.glob("*.laz")),
        "ortho": sorted(files.glob("[01].tif")),
        "dem": files / "ground.tif",
        "reference": files / "register.gpkg",
    }
    return ImportRequest(**{**values, **changes})


def test_the_folder_is_the_scene_that_the_files_show(files, tmp_path):
    found, whole = import_tiles(tmp_path / "city", request(files, licence="CC0")), scene()
    assert found.problems == ()
    opened = found.scene
    assert opened.name == "city"
    assert opened.facts["licence"] == "CC0"
    assert set(opened.contents) >= {"points", "image", "dem", "reference"}
    assert len(opened.points) == len(whole.points)
    assert np.array_equal(opened.image.values, whole.image.values)
    assert len(opened.window((WEST + 5, SOUTH + 5, WEST + 15, SOUTH + 15)).reference) == 1
    assert (tmp_path / "city" / "points_0.laz").read_bytes() == (files / "0.laz").read_bytes()


def test_the_command_names_files_that_are_left_out_and_exits_with_3(files, tmp_path):
    write_points(cloud(), files / "9.laz", crs="EPSG:25833")
    words = ("scenes", "import", *sorted(files.glob("?.laz")), "--tiled", "-o", tmp_path / "city")
    code, out, error = run(*words)
    assert code == 3
    assert "points_9.laz is left out" in error
    assert "scene 'city' with points" in out
    assert run(*words)[0] == 2
    assert run(*words, "--overwrite")[0] == 3


def test_what_would_change_a_file_is_refused_and_nothing_is_left(files, tmp_path):
    with pytest.raises(ParameterError, match="leave out gsd="):
        import_tiles(tmp_path / "city", request(files, gsd=1.0))
    with pytest.raises(InputError, match="an orthoimage has uint8 or uint16"):
        import_tiles(tmp_path / "city", request(files, ortho=files / "ground.tif"))
    with pytest.raises(InputError, match="cells without sign"):
        import_tiles(tmp_path / "city", request(files, dem=files / "0.tif"))
    with pytest.raises(InputError, match="no such file"):
        import_tiles(tmp_path / "city", request(files, points=files / "missing.laz"))
    assert not (tmp_path / "city").exists()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"thesis\.txt"):
        import_tiles(tmp_path / "other", request(files), overwrite=True)


def test_rasters_that_a_virtual_raster_shows_are_read_through_it(files):
    names = "".join(
        f'<SimpleSource><SourceFilename relativeToVRT="1">{n}.tif</SourceFilename><SourceBand>{{0}}</SourceBand>'
        f'<SrcRect xOff="0" yOff="0" xSize="40" ySize="80"/><DstRect xOff="{40 * n}" yOff="0" xSize="40" ySize="80"/>'
        "</SimpleSource>"
        for n in range(2)
    )
    colours = ("Red", "Green", "Blue")
    bands = "".join(
        f'<VRTRasterBand dataType="Byte" band="{b}"><ColorInterp>{colour}</ColorInterp>{names.format(b)}'
        "</VRTRasterBand>"
        for b, colour in enumerate(colours, start=1)
    )
    (files / "ortho.vrt").write_text(
        f'<VRTDataset rasterXSize="80" rasterYSize="80"><SRS>{CRS}</SRS>'
        f"<GeoTransform>{WEST}, 0.5, 0, {SOUTH + 40}, 0, -0.5</GeoTransform>{bands}</VRTDataset>"
    )
    found = index_folder(files).scene
    images = [file.file for file in found._sources["image"].files]
    assert images == ["ortho.vrt"]
    assert np.array_equal(found.image.values, scene().image.values)
    before = found.content_hash
    (files / "0.tif").write_bytes((files / "1.tif").read_bytes())
    with pytest.raises(InputError, match="changed since the scene was indexed"):
        _ = open_scene(files).image
    assert index_folder(files).scene.content_hash != before


def spectrum():
    """Return an image of red, green, blue and near infrared with grey and green squares."""
    plain = image(bands=("red", "green", "blue", "nir"))
    light = plain.values[0] / 2 + 40
    green = np.indices(light.shape).sum(axis=0) // 10 % 2 == 0
    lawn = np.stack([0.5 * light, 0.8 * light, 0.4 * light, 1.2 * light])
    grey = np.stack([light, light, light, 0.9 * light])
    noise = np.random.default_rng(1).uniform(0.97, 1.03, lawn.shape)
    return dataclasses.replace(plain, values=(np.where(green, lawn, grey) * noise).round().astype(np.uint8))


def written(folder, half, name, bands, dtype, factor):
    """Write bands of the half of an image, its values multiplied."""
    part = spectrum().window(half)
    values = np.stack([part.values[part.bands.index(band)] for band in bands])
    values = (values * np.float64(factor)).astype(dtype)
    path = folder / name
    profile = {"count": len(bands), "dtype": dtype, "height": part.grid.rows, "width": part.grid.columns, "crs": CRS}
    transform = Affine(*part.grid.transform)
    # A linked file must not be written into.
    path.unlink(missing_ok=True)
    with rasterio.open(path, "w", driver="GTiff", transform=transform, **profile) as target:
        target.write(values)
    return path


@pytest.mark.parametrize(
    ("bands", "name", "dtype", "factor"),
    [
        (("nir",), "ir{}.tif", "uint8", 1),
        (("nir",), "ir{}.tif", "uint16", 257),
        (("nir",), "nir{}.tif", "float32", 1 / 255),
        (("nir", "red", "green"), "cir{}.tif", "uint16", 257),
        (("nir", "red", "green"), "tile{}.tif", "uint16", 5),
    ],
)
@pytest.mark.parametrize("option", [False, True])
def test_tiles_of_near_infrared_become_a_band_of_those_in_colour(tmp_path, option, bands, name, dtype, factor):
    colours = [
        written(tmp_path, half, f"rgb{number}.tif", ("red", "green", "blue"), "uint8", 1)
        for number, half in enumerate(HALVES)
    ]
    infrared = [
        written(tmp_path, half, name.format(number), bands, dtype, factor) for number, half in enumerate(HALVES)
    ]
    given = {"ortho": colours, "nir": infrared} if option else {"ortho": colours + infrared}
    found = import_tiles(tmp_path / "city", ImportRequest(**given))
    assert found.problems == ()
    assert "taken for the white of near infrared" in found.notes[-1]
    expected, read = spectrum(), found.scene.image
    assert read.bands == expected.bands
    assert abs(read.values.astype(int) - expected.values).max() <= (3 if "tile" in name else 1)
    part = (WEST + 15, SOUTH + 10, WEST + 25, SOUTH + 20)
    window = found.scene.window(part).image
    assert (window.values == read.window(part).values).all()
    before = found.scene.window(part).content_hash
    written(tmp_path / "city", HALVES[0], f"nir_{infrared[0].name}", bands, dtype, factor / 2)
    with pytest.raises(InputError, match="changed since the scene was indexed"):
        _ = open_scene(tmp_path / "city").image
    again = index_folder(tmp_path / "city").scene
    assert again.window(part).content_hash != before


def test_near_infrared_alone_stays_an_image_and_an_elevation_model_is_none(tmp_path):
    files = [written(tmp_path, half, f"ir{number}.tif", ("nir",), "uint8", 1) for number, half in enumerate(HALVES)]
    found = import_tiles(tmp_path / "city", ImportRequest(ortho=files))
    assert found.scene.image.bands == ("grey",)
    written(tmp_path / "city", HALVES[0], "ground_ir.tif", ("nir",), "float32", 1)
    written(tmp_path / "city", HALVES[0], "rgb.tif", ("red", "green", "blue"), "uint8", 1)
    index_folder(tmp_path / "city")
    layers = {entry["file"]: entry["layer"] for entry in read_manifest(tmp_path / "city")[1]["tiles"]}
    infrared = dict.fromkeys(("ortho_ir0.tif", "ortho_ir1.tif"), "infrared")
    assert layers == {"ground_ir.tif": "dem", "rgb.tif": "image", **infrared}
