"""Surface models instead of points, and near infrared from a file of its own."""

import numpy as np
import pytest
import shapely
from click.testing import CliRunner
from typer.main import get_command

import roofbench as rb
from roofbench.cli.main import app
from roofbench.core.errors import CRSError, InputError, ParameterError
from roofbench.scenes.geodata.raster import Elevation, Grid, Image
from roofbench.scenes.geodata.raster_files import write_elevation, write_image

CRS = "EPSG:25832"
GRID = Grid(500_000.0, 5_400_100.0, 0.5, 160, 200)
HOUSE = shapely.box(500_040, 5_400_050, 500_054, 5_400_060)


def heights(*, roof=6.0):
    row, column = np.mgrid[: GRID.rows, : GRID.columns]
    x, y = GRID.to_world(row + 0.5, column + 0.5)
    ground = 200 + 0.03 * (x - 500_000)
    return np.where(shapely.contains_xy(HOUSE, x, y), ground + roof, ground).astype(np.float32)


@pytest.fixture
def surface(tmp_path):
    values = heights()
    values[:10, :10] = np.nan
    write_elevation(Elevation(values, GRID), tmp_path / "dsm.tif", crs=CRS)
    return tmp_path / "dsm.tif"


def rgb(seed=0, dtype=np.uint8):
    return np.random.default_rng(seed).integers(20, 200, (3, *GRID.shape)).astype(dtype)


@pytest.fixture
def ortho(tmp_path):
    write_image(Image(rgb(), ("red", "green", "blue"), GRID), tmp_path / "rgb.tif", crs=CRS)
    return tmp_path / "rgb.tif"


def infrared(folder, values, name="nir.tif"):
    write_image(Image(values[None], ("grey",), GRID), folder / name, crs=CRS)
    return folder / name


def notes_of(folder, **files):
    return " ".join(rb.import_scene(folder, rb.ImportRequest(**files)).facts["notes"])


@pytest.mark.parametrize("dtype", ["int16", "float32"])
def test_whole_numbers_as_heights_are_warned_of_unless_they_have_a_scale(tmp_path, dtype):
    import rasterio

    write_elevation(Elevation(heights(), GRID), tmp_path / "metres.tif", crs=CRS)
    for name, scale in (("plain", 1.0), ("scaled", 0.1)):
        with rasterio.open(tmp_path / "metres.tif") as source:
            profile = {**source.profile, "dtype": dtype, "nodata": None, "predictor": 1}
        with rasterio.open(tmp_path / f"{name}.tif", "w", **profile) as target:
            target.write(np.round(10 * heights()).astype(dtype), 1)
            target.scales = (scale,)
    assert "plain.tif has whole numbers as heights" in notes_of(tmp_path / "a", dsm=tmp_path / "plain.tif")
    assert "whole numbers" not in notes_of(tmp_path / "b", dsm=tmp_path / "scaled.tif")
    assert "whole numbers" not in notes_of(tmp_path / "c", dsm=tmp_path / "metres.tif")


@pytest.mark.parametrize(
    ("offset", "where"), [(2.0, "2.0 m below"), (1.0, "1.0 m below"), (-2.0, "2.0 m above"), (0.3, "")]
)
def test_a_dem_some_metres_beside_the_surface_is_warned_of(surface, tmp_path, offset, where):
    write_elevation(Elevation(heights(roof=0) + np.float32(offset), GRID), tmp_path / "dtm.tif", crs=CRS)
    found = notes_of(tmp_path / "scene", dsm=surface, dem=tmp_path / "dtm.tif")
    assert (f"warning: the lower points lie {where} dtm.tif" in found) if where else ("warning" not in found)


def test_wide_gaps_of_a_dem_take_the_ground_of_the_points_and_narrow_ones_are_interpolated(surface, tmp_path):
    ground = heights(roof=0)
    # A bank rises in the half without a DEM.
    bank = np.broadcast_to(np.clip((np.arange(200) - 130) / 15, 0, 4).astype(np.float32), GRID.shape)
    write_elevation(Elevation(heights() + bank, GRID), tmp_path / "bank.tif", crs=CRS)
    for name, gap in (("half", slice(100, None)), ("narrow", slice(100, 110))):
        values = ground + bank
        values[:, gap] = np.nan
        write_elevation(Elevation(values, GRID), tmp_path / f"{name}.tif", crs=CRS)
        scene = rb.import_scene(
            tmp_path / name, rb.ImportRequest(dsm=tmp_path / "bank.tif", dem=tmp_path / f"{name}.tif")
        )
        assert np.percentile(np.abs(scene.dem.values - ground - bank), 95) < 0.3
        how = "derived by a ground filter" if name == "half" else "interpolated"
        assert f"of its cells had no height and were {how}" in scene.facts["derived"]["dem"]


def test_each_cell_with_a_height_becomes_a_point(surface, tmp_path):
    scene = rb.import_scene(tmp_path / "scene", rb.ImportRequest(dsm=surface))
    assert len(scene.points) == GRID.rows * GRID.columns - 100
    assert scene.points.number_of_returns is None
    assert scene.crs == CRS
    assert scene.extent == GRID.extent
    row, column = (np.floor(value).astype(int) for value in GRID.to_pixel(scene.points.x, scene.points.y))
    np.testing.assert_allclose(scene.points.z, heights()[row, column], atol=0.01)
    assert "surface model" in scene.facts["derived"]["points"]


