"""Where rasters have data, whatever their number of bands and types: masks, alpha, corners of turned images."""

import numpy as np
import pytest
import rasterio
from rasterio import Affine
from rasterio.control import GroundControlPoint
from rasterio.enums import ColorInterp
from rasterio.warp import transform as transform_points

from roofbench.core.errors import CRSError, InputError
from roofbench.scenes.geodata.image_bands import assumed_bands, band_names, require_infrared
from roofbench.scenes.geodata.raster import Grid
from roofbench.scenes.geodata.raster_files import read_image
from roofbench.scenes.geodata.raster_headers import read_raster_header
from roofbench.scenes.geodata.raster_mosaic import mosaic_elevation, mosaic_image

WEST, NORTH = 500000.0, 5500040.0
GRID = Grid(WEST, NORTH, 0.5, 80, 80)
LEVELS = (200, 100, 50, 220)


def raster(path, *, levels=LEVELS, dtype="uint8", crs="EPSG:25832", corner=(WEST, NORTH), size=80, **more):
    """Write bands of one value each; `mask` is True where there is data, `colours` their interpretation."""
    mask, colours = more.get("mask"), more.get("colours")
    profile = {"count": len(levels), "dtype": dtype, "width": size, "height": size, "crs": crs, "driver": "GTiff"}
    transform = Affine(0.5, 0, corner[0], 0, -0.5, corner[1])
    with (
        rasterio.Env(GDAL_TIFF_INTERNAL_MASK=more.get("inside", True)),
        rasterio.open(path, "w", transform=transform, photometric="MINISBLACK", **profile) as target,
    ):
        if colours:
            target.colorinterp = [ColorInterp[colour] for colour in colours]
        values = np.stack([np.full((size, size), level, dtype=dtype) for level in levels])
        if mask is not None and not more.get("alpha"):
            values *= mask.astype(dtype)
        if more.get("alpha"):
            values[-1] = np.where(mask, 255, 0)
            values[:-1] *= mask.astype(dtype)
        target.write(values)
        if mask is not None and not more.get("alpha"):
            target.write_mask(mask)
    return read_raster_header(path)


def upper_quarter_empty():
    mask = np.ones((80, 80), dtype=bool)
    mask[:20] = False
    return mask


@pytest.mark.parametrize("inside", [True, False], ids=["mask in the file", "mask beside it"])
@pytest.mark.parametrize("levels", [LEVELS[:1], LEVELS[:3], LEVELS])
def test_a_mask_is_honoured_with_any_number_of_bands(tmp_path, levels, inside):
    header = raster(tmp_path / "a.tif", levels=levels, mask=upper_quarter_empty(), inside=inside)
    for image in (read_image(header.path), mosaic_image([header], GRID, crs="EPSG:25832")):
        assert (image.valid == upper_quarter_empty()).all()
        assert [float(band[image.valid].mean()) for band in image.values] == list(levels)


def test_alpha_beside_near_infrared_is_a_mask(tmp_path):
    header = raster(
        tmp_path / "a.tif",
        levels=(*LEVELS, 0),
        colours=("red", "green", "blue", "undefined", "alpha"),
        alpha=True,
        mask=upper_quarter_empty(),
    )
    assert header.band_count == 4
    for image in (read_image(header.path), mosaic_image([header], GRID, crs="EPSG:25832")):
        assert image.bands == ("red", "green", "blue", "nir")
        assert (image.valid == upper_quarter_empty()).all()


@pytest.mark.parametrize("levels", [LEVELS[:3], LEVELS])
def test_corners_that_a_turned_image_leaves_have_no_data_and_are_filled_by_the_next_file(tmp_path, levels):
    # The neighbouring zone is turned by some degrees against this one.
    x, y = transform_points("EPSG:25832", "EPSG:25833", [WEST + 20], [NORTH - 20])
    corner = (x[0] - 20, y[0] + 20)
    turned = raster(tmp_path / "33.tif", levels=levels, crs="EPSG:25833", corner=corner)
    alone = mosaic_image([turned], GRID, crs="EPSG:25832")
    assert alone.valid is not None
    assert 0.9 < alone.valid.mean() < 0.99
    means = [float(band[alone.valid].mean()) for band in alone.values]
    assert means == pytest.approx(levels, abs=1)
    below = raster(tmp_path / "32.tif", levels=(90,) * len(levels))
    both = mosaic_image([turned, below], GRID, crs="EPSG:25832")
    assert both.valid is None
    assert (both.values[:, ~alone.valid] == 90).all()


