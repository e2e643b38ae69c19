import json
import struct

import laspy
import numpy as np
import pyproj
import pytest
import rasterio
import shapely
from builders import small_scenes
from builders.copc_files import write_copc
from harness.command_line import run
from rasterio import Affine

import roofbench as rb
from roofbench.scenes.geodata.las_files import read_las_header, read_points, write_points
from roofbench.scenes.geodata.raster_files import write_elevation, write_image
from roofbench.scenes.importing.request import ImportRequest
from roofbench.scenes.importing.scene_import import import_scene

CRS, WEST, SOUTH = small_scenes.CRS, small_scenes.WEST, small_scenes.SOUTH


@pytest.fixture
def files(tmp_path):
    """A sound set of input files: points, image, DEM, reference and area."""
    scene = small_scenes.scene()
    write_points(scene.points, tmp_path / "points.laz", crs=CRS)
    write_image(scene.image, tmp_path / "ortho.tif", crs=CRS)
    write_elevation(scene.dem, tmp_path / "dem.tif", crs=CRS)
    rb.write_footprints(scene.reference, tmp_path / "reference.gpkg")
    rb.write_footprints(rb.Footprints.of([scene.area], crs=CRS), tmp_path / "area.gpkg")
    return tmp_path


@pytest.fixture
def bring(files, monkeypatch):
    """Run ``roofbench scenes import`` inside the folder of the files."""
    monkeypatch.chdir(files)
    return lambda *arguments: run("scenes", "import", "-o", "out", *arguments)


@pytest.fixture
def refused(files, bring):
    """Return the one sentence with which an import is refused, after checking that nothing is left."""

    def refuse(*arguments):
        before = sorted(files.iterdir())
        code, out, err = bring(*arguments)
        lines = [line for line in err.splitlines() if not line.startswith("- ")]
        assert code == 2, err
        assert out == ""
        assert len(lines) == 1
        assert lines[0].startswith("Error: ")
        assert sorted(files.iterdir()) == before, "a failed import leaves something behind"
        return lines[0]

    return refuse


def las(path, *, crs=None, count=5, point_format=6, version="1.4", keys=()):
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = np.full(3, 0.001), np.array([WEST, SOUTH, 100.0])
    if crs:
        header.add_crs(pyproj.CRS.from_user_input(crs))
    for key, value in keys:
        record = header.vlrs.get("GeoKeyDirectoryVlr")[0]
        record.geo_keys.append(laspy.vlrs.known.GeoKeyEntryStruct(key, 0, 1, value))
        record.geo_keys_header.number_of_keys = len(record.geo_keys)
    data = laspy.LasData(header)
    points = laspy.ScaleAwarePointRecord.zeros(count, header=header)
    if count:
        points.x, points.y = np.linspace(WEST, WEST + 40, count), np.linspace(SOUTH, SOUTH + 40, count)
        points.z = np.full(count, 101.0)
        points.return_number[:] = 1
    data.points = points
    data.write(path)


def tiff(path, *, count=3, dtype="uint8", crs=CRS, transform=None, fill=7, nodata=None, size=80):
    transform = Affine(0.5, 0, WEST, 0, -0.5, SOUTH + 40) if transform is None else transform
    profile = {"driver": "GTiff", "width": size, "height": size, "count": count, "dtype": dtype, "nodata": nodata}
    with pytest.warns(rasterio.errors.NotGeoreferencedWarning) if transform.is_identity else open_always():
        target = rasterio.open(path, "w", crs=crs, transform=transform, **profile)
    with target:
        target.write(np.full((count, size, size), fill, dtype))


class open_always:
    def __enter__(self):
        return self

    def __exit__(self, *error):
        return False


# What works


def test_every_given_layer_is_used_unchanged(files, bring):
    code, out, err = bring(
        "points.laz", "ortho.tif", "--dem", "dem.tif", "--reference", "reference.gpkg", "--area", "area.gpkg",
        "--building-id", "building_id", "--source", "a survey", "--licence", "CC0-1.0",
    )  # fmt: skip
    assert (code, out) == (0, "out: scene 'out' with points, image, dem, reference, area\n")
    scene, truth = rb.open_scene(files / "out"), small_scenes.scene()
    assert scene.extent == truth.extent
    np.testing.assert_array_equal(scene.image.values, truth.image.values)
    np.testing.assert_array_equal(scene.points.x, truth.points.x)
    assert scene.dem.grid == truth.dem.grid
    np.testing.assert_array_equal(scene.dem.values[1:], truth.dem.values[1:])
    assert scene.dem.values[0, 0] == pytest.approx(100.0, abs=0.01)
    assert scene.reference.building_ids.tolist() == ["a", "a"]
    assert shapely.equals(scene.area, truth.area)
    assert (scene.facts["source"], scene.facts["licence"]) == ("a survey", "CC0-1.0")
    assert err == "- dem.tif: 0.1% of its cells had no height and were interpolated\nnext: roofbench run out\n"