def test_the_ground_of_a_surface_model_is_filtered_or_given(surface, tmp_path):
    write_elevation(Elevation(heights(roof=0), GRID), tmp_path / "dtm.tif", crs=CRS)
    for name, dem in (("alone", ()), ("with", tmp_path / "dtm.tif")):
        scene = rb.import_scene(tmp_path / name, rb.ImportRequest(dsm=surface, dem=dem))
        middle = float(scene.dem.sample(500_047, 5_400_055))
        assert middle == pytest.approx(200 + 0.03 * 47, abs=0.3)
        found = rb.detect(scene, "ndsm")
        assert len(found) == 1
        assert shapely.intersection(found.polygons[0], HOUSE).area > 0.9 * shapely.union(found.polygons[0], HOUSE).area


def test_the_command_takes_a_surface_and_a_terrain_model(surface, tmp_path):
    write_elevation(Elevation(heights(roof=0), GRID), tmp_path / "dtm.tif", crs=CRS)
    words = ["scenes", "import", "--dsm", surface, "--dtm", tmp_path / "dtm.tif", "-o", tmp_path / "made"]
    result = CliRunner().invoke(get_command(app), list(map(str, words)))
    assert result.exit_code == 0, result.output
    assert rb.open_scene(tmp_path / "made").contents == ("points", "dem")


def test_a_surface_model_without_heights_of_land_is_refused(tmp_path):
    for value, words in ((np.nan, "no height"), (-99_999.0, "no plausible heights, but values such as -99999 m")):
        write_elevation(Elevation(np.full(GRID.shape, value, np.float32), GRID), tmp_path / "bad.tif", crs=CRS)
        with pytest.raises(InputError, match=words):
            rb.import_scene(tmp_path / "scene", rb.ImportRequest(dsm=tmp_path / "bad.tif"))
    assert not (tmp_path / "scene").exists()


def test_a_surface_model_of_several_bands_or_without_crs_is_refused(ortho, surface, tmp_path):
    with pytest.raises(InputError, match="3 bands"):
        rb.import_scene(tmp_path / "scene", rb.ImportRequest(dsm=ortho))
    write_elevation(Elevation(heights(), GRID), tmp_path / "nameless.tif")
    with pytest.raises(CRSError, match="has no coordinate reference system"):
        rb.import_scene(tmp_path / "scene", rb.ImportRequest(dsm=tmp_path / "nameless.tif"))


def test_points_and_a_surface_model_exclude_each_other():
    with pytest.raises(ParameterError, match="not both"):
        rb.ImportRequest(dsm="a.tif", points="a.laz")


def test_infrared_becomes_the_fourth_band(ortho, tmp_path):
    values = rgb(1)[0]
    request = rb.ImportRequest(ortho=ortho, nir=infrared(tmp_path, values))
    image = rb.import_scene(tmp_path / "scene", request).image
    assert image.bands == ("red", "green", "blue", "nir")
    np.testing.assert_array_equal(image.values, np.concatenate([rgb(), values[None]]))


def test_pixels_without_infrared_are_left_out(ortho, tmp_path):
    half = Grid(GRID.west, GRID.north, GRID.gsd, GRID.rows, GRID.columns // 2)
    write_image(Image(rgb(1)[:1, :, : half.columns], ("grey",), half), tmp_path / "half.tif", crs=CRS)
    scene = rb.import_scene(tmp_path / "scene", rb.ImportRequest(ortho=ortho, nir=tmp_path / "half.tif"))
    assert scene.image.valid[:, : half.columns].all()
    assert not scene.image.valid[:, half.columns :].any()
    assert any("50.0% of the orthoimage" in note for note in scene.facts["notes"])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: np.where(np.arange(GRID.columns) < 90, 255, 0) * np.ones(GRID.shape), "as a mask"),
        (lambda: rgb()[0], "equals the red band"),
    ],
)
def test_masks_and_copies_are_not_taken_for_infrared(ortho, tmp_path, make, words):
    request = rb.ImportRequest(ortho=ortho, nir=infrared(tmp_path, make().astype(np.uint8)))
    with pytest.raises(InputError, match=words):
        rb.import_scene(tmp_path / "scene", request)


def test_a_copy_of_the_colours_is_refused_as_infrared(ortho, tmp_path):
    write_image(Image(rgb(), ("red", "green", "blue"), GRID), tmp_path / "copy.tif", crs=CRS)
    with pytest.raises(InputError, match=r"3 bands \(red, green, blue\), expected near infrared"):
        rb.import_scene(tmp_path / "scene", rb.ImportRequest(ortho=ortho, nir=tmp_path / "copy.tif"))


def test_infrared_needs_an_image_with_red_and_without_infrared(tmp_path, ortho):
    with pytest.raises(ParameterError, match="give ortho="):
        rb.ImportRequest(nir="nir.tif", points="a.laz")
    grey = infrared(tmp_path, rgb(2)[0], "grey.tif")
    with pytest.raises(InputError, match="only grey"):
        rb.import_scene(tmp_path / "scene", rb.ImportRequest(ortho=grey, nir=infrared(tmp_path, rgb(1)[0])))
    four = Image(np.concatenate([rgb(), rgb(1)[:1]]), ("red", "green", "blue", "nir"), GRID)
    write_image(four, tmp_path / "four.tif", crs=CRS)
    with pytest.raises(InputError, match="band nir already"):
        rb.import_scene(tmp_path / "scene", rb.ImportRequest(ortho=tmp_path / "four.tif", nir=grey))