@pytest.mark.parametrize("dtype", ["float32", "float64", "int16"])
def test_corners_that_a_turned_dem_leaves_are_unknown(tmp_path, dtype):
    x, y = transform_points("EPSG:25832", "EPSG:25833", [WEST + 20], [NORTH - 20])
    header = raster(tmp_path / "d.tif", levels=(10,), dtype=dtype, crs="EPSG:25833", corner=(x[0] - 20, y[0] + 20))
    values = mosaic_elevation([header], GRID, crs="EPSG:25832").values
    assert 0.01 < np.isnan(values).mean() < 0.1
    assert np.nanmin(values) == np.nanmax(values) == 10


@pytest.mark.parametrize(
    ("colours", "names", "note"),
    [
        (("blue", "green", "red"), ("blue", "green", "red"), None),
        (("blue", "green", "red", "undefined"), ("blue", "green", "red", "nir"), "name band 4: it was taken for near"),
        (("gray", "undefined", "undefined"), ("red", "green", "blue"), "taken for red, green, blue"),
        (("gray", "undefined", "undefined", "undefined"), ("red", "green", "blue", "nir"), "taken for red, green"),
    ],
)
def test_bands_are_named_by_the_colours_of_the_file_and_what_is_assumed_is_noted(tmp_path, colours, names, note):
    header = raster(tmp_path / "a.tif", levels=LEVELS[: len(colours)], colours=colours)
    assert band_names(header, None) == names
    assert (note is None and assumed_bands(header, None) is None) or note in assumed_bands(header, None)
    assert assumed_bands(header, names) is None


def as_mask(path, values):
    """Replace the fourth band of a raster."""
    with rasterio.open(path, "r+") as target:
        target.write(values.astype(target.dtypes[3]), 4)
    return read_raster_header(path)


@pytest.mark.parametrize(("dtype", "high"), [("uint8", 255), ("uint8", 1), ("uint16", 65535)])
def test_a_fourth_band_of_two_values_is_a_mask_and_no_infrared(tmp_path, dtype, high):
    raster(tmp_path / "a.tif", dtype=dtype)
    header = as_mask(tmp_path / "a.tif", np.where(upper_quarter_empty(), high, 0))
    assert (header.band_count, header.mask_band) == (3, True)
    for image in (read_image(header.path), mosaic_image([header], GRID, crs="EPSG:25832")):
        assert image.bands == ("red", "green", "blue")
        assert (image.valid == upper_quarter_empty()).all()
    named = ("red", "green", "blue", "nir")
    assert read_image(header.path, bands=named).bands == named


def test_a_fourth_band_of_many_values_is_infrared(tmp_path):
    raster(tmp_path / "a.tif")
    header = as_mask(tmp_path / "a.tif", np.arange(6400).reshape(80, 80) % 200)
    assert band_names(header, None) == ("red", "green", "blue", "nir")


def test_two_images_of_one_place_are_refused_when_they_differ(tmp_path):
    rgb = raster(tmp_path / "rgb.tif", levels=(90, 110, 70))
    cir = raster(tmp_path / "cir.tif", levels=(200, 90, 110))
    with pytest.raises(InputError, match=r"cir\.tif shows the same place .* if one is near infrared"):
        mosaic_image([rgb, cir], GRID, crs="EPSG:25832")


def test_an_image_that_others_cover_with_equal_values_is_reported(tmp_path):
    one = raster(tmp_path / "one.tif", levels=(90, 110, 70))
    two = raster(tmp_path / "two.tif", levels=(91, 110, 70))
    notes = []
    assert mosaic_image([one, two], GRID, crs="EPSG:25832", note=notes.append).values[0, 0, 0] == 90
    assert notes == ["two.tif is not used: other images have data in all of its cells"]


def test_neighbours_that_share_a_margin_are_not_reported(tmp_path):
    one = raster(tmp_path / "one.tif", levels=(90, 110, 70))
    two = raster(tmp_path / "two.tif", levels=(200, 90, 110), corner=(WEST + 30, NORTH))
    notes = []
    mosaic_image([one, two], Grid(WEST, NORTH, 0.5, 80, 140), crs="EPSG:25832", note=notes.append)
    assert notes == []