def test_a_dem_is_derived_from_ground_points_with_a_note(files, bring):
    code, _, err = bring("points.laz")
    assert code == 0
    assert "the DEM was derived from the points of classes 2 (ground) and 9 (water)" in err
    dem = rb.open_scene(files / "out").dem
    assert np.abs(dem.values - 100.0).max() < 0.1
    assert "classes 2" in rb.open_scene(files / "out").facts["derived"]["dem"]


def test_a_dem_is_derived_by_a_ground_filter_without_classes(files, bring):
    write_points(small_scenes.cloud().unclassified(), files / "raw.laz", crs=CRS)
    code, _, err = bring("raw.laz")
    assert code == 0
    assert "by a ground filter (progressive opening), since no point is classified as ground" in err
    assert np.abs(rb.open_scene(files / "out").dem.values - 100.0).max() < 0.3


def test_a_dem_is_derived_by_a_cloth_on_request(files, bring):
    pytest.importorskip("CSF", reason="the extra 'ground' is not installed")
    code, out, err = bring("points.laz", "--ground-filter", "cloth")
    assert code == 0
    assert out == "out: scene 'out' with points, dem\n", "the library prints, the command must not"
    assert "the DEM was derived by a cloth simulation filter, at 1" in err
    assert np.abs(rb.open_scene(files / "out").dem.values - 100.0).max() < 0.3


def test_the_dem_of_a_slope_is_not_shifted(tmp_path):
    write_points(small_scenes.cloud(60_000, slope=0.5), tmp_path / "slope.laz", crs=CRS)
    dem = import_scene(tmp_path / "out", ImportRequest(points=tmp_path / "slope.laz")).dem
    truth = small_scenes.cloud(2000, seed=9, slope=0.5)
    ground = truth.classification == 2
    off = truth.z[ground] - dem.sample(truth.x[ground], truth.y[ground])
    assert abs(np.median(off)) < 0.02  # half a cell would be 0.25 m


def test_two_tiles_and_a_pattern_make_one_cloud(files, bring):
    write_points(small_scenes.cloud(1000, west=WEST + 40), files / "points2.laz", crs=CRS)
    code, _, _ = bring("--points", "points*.laz")
    assert code == 0
    scene = rb.open_scene(files / "out")
    assert len(scene.points) == 5000
    assert scene.extent == (WEST, SOUTH, WEST + 80, SOUTH + 40)


def test_a_window_keeps_what_lies_in_it(files, bring):
    code, _, err = bring(
        "points.laz", "ortho.tif", "--reference", "reference.gpkg", "--clip", WEST + 5, SOUTH + 5, WEST + 15, SOUTH + 20
    )
    assert code == 0
    scene = rb.open_scene(files / "out")
    x = small_scenes.cloud().x - WEST
    y = small_scenes.cloud().y - SOUTH
    assert len(scene.points) == np.count_nonzero((x >= 5) & (x <= 15) & (y >= 5) & (y <= 20))
    assert scene.image.grid.extent == (WEST + 5, SOUTH + 5, WEST + 15, SOUTH + 20)
    assert len(scene.reference) == 1
    assert "reference.gpkg: 1 of 2 footprints lie outside and were left out" in err
    assert shapely.equals(scene.area, shapely.box(*scene.extent)), "footprints reach beyond: the extent is the area"


def test_image_tiles_are_mosaicked_and_their_seam_is_invisible(files, bring):
    whole = small_scenes.image()
    half = 40
    for name, part, west in (("a", slice(None, half), WEST), ("b", slice(half, None), WEST + 20)):
        grid = rb.Grid(west, SOUTH + 40, 0.5, 80, 40)
        write_image(
            rb.Image(np.ascontiguousarray(whole.values[:, :, part]), whole.bands, grid), files / f"{name}.tif", crs=CRS
        )
    assert bring("points.laz", "a.tif", "b.tif")[0] == 0
    np.testing.assert_array_equal(rb.open_scene(files / "out").image.values, whole.values)