@pytest.mark.parametrize("name", ["a!b.tif", "a\nb.tif", "a;b.tif", "a\udcff.tif"])
def test_rasters_may_have_any_name(tmp_path, name):
    raster(tmp_path / "a.tif")
    (tmp_path / "a.tif").rename(tmp_path / name)
    assert read_image(tmp_path / name).values.shape == (4, 80, 80)


def test_alpha_is_no_colour_wherever_it_stands(tmp_path):
    values = np.full((5, 80, 80), 255, dtype=np.uint8)
    values[[1, 2, 3, 4]] = np.array([200, 100, 50, 220], dtype=np.uint8)[:, None, None]
    values[:, :20] = 0
    for place in range(5):
        order = np.insert(np.arange(1, 5), place, 0)
        file = tmp_path / f"{place}.tif"
        colours = [ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.undefined]
        with rasterio.open(raster(file, levels=(1,) * 5).path, "r+") as target:
            target.colorinterp = list(np.insert(np.array(colours, dtype=object), place, ColorInterp.alpha))
            target.write(values[order])
        image = read_image(file)
        assert image.bands == ("red", "green", "blue", "nir")
        assert image.valid is not None
        assert image.valid.mean() == 0.75
        assert image.values[:, image.valid].mean(axis=1).tolist() == [200, 100, 50, 220]


def test_bands_with_no_data_values_of_their_own_share_a_mask(tmp_path):
    raster(tmp_path / "a.tif", levels=(200, 100, 50), size=80)
    bands = "".join(
        f'<VRTRasterBand dataType="Byte" band="{band}"><NoDataValue>{empty}</NoDataValue><SimpleSource>'
        f'<SourceFilename relativeToVRT="1">a.tif</SourceFilename><SourceBand>{band}</SourceBand>'
        '<SrcRect xOff="0" yOff="20" xSize="80" ySize="60"/><DstRect xOff="0" yOff="20" xSize="80" ySize="60"/>'
        "</SimpleSource></VRTRasterBand>"
        for band, empty in ((1, 0), (2, 1), (3, 2))
    )
    with rasterio.open(tmp_path / "a.tif") as source:
        place = ", ".join(map(str, source.transform.to_gdal()))
    file = tmp_path / "a.vrt"
    file.write_text(
        '<VRTDataset rasterXSize="80" rasterYSize="80"><SRS>EPSG:25832</SRS>'
        f"<GeoTransform>{place}</GeoTransform>{bands}</VRTDataset>"
    )
    header = read_raster_header(file)
    for image in (read_image(file), mosaic_image([header], header.grid, crs="EPSG:25832")):
        assert image.valid is not None
        assert image.valid.mean() == 0.75
        assert image.values[:, image.valid].mean(axis=1).tolist() == [200, 100, 50]


@pytest.mark.parametrize(
    ("texts", "names"),
    [
        (("Near Infrared", "Red", "Green"), ("nir", "red", "green")),
        (("B8 - NIR", "B4 - Red", "B3 - Green"), ("nir", "red", "green")),
        (("Blau", "Grün", "Rot"), ("blue", "green", "red")),
        (("B", "G", "R"), ("blue", "green", "red")),
    ],
)
def test_descriptions_name_the_bands_in_other_words(tmp_path, texts, names):
    with rasterio.open(raster(tmp_path / "a.tif", levels=(200, 100, 50)).path, "r+") as target:
        target.descriptions = texts
    header = read_raster_header(tmp_path / "a.tif")
    assert band_names(header, None) == names
    assert assumed_bands(header, None) is None


@pytest.mark.parametrize(
    "texts", [("red", "green", "blue", "b4"), ("a_1", "a_2", "a_3", "a_4"), ("", "", "", "Band 4")]
)
def test_descriptions_that_say_nothing_of_the_fourth_band_leave_it_infrared(tmp_path, texts):
    with rasterio.open(raster(tmp_path / "a.tif", levels=(200, 100, 50, 30)).path, "r+") as target:
        target.descriptions = texts
    header = read_raster_header(tmp_path / "a.tif")
    assert band_names(header, None) == ("red", "green", "blue", "nir")
    assert "nir" in assumed_bands(header, None)


@pytest.mark.parametrize("text", ["red edge", "valid", "Deckung", "nDSM", "thermal"])
def test_a_fourth_band_that_is_described_as_something_else_is_not_taken_for_infrared(tmp_path, text):
    with rasterio.open(raster(tmp_path / "a.tif", levels=(200, 100, 50, 30)).path, "r+") as target:
        target.descriptions = ("red", "green", "blue", text)
    header = read_raster_header(tmp_path / "a.tif")
    with pytest.raises(InputError, match=f"band 4 is '{text.lower()}', which is not near infrared"):
        band_names(header, None)
    named = ("red", "green", "blue", "-")
    assert read_image(header.path, bands=named).bands == named[:3]


def test_values_of_masks_counts_and_other_bands_are_not_taken_for_infrared(tmp_path):
    rng = np.random.default_rng(0)
    colours = rng.integers(20, 200, (3, 80, 80), dtype=np.uint8)
    soft = np.full((80, 80), 255, dtype=np.uint8)
    soft[:30] = np.linspace(0, 255, 30).astype(np.uint8)[:, None]
    odd = {
        "6 values only": rng.integers(1, 7, (80, 80)),
        "1 value only": np.zeros((80, 80)),
        "is 0 or 255 in 6": soft,
        "equals the green band": colours[1],
        "is a sum of red, green, blue": colours.mean(axis=0),
    }
    for reason, band in odd.items():
        header = raster(tmp_path / "a.tif", colours=("gray", "undefined", "undefined", "undefined"))
        with rasterio.open(header.path, "r+") as target:
            target.write(np.concatenate([colours, band[None].astype(np.uint8)]))
        with pytest.raises(InputError, match=f"band 4, which .*{reason}.*such as red,green,blue,-"):
            require_infrared(read_raster_header(header.path), None)
        named = ("red", "green", "blue", "nir")
        if reason == "1 value only":
            with pytest.raises(InputError, match="named near infrared holds 1 value only"):
                require_infrared(read_raster_header(header.path), named)
        else:
            require_infrared(read_raster_header(header.path), named)
    with rasterio.open(header.path, "r+") as target:
        target.write(rng.integers(0, 255, (80, 80), dtype=np.uint8), 4)
    require_infrared(read_raster_header(header.path), None)


@pytest.mark.parametrize(
    ("texts", "colours"),
    [
        (("red edge", "red", "green"), None),
        (("SWIR", "NIR", "Red", "Green"), None),
        (("Red", "Red", "Green", "Blue"), None),
        (None, ("red", "red", "green")),
    ],
)
def test_bands_are_not_assumed_against_what_some_of_them_are_named(tmp_path, texts, colours):
    levels = (200, 100, 50, 30)[: len(texts or colours)]
    with rasterio.open(raster(tmp_path / "a.tif", levels=levels, colours=colours).path, "r+") as target:
        if texts:
            target.descriptions = texts
    with pytest.raises(InputError, match=r"says that its band \d is (red|nir|green), and does not name all others"):
        band_names(read_raster_header(tmp_path / "a.tif"), None)


@pytest.mark.parametrize("text", ["Alpha", "mask", "Transparency (0-255)"])
def test_a_band_that_is_described_as_mask_is_one(tmp_path, text):
    names = ("red", "green", "blue")
    with rasterio.open(raster(tmp_path / "a.tif", levels=(200, 100, 50, 0)).path, "r+") as target:
        target.descriptions = (*names, text)
        target.write(np.where(upper_quarter_empty(), 255, 0).astype("uint8"), 4)
    header = read_raster_header(tmp_path / "a.tif")
    assert band_names(header, None) == names
    assert read_image(header.path).valid.mean() == 0.75


def test_infrared_of_a_colour_infrared_image_is_known_by_the_colours_of_the_others(tmp_path):
    header = raster(tmp_path / "a.tif", levels=(200, 100, 50), colours=("undefined", "red", "green"))
    assert band_names(header, None) == ("nir", "red", "green")
    assert "band 1: it was taken for near infrared" in assumed_bands(header, None)