def test_an_image_in_another_crs_is_warped_to_its_place(files, bring):
    """A bright square drawn in UTM zone 33 lands on the same place of zone 32."""
    there = pyproj.Transformer.from_crs(CRS, "EPSG:25833", always_xy=True)
    xmin, ymin, xmax, ymax = there.transform_bounds(WEST, SOUTH, WEST + 40, SOUTH + 40)
    grid = rb.Grid.covering((xmin - 5, ymin - 5, xmax + 5, ymax + 5), 0.25)
    square = shapely.transform(
        shapely.segmentize(shapely.box(WEST + 10, SOUTH + 10, WEST + 20, SOUTH + 25), 1.0),
        lambda points: np.column_stack(there.transform(*points.T)),
    )
    rows, columns = np.indices(grid.shape)
    x, y = grid.to_world(rows + 0.5, columns + 0.5)
    bright = np.where(shapely.contains_xy(square, x, y), 250, 10).astype(np.uint8)
    write_image(
        rb.Image(np.stack([bright] * 3), ("red", "green", "blue"), grid), files / "zone33.tif", crs="EPSG:25833"
    )
    code, _, err = bring("points.laz", "zone33.tif", "--gsd", 0.25)
    assert code == 0
    assert "zone33.tif was resampled from EPSG:25833 to EPSG:25832" in err
    image = rb.open_scene(files / "out").image
    found = np.argwhere(image.values[0] > 130)
    x, y = image.grid.to_world(found[:, 0] + 0.5, found[:, 1] + 0.5)
    assert (x.min() - 0.125, x.max() + 0.125) == pytest.approx((WEST + 10, WEST + 20), abs=0.26)
    assert (y.min() - 0.125, y.max() + 0.125) == pytest.approx((SOUTH + 10, SOUTH + 25), abs=0.26)


def test_a_finer_image_is_averaged_to_the_cell_size_asked_for(files, bring):
    fine = small_scenes.image(gsd=0.25)
    write_image(fine, files / "fine.tif", crs=CRS)
    code, _, err = bring("points.laz", "fine.tif", "--gsd", 0.5)
    assert code == 0
    assert "fine.tif was resampled to cells of 0.5 m" in err
    mean = fine.values.reshape(3, 80, 2, 80, 2).mean(axis=(2, 4))
    np.testing.assert_allclose(rb.open_scene(files / "out").image.values, mean, atol=1.0)


def test_bands_are_named_and_skipped(files, bring):
    write_image(small_scenes.image(bands=("red", "green", "blue", "nir")), files / "four.tif", crs=CRS)
    assert bring("points.laz", "four.tif", "--bands", "nir,red,green,-")[0] == 0
    image = rb.open_scene(files / "out").image
    assert image.bands == ("nir", "red", "green")
    np.testing.assert_array_equal(image.values, small_scenes.image(bands=("red", "green", "blue", "nir")).values[:3])


def test_coloured_points_give_an_image(files, bring):
    write_points(small_scenes.cloud(40_000, colour=True), files / "colour.laz", crs=CRS)
    code, _, err = bring("colour.laz", "--ortho-from-points")
    assert code == 0
    assert "the orthoimage was rastered from the colours of the points" in err
    assert rb.open_scene(files / "out").image.is_colour