def test_descriptions_that_contradict_the_colours_of_the_file_are_noted(tmp_path):
    header = raster(tmp_path / "a.tif", levels=(200, 100, 50), colours=("blue", "green", "red"))
    with rasterio.open(header.path, "r+") as target:
        target.descriptions = ("red", "green", "blue")
    assert "marks them as blue, green, red" in assumed_bands(read_raster_header(header.path), None)


@pytest.mark.parametrize("crs", ["EPSG:4978"])
def test_an_image_in_geocentric_coordinates_is_refused_by_its_kind(tmp_path, crs):
    with pytest.raises(CRSError, match=r"a\.tif: EPSG:4978 is geocentric"):
        raster(tmp_path / "a.tif", crs=crs)


def test_colours_of_other_models_are_refused(tmp_path):
    with rasterio.open(raster(tmp_path / "a.tif", levels=(1, 2, 3)).path, "r+") as target:
        target.colorinterp = [ColorInterp.hue, ColorInterp.saturation, ColorInterp.lightness]
    with pytest.raises(InputError, match="bands of hue, lightness, saturation"):
        read_raster_header(tmp_path / "a.tif")


def test_ground_control_points_alone_are_refused_by_their_name(tmp_path):
    points = [GroundControlPoint(row, row, WEST + row, NORTH - row) for row in (0, 5, 9)]
    size = {"driver": "GTiff", "width": 9, "height": 9, "count": 3, "dtype": "uint8"}
    with rasterio.open(tmp_path / "a.tif", "w", **size, gcps=points, crs="EPSG:25832") as target:
        target.write(np.ones((3, 9, 9), dtype=np.uint8))
    with pytest.raises(InputError, match="placed by ground control points alone: warp it"):
        read_raster_header(tmp_path / "a.tif")


@pytest.mark.parametrize(
    ("unit", "foreign"),
    [
        *(
            (text, False)
            for text in (
                "m (NAVD88)",
                "[m]",
                "metres above sea level",
                "m a.s.l.",
                "unknown",
                "metros",
                "mètre",
                "Höhe in m",
            )
        ),
        *((text, True) for text in ("mm", "US survey foot", "cm", "miles", "0.1 m", "m/s", "ft per m")),
    ],
)
def test_heights_in_metres_are_known_whatever_follows(tmp_path, unit, foreign):
    with rasterio.open(raster(tmp_path / "a.tif", levels=(10,), dtype="float32").path, "r+") as target:
        target.units = (unit,)
    assert (read_raster_header(tmp_path / "a.tif").height_unit == unit) is foreign


def spectral(path, bands, **profile):
    """Write bands of 0..255 beside each other, with the marks that GDAL gives."""
    values = np.stack(bands).astype(np.uint8)
    size = {"count": len(values), "height": values.shape[1], "width": values.shape[2], "dtype": "uint8"}
    transform = rasterio.Affine(0.5, 0, 500_000, 0, -0.5, 5_400_000)
    with rasterio.open(path, "w", driver="GTiff", crs="EPSG:25832", transform=transform, **size, **profile) as target:
        target.write(values)
    return path


def test_near_infrared_that_gdal_marks_as_alpha_is_read_by_its_description(tmp_path):
    colours = np.random.default_rng(0).integers(20, 200, (4, 60, 60))
    path = spectral(tmp_path / "a.tif", colours, photometric="RGB", alpha="YES")
    with rasterio.open(path, "r+") as target:
        assert target.colorinterp[3].name == "alpha"
        target.set_band_description(4, "NIR")
        target.set_band_description(1, "Red")
    image = read_image(path)
    assert image.bands == ("red", "green", "blue", "nir")
    assert image.valid is None
    np.testing.assert_array_equal(image.values, colours)


def test_names_of_bands_are_in_the_order_of_the_file_where_a_mark_of_alpha_stands_inside(tmp_path):
    colours = np.random.default_rng(0).integers(20, 200, (4, 60, 60))
    full = np.full((1, 60, 60), 255)
    path = spectral(tmp_path / "a.tif", np.concatenate([colours, full]), photometric="RGB", alpha="YES")
    image = read_image(path, bands=("red", "green", "blue", "nir", "-"))
    np.testing.assert_array_equal(image.values, colours)
    assert image.valid is None
    header = read_raster_header(path)
    with pytest.raises(InputError, match="holds 1 value only, as a mask does"):
        require_infrared(header, ("red", "green", "blue", "nir"))