def test_a_reference_in_degrees_is_transformed(files, bring):
    reference = small_scenes.scene().reference
    there = pyproj.Transformer.from_crs(CRS, "EPSG:4326", always_xy=True)
    degrees = shapely.transform(reference.polygons, lambda points: np.column_stack(there.transform(*points.T)))
    features = [
        {"type": "Feature", "properties": {}, "geometry": shapely.geometry.mapping(polygon)} for polygon in degrees
    ]
    (files / "wgs84.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    assert bring("points.laz", "--reference", "wgs84.geojson")[0] == 0
    scene = rb.open_scene(files / "out")
    assert scene.reference.crs == CRS
    assert shapely.hausdorff_distance(scene.reference.polygons, reference.polygons).max() < 0.01


def test_footprints_that_need_it_are_repaired_and_reported(files, bring):
    bow_tie = shapely.Polygon(
        [(WEST + 1, SOUTH + 1), (WEST + 9, SOUTH + 9), (WEST + 9, SOUTH + 1), (WEST + 1, SOUTH + 9)]
    )
    flat = shapely.Polygon([(WEST + 1, SOUTH + 1), (WEST + 9, SOUTH + 9), (WEST + 1, SOUTH + 1)])
    rows = [bow_tie, flat, shapely.box(WEST + 10, SOUTH + 10, WEST + 20, SOUTH + 20)]
    features = [{"type": "Feature", "properties": {}, "geometry": shapely.geometry.mapping(row)} for row in rows]
    (files / "odd.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    code, _, err = bring("points.laz", "--reference", "odd.geojson")
    assert code == 0
    assert "odd.geojson: 2 footprints were repaired or left out (feature 0: Self-intersection" in err
    assert "feature 1: " in err
    assert len(rb.open_scene(files / "out").reference) == 2


def test_class_6_gives_a_reference_with_the_right_area(files, bring):
    write_points(small_scenes.cloud(20_000), files / "dense.laz", crs=CRS)
    code, _, err = bring("dense.laz", "--reference-from-class")
    assert code == 0
    assert "the reference (1 footprint) was traced around the points of class 6 (building)" in err
    outline = rb.open_scene(files / "out").reference.polygons[0]
    truth = shapely.box(WEST + 10, SOUTH + 10, WEST + 20, SOUTH + 25)
    assert shapely.intersection(outline, truth).area / shapely.union(outline, truth).area > 0.93


def test_an_l_shape_becomes_rectangles_of_one_building(files, bring):
    shape = shapely.union(
        shapely.box(WEST + 5, SOUTH + 5, WEST + 25, SOUTH + 13), shapely.box(WEST + 5, SOUTH + 5, WEST + 12, SOUTH + 30)
    )
    rb.write_footprints(rb.Footprints.of([shape], crs=CRS), files / "l.gpkg")
    code, _, err = bring("points.laz", "--reference", "l.gpkg", "--as-rectangles")
    assert code == 0
    assert "decomposed into rectangles (1 footprint, 2 rectangles, areas agree to 100.0%)" in err
    reference = rb.open_scene(files / "out").reference
    assert len(reference) == 2
    assert len(set(reference.building_ids.tolist())) == 1


def test_houses_of_a_row_are_joined_to_blocks(files, bring):
    row = [shapely.box(WEST + 6 * k, SOUTH + 5, WEST + 6 * k + 5.95, SOUTH + 14) for k in range(3)]
    rb.write_footprints(rb.Footprints.of(row, crs=CRS), files / "row.gpkg")
    code, _, err = bring("points.laz", "--reference", "row.gpkg", "--join-gaps", 0.1)
    assert code == 0
    assert "joined over gaps below 0.1 m (3 footprints, 1 block)" in err
    assert rb.open_scene(files / "out").reference.areas.tolist() == pytest.approx([17.95 * 9])


def test_noise_and_withheld_points_are_left_out(files, bring):
    cloud = small_scenes.cloud()
    cloud.classification[:3] = (7, 18, 7)
    cloud.z[:3] = (-500, 3000, -400)
    write_points(cloud, files / "noisy.laz", crs=CRS)
    with laspy.open(files / "noisy.laz") as reader:
        data = reader.read()
    data.withheld[10] = 1
    data.write(files / "noisy.laz")
    code, _, err = bring("noisy.laz")
    assert code == 0
    assert "3 points were left out: class 7 or 18 (noise)" in err
    points = rb.open_scene(files / "out").points
    assert len(points) == len(cloud) - 4
    assert points.z.min() > 99


def test_points_where_no_land_is_are_left_out(files, bring, refused):
    cloud = small_scenes.scene().points
    heights = cloud.z.copy()
    heights[:7] = -9999
    write_points(rb.PointCloud(cloud.x, cloud.y, heights), files / "wild.laz", crs=CRS)
    code, _, printed = bring("wild.laz")
    assert code == 0, printed
    assert "7 points were left out: heights such as -9999 m are beyond those of land" in printed
    assert rb.open_scene(files / "out").points.z.min() > 0
    write_points(rb.PointCloud(cloud.x, cloud.y, np.full_like(heights, 5e4)), files / "space.laz", crs=CRS)
    (files / "out").rename(files / "kept")
    assert "space.laz contains no plausible heights" in refused("space.laz")


def test_points_that_overlapping_tiles_hold_twice_are_taken_once(files, bring):
    cloud = small_scenes.cloud()
    write_points(cloud, files / "west.laz", crs=CRS)
    write_points(cloud.take(slice(5, 40)), files / "east.laz", crs=CRS)
    code, _, printed = bring("west.laz", "east.laz")
    assert code == 0, printed
    assert "35 duplicate points were left out" in printed
    assert len(rb.open_scene(files / "out").points) == len(cloud)


def test_points_without_crs_take_the_one_named_and_say_so(files, bring):
    write_points(small_scenes.cloud(), files / "bare.laz")
    code, _, err = bring("bare.laz", "--crs", CRS)
    assert code == 0
    assert "bare.laz had no CRS and was taken to be in EPSG:25832" in err
    assert rb.open_scene(files / "out").crs == CRS


def test_notes_are_kept_but_not_printed_when_quiet(files, bring):
    code, out, printed = bring("points.laz", "-q")
    assert (code, printed) == (0, "")
    assert "scene 'out'" in out
    assert rb.open_scene(files / "out").facts["notes"]


def test_a_crs_may_be_a_number(files, bring):
    las(files / "bare.laz")
    code, _, printed = bring("bare.laz", "--crs", CRS.removeprefix("EPSG:"))
    assert code == 0, printed
    assert rb.open_scene(files / "out").crs == CRS


def test_web_mercator_is_warned_of(files, bring):
    las(files / "web.laz", crs="EPSG:3857")
    code, _, printed = bring("web.laz")
    assert code == 0, printed
    assert "warning: EPSG:3857 shows areas" in printed
    assert any("EPSG:3857" in note for note in rb.open_scene(files / "out").facts["notes"])


def test_heights_above_another_zero_are_warned_of(files, bring):
    dem = small_scenes.scene().dem
    write_elevation(rb.Elevation(dem.values + 46, dem.grid), files / "ellipsoid.tif", crs=CRS)
    code, _, err = bring("points.laz", "--dem", "ellipsoid.tif")
    assert code == 0
    assert "warning: the lower points lie 46.0 m below ellipsoid.tif" in err


def test_an_image_alone_makes_a_scene(files, bring):
    code, out, _ = bring("ortho.tif")
    assert (code, out) == (0, "out: scene 'out' with image\n")


def test_an_import_can_replace_a_scene(files, bring):
    assert bring("points.laz")[0] == 0
    code, _, err = bring("points.laz")
    assert code == 2
    assert "out exists already: set --overwrite" in err
    assert bring("points.laz", "ortho.tif", "--overwrite")[0] == 0
    assert (files / "out" / "ortho.tif").exists()


# What is refused, each with one sentence


def test_points_without_a_crs(files, refused):
    write_points(small_scenes.cloud(), files / "bare.laz")
    assert "bare.laz has no coordinate reference system: set it by --crs" in refused("bare.laz")


def test_points_of_two_crs(files, refused):
    las(files / "zone33.las", crs="EPSG:25833")
    message = refused("points.laz", "zone33.las")
    assert "zone33.las is in EPSG:25833 but points.laz is in EPSG:25832" in message
    assert "reproject" in message


def test_points_with_and_without_a_crs(files, refused):
    las(files / "bare.las")
    assert "bare.las has no CRS while points.laz is in EPSG:25832" in refused("points.laz", "bare.las")


def test_points_in_another_crs_than_the_one_named(files, refused):
    assert "points.laz is in EPSG:25832 but --crs says EPSG:25833" in refused("points.laz", "--crs", "EPSG:25833")


def test_points_in_degrees(files, refused):
    las(files / "degrees.las", crs="EPSG:4326")
    message = refused("degrees.las")
    assert "degrees.las" in message
    assert "EPSG:4326 is geographic (degrees)" in message


def test_points_in_us_feet(files, refused):
    las(files / "feet.las", crs="EPSG:2263")
    message = refused("feet.las")
    assert "feet.las" in message
    assert "US survey foot, metres are needed" in message


@pytest.mark.parametrize("vertical", ["EPSG:6360", "EPSG:8228"])
def test_heights_in_feet(files, refused, vertical):
    las(files / "feet.las", crs=f"{CRS}+{vertical.removeprefix('EPSG:')}")
    message = refused("feet.las")
    assert "feet.las: its heights are in " in message
    assert "foot" in message


@pytest.mark.parametrize(("key", "what"), [(4099, "heights"), (3076, "coordinates")])
def test_feet_in_the_keys_of_old_files(files, refused, key, what):
    las(files / "old.las", crs=CRS, version="1.2", point_format=1, keys=[(key, 9003)])
    assert f"old.las: its {what} are in US survey foot, metres are needed" in refused("old.las")


def test_an_unknown_crs(refused):
    assert "'EPSG:999999' is not a coordinate reference system" in refused("points.laz", "--crs", "EPSG:999999")
    assert "crs: EPSG:4326 is geographic" in refused("points.laz", "--crs", "EPSG:4326")


def test_a_cloud_without_points(files, refused):
    las(files / "empty.las", crs=CRS, count=0)
    assert "empty.las holds no points" in refused("points.laz", "empty.las")


def test_heights_that_are_nan(files, refused):
    las(files / "nan.las", crs=CRS)
    content = bytearray((files / "nan.las").read_bytes())
    struct.pack_into("<d", content, 147, np.nan)  # the scale of z (LAS 1.4 R15, table 3)
    (files / "nan.las").write_bytes(content)
    message = refused("nan.las")
    assert "nan.las: scale [0.001, 0.001, nan]" in message
    assert "not finite" in message


@pytest.mark.parametrize("share", [0.002, 0.01, 0.5, 0.99])
@pytest.mark.parametrize("ending", ["laz", "las"])
def test_a_truncated_file(files, refused, share, ending):
    write_points(small_scenes.cloud(20_000), files / f"whole.{ending}", crs=CRS)
    content = (files / f"whole.{ending}").read_bytes()
    (files / f"cut.{ending}").write_bytes(content[: max(20, int(len(content) * share))])
    message = refused(f"cut.{ending}")
    assert f"cut.{ending} is truncated" in message
    assert "copy or download it again" in message


def test_a_file_that_is_not_las(files, refused):
    (files / "text.laz").write_text("x y z\n1 2 3\n")
    assert "text.laz is not a LAS file: it begins with b'x y '" in refused("text.laz")


def test_files_that_are_not_there(refused):
    assert "nowhere.laz: no such file" in refused("nowhere.laz")
    assert "no*.laz: no file matches this pattern" in refused("--points", "no*.laz")
    assert "nowhere.tif: no such file" in refused("points.laz", "nowhere.tif")
    assert "nowhere.gpkg: no such file" in refused("points.laz", "--reference", "nowhere.gpkg")
    assert "dem2.tif: no such file" in refused("points.laz", "--dem", "dem2.tif")


def test_a_folder_in_place_of_points(files, refused):
    (files / "tiles").mkdir()
    assert "tiles is a folder: name LAS, LAZ or COPC files, for instance tiles/*.laz" in refused("--points", "tiles")


def test_an_image_without_georeference(files, refused):
    tiff(files / "photo.tif", crs=None, transform=Affine.identity())
    assert "photo.tif has no georeference" in refused("points.laz", "photo.tif")


@pytest.mark.parametrize(
    "transform",
    [
        Affine(0.47, 0.17, WEST, 0.17, -0.47, SOUTH + 40),
        Affine(0.5, 0, WEST, 0, 0.5, SOUTH),
    ],
    ids=["rotated", "south up"],
)
def test_an_image_that_is_not_north_up(files, refused, transform):
    tiff(files / "turned.tif", transform=transform)
    message = refused("points.laz", "turned.tif")
    assert "turned.tif is rotated or not north up" in message
    assert "gdalwarp" in message


def test_an_image_of_another_place(files, refused):
    tiff(files / "far.tif", transform=Affine(0.5, 0, WEST + 5000, 0, -0.5, SOUTH))
    message = refused("points.laz", "far.tif")
    assert "far.tif (image) covers x 505000.0 to 505040.0" in message
    assert "does not overlap points.laz (points)" in message


def test_an_image_without_data_where_the_points_are(files, refused):
    tiff(files / "void.tif", fill=0, nodata=0)
    assert "void.tif has no data in x 500000.0" in refused("points.laz", "void.tif")


def test_a_wrong_number_of_bands(files, refused):
    message = refused("points.laz", "ortho.tif", "--bands", "red,green,blue,nir")
    assert "ortho.tif has 3 bands, but --bands names 4" in message
    tiff(files / "five.tif", count=5)
    assert "five.tif has 5 bands, expected 1 (grey), 3 (red, green, blue) or 4" in refused("points.laz", "five.tif")
    assert "'pink', which is not a band name" in refused("points.laz", "ortho.tif", "--bands", "red,green,pink")
    assert "none twice" in refused("points.laz", "ortho.tif", "--bands", "red,red,blue")


def test_images_that_do_not_belong_together(files, refused):
    tiff(files / "grey.tif", count=1)
    assert "grey.tif has the bands grey but ortho.tif red, green, blue" in refused(
        "points.laz", "ortho.tif", "grey.tif"
    )
    tiff(files / "deep.tif", dtype="uint16")
    assert "deep.tif is uint16 but ortho.tif uint8" in refused("points.laz", "ortho.tif", "deep.tif")


def test_an_image_of_floating_point_numbers(files, refused):
    tiff(files / "float.tif", dtype="float32")
    assert "float.tif has float32 values, an orthoimage needs uint8 or uint16" in refused("points.laz", "float.tif")


def test_an_image_that_is_no_image(files, refused):
    (files / "text.tif").write_text("no image")
    assert "text.tif cannot be read as a raster" in refused("points.laz", "text.tif")


def test_a_truncated_image(files, refused):
    content = (files / "ortho.tif").read_bytes()
    (files / "cut.tif").write_bytes(content[: len(content) // 2])
    assert "cut.tif cannot be read as a raster" in refused("points.laz", "cut.tif")


def test_a_dem_without_heights(files, refused):
    tiff(files / "nan.tif", count=1, dtype="float32", fill=np.nan)
    assert "nan.tif holds no height in x 500000.0" in refused("points.laz", "--dem", "nan.tif")
    tiff(files / "none.tif", count=1, dtype="float32", fill=-9999, nodata=-9999)
    assert "none.tif holds no height" in refused("points.laz", "--dem", "none.tif")


def test_a_dem_of_another_place(files, refused):
    tiff(files / "far.tif", count=1, dtype="float32", transform=Affine(1, 0, 10, 0, -1, 90))
    assert "far.tif covers x 10.0 to 90.0, y 10.0 to 90.0 and not the scene" in refused(
        "points.laz", "--dem", "far.tif"
    )


def test_a_dem_of_several_bands(refused):
    assert "ortho.tif has 3 bands, expected an elevation model of one" in refused("points.laz", "--dem", "ortho.tif")


def test_a_dem_in_feet(files, refused):
    tiff(files / "feet.tif", count=1, dtype="float32", crs=f"{CRS}+6360")
    assert "feet.tif: its heights are in US survey foot" in refused("points.laz", "--dem", "feet.tif")
    with rasterio.open(files / "dem.tif", "r+") as target:
        target.units = ("ft",)
    assert "dem.tif: its heights are in ft" in refused("points.laz", "--dem", "dem.tif")


def test_a_dem_whose_gaps_are_heights(files, refused):
    with rasterio.open(files / "dem.tif", "r+") as target:
        values = target.read(1)
        values[3:5, 3:5] = -9999
        target.write(values, 1)
    assert "dem.tif contains heights of -9999 m, beyond those of land" in refused("points.laz", "--dem", "dem.tif")


def test_a_reference_of_another_place(files, refused):
    rb.write_footprints(rb.Footprints.of([shapely.box(0, 0, 9, 9)], crs=CRS), files / "far.gpkg")
    message = refused("points.laz", "--reference", "far.gpkg")
    assert "far.gpkg covers x 0.0 to 9.0, y 0.0 to 9.0 and lies outside the scene" in message


def test_a_reference_without_polygons(files, refused):
    feature = {"type": "Feature", "properties": {}, "geometry": {"type": "Point", "coordinates": [9, 50]}}
    (files / "dots.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    assert "dots.geojson: no polygons among 1 feature" in refused("points.laz", "--reference", "dots.geojson")


def test_a_reference_without_the_column(refused):
    message = refused("points.laz", "--reference", "reference.gpkg", "--building-id", "bulding_id")
    assert "reference.gpkg has no column 'bulding_id' (did you mean 'building_id'?)" in message


def test_a_reference_from_points_that_are_no_buildings(files, refused):
    write_points(small_scenes.cloud().unclassified(), files / "raw.laz", crs=CRS)
    assert "raw.laz: the points are not classified" in refused("raw.laz", "--reference-from-class")
    cloud = small_scenes.cloud()
    write_points(cloud.take(cloud.classification == 2), files / "ground.laz", crs=CRS)
    message = refused("ground.laz", "--reference-from-class")
    assert "ground.laz: no point is of class 6 (there are 2): give footprints by --reference" in message


def test_an_image_from_points_without_colour(refused):
    assert "points.laz: the points carry no colour" in refused("points.laz", "--ortho-from-points")


def test_an_area_of_another_place(files, refused):
    rb.write_footprints(rb.Footprints.of([shapely.box(0, 0, 9, 9)], crs=CRS), files / "far.gpkg")
    assert "far.gpkg does not overlap the scene" in refused("points.laz", "--area", "far.gpkg")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "give --points, --dsm or --ortho"),
        (["points.laz", "--reference", "reference.gpkg", "--reference-from-class"], "not both"),
        (["points.laz", "ortho.tif", "--ortho-from-points"], "not both"),
        (["ortho.tif", "--reference-from-class"], "needs points: give --points"),
        (["points.laz", "--as-rectangles"], "--as-rectangles needs a reference"),
        (["points.laz", "--join-gaps", 0.1], "--join-gaps needs a reference"),
        (["points.laz", "--building-id", "id"], "give --reference"),
        (["points.laz", "ortho.tif", "--gsd", "0"], "--gsd must be from 0.01 to 100 m, not 0"),
        (["points.laz", "--extent", "5", "5", "1", "9"], "must be xmin ymin xmax ymax"),
        (["points.laz", "--extent", "0", "0", "9", "9"], "the extent asked for covers x 0.0 to 9.0"),
        (["points.laz", "--ground-filter", "magic"], "--ground-filter must be opening or cloth, not 'magic'"),
        (["points.laz", "--dem", "dem.tif", "--ground-filter", "cloth"], "--dem or --ground-filter, not both"),
        (["points.laz", "--points", "p*.laz"], "points.laz is given twice"),
        (["ortho.tif", "--gsd", "0.01", "--extent", "0", "0", "9", "9"], "the extent asked for covers"),
        (["points.laz", "--bands", "red,green,blue"], "give --ortho"),
        (["points.laz", "--name", ""], "--name must not be empty"),
        (["points.laz", "--crs", "EPSG:4326"], "name a projected one"),
        (["points.laz", "--reference", "reference.gpkg", "--join-gaps", "1e9"], "up to 100 m"),
        (["reference.gpkg"], "reference.gpkg ends neither as a point file"),
    ],
)
def test_options_that_do_not_fit(refused, arguments, message):
    assert message in refused(*arguments)


def test_a_folder_that_cannot_be_written(files, monkeypatch):
    monkeypatch.chdir(files)
    code, _, err = run("scenes", "import", "points.laz", "-o", "no/such/folder")
    assert code == 2
    assert "no/such/folder cannot be written: there is no folder no/such" in err


def test_a_header_with_wrong_bounds(files, refused):
    content = bytearray((files / "points.laz").read_bytes())
    struct.pack_into("<d", content, 187, 0.0)  # the least x (LAS 1.4 R15, table 3)
    (files / "wide.laz").write_bytes(content)
    message = refused("wide.laz")
    assert "wide.laz: the header says x 0.0 to 500040.0" in message
    assert "give --extent 500000 5700000 500040 5700040" in message


def test_a_stray_point_far_away(files, refused):
    cloud = small_scenes.cloud()
    cloud.x[0], cloud.y[0] = WEST + 80_000, SOUTH + 70_000
    write_points(cloud, files / "stray.laz", crs=CRS)
    message = refused("stray.laz")
    assert "would have 70,000 x 80,000 cells of 1 m: cut it by --extent, or choose larger cells" in message


# Windows and chunks


@pytest.mark.parametrize("east", [0, 18, 30])
def test_a_copc_file_is_read_whole_and_by_window(tmp_path, east):
    cloud = small_scenes.cloud(5000)
    write_copc(tmp_path / "points.copc.laz", cloud, crs=CRS)
    header = read_las_header(tmp_path / "points.copc.laz")
    assert (header.is_copc, header.count, header.crs) == (True, 5000, CRS)
    assert len(read_points(tmp_path / "points.copc.laz")) == 5000
    window = (WEST + east, SOUTH - 1e7, WEST + east + 9, SOUTH + 20)
    part = read_points(tmp_path / "points.copc.laz", window=window)
    inside = (cloud.x >= window[0]) & (cloud.x <= window[2]) & (cloud.y <= window[3])
    for column in ("x", "z", "classification"):
        np.testing.assert_allclose(np.sort(getattr(part, column)), np.sort(getattr(cloud, column)[inside]))


def test_a_copc_file_is_imported(files, bring):
    write_copc(files / "points.copc.laz", small_scenes.cloud(), crs=CRS)
    assert bring("points.copc.laz", "--clip", WEST, SOUTH, WEST + 20, SOUTH + 40)[0] == 0
    assert len(rb.open_scene(files / "out").points) == np.count_nonzero(small_scenes.cloud().x <= WEST + 20)


def test_a_window_and_chunks_give_the_same_points_as_the_whole(tmp_path, monkeypatch):
    cloud = small_scenes.cloud(5000, colour=True)
    write_points(cloud, tmp_path / "points.laz", crs=CRS)
    monkeypatch.setattr("roofbench.scenes.geodata.las_files.CHUNK", 700)
    window = (WEST + 7, SOUTH + 3, WEST + 21, SOUTH + 33)
    part = read_points(tmp_path / "points.laz", window=window)
    inside = (cloud.x >= window[0]) & (cloud.x <= window[2]) & (cloud.y >= window[1]) & (cloud.y <= window[3])
    truth = cloud.take(inside)
    for column in ("x", "y", "z", "return_number", "number_of_returns", "intensity", "classification", "colour"):
        np.testing.assert_allclose(getattr(part, column), getattr(truth, column), rtol=1e-15)


FEW = {"one point": 1, "two points": 2, "one place": 5, "a line": 10}


@pytest.mark.parametrize("kind", FEW)
def test_check_accepts_what_import_wrote_of_few_points(files, bring, kind):
    count = FEW[kind]
    along = np.zeros(count) if kind == "one place" else np.arange(count, dtype=float)
    cloud = rb.PointCloud(x=WEST + along, y=np.full(count, SOUTH), z=np.full(count, 100.0))
    write_points(cloud, files / "few.laz", crs=CRS)
    code, _, err = bring("few.laz")
    assert code == 0, err
    code, _, err = run("scenes", "check", "out")
    assert code == 0, err
