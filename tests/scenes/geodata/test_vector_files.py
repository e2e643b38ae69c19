import contextlib
import json
import shutil
import sqlite3
import struct

import numpy as np
import pandas as pd
import pyogrio
import pytest
import shapely
from shapely import MultiPolygon, box

import roofbench as rb
from roofbench.core.errors import CRSError, InputError, OutputError
from roofbench.scenes.geodata.vector_files import split_layer, write_layers
from roofbench.scenes.geodata.wkb import geometries_of_wkb

ENDINGS = ("geojson", "json", "gpkg", "shp", "fgb", "parquet", "geoparquet")
CRS = "EPSG:28992"
SQUARES = [box(85000 + 20 * i, 447000, 85010 + 20 * i, 447010) for i in range(3)]
RING = [[85000, 447000], [85010, 447000], [85010, 447010], [85000, 447010], [85000, 447000]]
POLYGON = {"type": "Polygon", "coordinates": [RING]}


def there_and_back(footprints, path):
    rb.write_footprints(footprints, path)
    return rb.read_footprints(path)


@pytest.fixture
def geojson(tmp_path):
    """Write features, given as (geometry, properties), and return the path."""

    def write(*features, crs=CRS, **more):
        collection = {
            "type": "FeatureCollection",
            "features": [{"type": "Feature", "geometry": g, "properties": p} for g, p in features],
        }
        if crs is not None:
            collection["crs"] = {"type": "name", "properties": {"name": crs}}
        (tmp_path / "in.geojson").write_text(json.dumps(collection | more))
        return tmp_path / "in.geojson"

    return write


# There and back, in every format


@pytest.mark.parametrize("ending", ENDINGS)
def test_polygons_order_crs_and_building_ids_come_back(tmp_path, ending):
    polygons = [SQUARES[2], MultiPolygon([SQUARES[0], box(85000, 447020, 85010, 447030)]), SQUARES[1]]
    before = rb.Footprints.of(polygons, crs=CRS, building_ids=["x", "y", "x"], attributes={"height": [3.5, 4.5, 5.5]})
    after = there_and_back(before, tmp_path / f"out.{ending}")
    assert after.crs == CRS
    assert shapely.equals(after.polygons, before.polygons).all()
    assert [polygon.geom_type for polygon in after.polygons] == ["Polygon", "MultiPolygon", "Polygon"]
    assert after.building_ids.tolist() == ["x", "y", "x"]
    assert after.attributes["height"].tolist() == [3.5, 4.5, 5.5]
    assert after.repairs == ()


@pytest.mark.parametrize("ending", ENDINGS)
def test_an_empty_set_comes_back_empty(tmp_path, ending):
    after = there_and_back(rb.Footprints.empty(crs=CRS), tmp_path / f"out.{ending}")
    assert len(after) == 0
    assert after.crs in (CRS, None) if ending in ("geojson", "json") else after.crs == CRS


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_set_without_crs_comes_back_without(tmp_path, ending):
    after = there_and_back(rb.Footprints.of([box(0, 0, 9, 9)]), tmp_path / f"out.{ending}")
    assert (after.crs, len(after)) == (None, 1)


@pytest.mark.parametrize("ending", ENDINGS)
def test_coordinates_far_from_the_origin_keep_every_digit(tmp_path, ending):
    far = shapely.transform(SQUARES[0], lambda points: points + np.array([6e6 + 1 / 3, 1e7 + 1 / 7]))
    after = there_and_back(rb.Footprints.of([far], crs=CRS), tmp_path / f"out.{ending}")
    assert shapely.hausdorff_distance(after.polygons[0], far) < 1e-8


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize(
    "column",
    [
        np.array([1, 2, 3], np.uint8),
        np.array([2**40, -1, 0]),
        np.array([1.5, -2.5, 0.0], np.float32),
        np.array([1.5, np.nan, 2.5]),
        np.array([True, False, True]),
        np.array(["a", "Ümlaut €", "c"]),
        np.array(["a", None, "c"], dtype=object),
        np.array([1, None, 3], dtype=object),
        np.array([1.0, 2.0, 3.0], np.float16),
        np.array(["2020-01-02", "2021-03-04", "NaT"], "datetime64[D]"),
        np.ma.MaskedArray([1.0, 2.0, 3.0], mask=[False, True, False]),
    ],
    ids=lambda column: f"{column.dtype}",
)
def test_columns_of_every_type_come_back(tmp_path, ending, column):
    before = rb.Footprints.of(SQUARES, crs=CRS, attributes={"a": column})
    after = there_and_back(before, tmp_path / f"out.{ending}").attributes["a"]
    for own, theirs, masked in zip(np.ma.getdata(column), after, np.ma.getmaskarray(column), strict=True):
        if masked or pd.isna(own):
            assert pd.isna(theirs)
        elif column.dtype.kind == "M":
            assert pd.Timestamp(theirs) == pd.Timestamp(own)
        else:
            assert theirs == own


@pytest.mark.parametrize("ending", ["gpkg", "parquet"])
def test_times_come_back(tmp_path, ending):
    times = np.array(["2020-01-02T03:04:05", "2021-03-04T00:00", "NaT"], "datetime64[ns]")
    after = there_and_back(rb.Footprints.of(SQUARES, crs=CRS, attributes={"t": times}), tmp_path / f"out.{ending}")
    np.testing.assert_array_equal(after.attributes["t"].astype("datetime64[ns]"), times)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("name", ["fid", "FID", "geom", "geometry", "", "a 'quoted' \"name\"", "größe", "a" * 60])
def test_columns_of_any_name_can_be_written(tmp_path, ending, name):
    after = there_and_back(rb.Footprints.of(SQUARES, crs=CRS, attributes={name: [5, 5, 6]}), tmp_path / f"out.{ending}")
    (values,) = after.attributes.values()
    assert values.tolist() == [5, 5, 6]


@pytest.mark.parametrize("ending", ENDINGS)
def test_names_that_differ_in_capitals_only_are_both_written(tmp_path, ending):
    before = rb.Footprints.of(SQUARES, crs=CRS, attributes={"id": [1, 2, 3], "ID": [4, 5, 6]})
    after = there_and_back(before, tmp_path / f"out.{ending}")
    assert [values.tolist() for values in after.attributes.values()] == [[1, 2, 3], [4, 5, 6]]


def test_a_shapefile_knows_building_ids_by_their_short_names(tmp_path):
    before = rb.Footprints.of(SQUARES, crs=CRS, building_ids=[7, 7, 9], attributes={"identificatie": ["p", "p", "q"]})
    rb.write_footprints(before, tmp_path / "out.shp")
    assert rb.read_footprints(tmp_path / "out.shp").building_ids.tolist() == [7, 7, 9]
    by_column = rb.read_footprints(tmp_path / "out.shp", building_id="identificatie")
    assert by_column.building_ids.tolist() == ["p", "p", "q"]


def test_a_crs_without_code_comes_back_as_the_same_system(tmp_path):
    crs = "+proj=tmerc +lat_0=50 +lon_0=10 +ellps=GRS80 +units=m"
    before = rb.Footprints.of(SQUARES, crs=crs)
    from roofbench.scenes.geodata.crs import same_crs

    for ending in ("gpkg", "fgb", "parquet"):
        assert same_crs(there_and_back(before, tmp_path / f"out.{ending}").crs, crs)
    with pytest.raises(OutputError, match=r"out\.geojson: GeoJSON names a CRS by its EPSG code"):
        rb.write_footprints(before, tmp_path / "out.geojson")


def test_equal_sets_give_equal_bytes(tmp_path):
    for name in ("one.gpkg", "two.gpkg"):
        write_layers({"roofs": (np.array(SQUARES, dtype=object), {"a": np.arange(3)})}, tmp_path / name, crs=CRS)
    assert (tmp_path / "one.gpkg").read_bytes() == (tmp_path / "two.gpkg").read_bytes()


# Layers


def test_layers_are_read_by_name(tmp_path):
    both = {"a": (np.array(SQUARES[:1], dtype=object), {}), "b": (np.array(SQUARES[1:], dtype=object), {})}
    write_layers(both, tmp_path / "two.gpkg", crs=CRS)
    assert len(rb.read_footprints(f"{tmp_path}/two.gpkg|layername=b")) == 2
    assert len(rb.read_footprints(tmp_path / "two.gpkg", layer="a")) == 1
    with pytest.raises(InputError, match=r"has 2 layers \(a, b\): name one as .*two\.gpkg\|layername=a"):
        rb.read_footprints(tmp_path / "two.gpkg")
    with pytest.raises(InputError, match=r"no layer 'c'.*it has a, b"):
        rb.read_footprints(tmp_path / "two.gpkg", layer="c")
    with pytest.raises(OutputError, match=r"2 layers \(a, b\) need a GeoPackage"):
        write_layers(both, tmp_path / "two.fgb", crs=CRS)


def test_a_table_beside_the_layer_is_no_second_layer(tmp_path):
    rb.write_footprints(rb.Footprints.of(SQUARES, crs=CRS), tmp_path / "roofs.gpkg")
    pyogrio.write_dataframe(pd.DataFrame({"a": [1]}), tmp_path / "roofs.gpkg", layer="notes")
    assert len(rb.read_footprints(tmp_path / "roofs.gpkg")) == 3


def test_a_file_name_that_the_format_keeps_for_itself_is_no_obstacle(tmp_path):
    assert len(there_and_back(rb.Footprints.of(SQUARES, crs=CRS), tmp_path / "gpkg_roofs.gpkg")) == 3


def test_a_path_without_a_layer_has_none():
    assert split_layer("a.gpkg")[1] is None


# Odd geometry and odd labels in files


def test_bad_geometry_is_repaired_or_left_out_by_row(geojson):
    footprints = rb.read_footprints(
        geojson(
            ({"type": "Polygon", "coordinates": [RING[:-1]]}, {}),
            ({"type": "Polygon", "coordinates": [[[0, 0], [1, 1]]]}, {}),
            (None, {}),
            ({"type": "Polygon", "coordinates": []}, {}),
            ({"type": "Point", "coordinates": [1, 2]}, {}),
            ({"type": "LineString", "coordinates": [[1, 2], [3, 4]]}, {}),
            (POLYGON, {}),
        )
    )
    assert footprints.ids.tolist() == [0, 6]
    printed = [str(repair) for repair in footprints.repairs]
    assert printed[0] == "feature 0: a ring that is not closed: repaired"
    assert [repair.id for repair in footprints.repairs] == [0, 1, 2, 3, 4, 5]
    assert all(repair.action == "left out" for repair in footprints.repairs[1:])


@pytest.mark.parametrize(
    ("labels", "groups"),
    [
        (["x", None, "", "x"], [0, 1, 2, 0]),
        ([1, None, 1, 2], [0, 1, 0, 2]),
        ([1, "1", 2.5, None], [0, 0, 1, 2]),
        ([True, False, True, True], [0, 1, 0, 0]),
        ([[1], [2], [1], None], [0, 1, 0, 2]),
    ],
)
def test_rows_without_a_label_are_their_own_building(geojson, labels, groups):
    path = geojson(*[(POLYGON, {"b": label}) for label in labels])
    codes = rb.read_footprints(path, building_id="b").building_codes
    assert [codes.tolist().index(code) for code in codes] == [groups.index(group) for group in groups]


def test_whole_numbers_with_gaps_stay_whole(geojson):
    path = geojson((POLYGON, {"b": 12}), (POLYGON, {"b": None}))
    assert rb.read_footprints(path, building_id="b").building_ids.tolist() == ["12", "(row 1)"]


def test_an_unknown_column_is_answered_with_the_nearest(geojson):
    with pytest.raises(InputError, match=r"no column 'bag' \(did you mean 'bag_'\?\); it has bag_, other"):
        rb.read_footprints(geojson((POLYGON, {"bag_": 1, "other": 2})), building_id="bag")


# CRS


def test_a_geojson_in_metres_that_names_no_crs_has_none(geojson):
    assert rb.read_footprints(geojson((POLYGON, {}), crs=None)).crs is None
    assert rb.read_footprints(geojson((POLYGON, {}), crs=None), crs=CRS).crs == CRS


def test_a_geojson_in_degrees_is_refused_or_transformed(geojson):
    degrees = {"type": "Polygon", "coordinates": [[[4.36, 52.0], [4.361, 52.0], [4.361, 52.001], [4.36, 52.0]]]}
    with pytest.raises(CRSError, match=r"in\.geojson: EPSG:4326 is geographic \(degrees\)"):
        rb.read_footprints(geojson((degrees, {}), crs=None))
    transformed = rb.read_footprints(geojson((degrees, {}), crs=None), to_crs=CRS)
    assert transformed.crs == CRS
    assert transformed.areas[0] == pytest.approx(0.5 * 68.7 * 111.3, rel=0.01)  # half a thousandth of a degree squared


def test_an_empty_geojson_has_no_crs_and_is_no_error(geojson):
    assert len(rb.read_footprints(geojson(crs=None))) == 0


def test_a_transformation_keeps_x_before_y(geojson):
    there = rb.read_footprints(geojson((POLYGON, {})), to_crs="EPSG:25831")
    xmin, ymin, _, _ = shapely.total_bounds(there.polygons)
    assert 5e5 < xmin < 7e5
    assert 5.7e6 < ymin < 5.8e6


def test_coordinates_in_another_crs_than_named_are_refused(geojson):
    nonsense = {"type": "Polygon", "coordinates": [[[4, 89], [5, 89], [5, 95], [4, 89]]]}
    with pytest.raises(CRSError, match="cannot be transformed"):
        rb.read_footprints(geojson((nonsense, {}), crs="EPSG:4258"), to_crs=CRS)


@pytest.mark.parametrize("crs", ["EPSG:2263", "EPSG:4326"])
def test_other_units_than_metres_are_refused(tmp_path, crs):
    pyogrio.write_dataframe(_frame(crs), tmp_path / "feet.gpkg")
    with pytest.raises(CRSError, match=r"feet\.gpkg: .*metres"):
        rb.read_footprints(tmp_path / "feet.gpkg")


def _frame(crs):
    import geopandas

    return geopandas.GeoDataFrame(geometry=[box(4, 50, 5, 51)], crs=crs)


# What cannot be read or written


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("no.gpkg", None, "no such file"),
        ("text.gpkg", "hello", "cannot be read as a vector file"),
        ("empty.geojson", "", "cannot be read as a vector file"),
        ("broken.geojson", '{"type":', "cannot be read as a vector file"),
        ("table.csv", "a,b\n1,2\n", "has no geometry"),
        ("text.parquet", "hello", "cannot be read as GeoParquet"),
    ],
)
def test_a_file_that_is_no_vector_file_is_refused_in_one_line(tmp_path, name, content, message):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=message) as caught:
        rb.read_footprints(tmp_path / name)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_table_in_parquet_is_no_footprints(tmp_path):
    pd.DataFrame({"a": [1]}).to_parquet(tmp_path / "table.parquet")
    with pytest.raises(InputError, match="Missing geo metadata"):
        rb.read_footprints(tmp_path / "table.parquet")


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(InputError, match="is a folder: name a vector file"):
        rb.read_footprints(tmp_path)


def test_a_layer_without_polygons_is_refused(geojson):
    with pytest.raises(InputError, match="no polygons among 1 feature"):
        rb.read_footprints(geojson(({"type": "Point", "coordinates": [1, 2]}, {})))


def test_nothing_is_replaced_or_left_half_written(tmp_path):
    footprints = rb.Footprints.of(SQUARES, crs=CRS)
    rb.write_footprints(footprints, tmp_path / "out.gpkg")
    with pytest.raises(OutputError, match="exists already: set overwrite=True"):
        rb.write_footprints(footprints, tmp_path / "out.gpkg")
    complex_column = rb.Footprints.of(SQUARES, crs=CRS, attributes={"c": np.array([1j, 2, 3])})
    before = (tmp_path / "out.gpkg").read_bytes()
    with pytest.raises(OutputError, match=r"the column 'c' holds complex128"):
        rb.write_footprints(complex_column, tmp_path / "out.gpkg", overwrite=True)
    assert (tmp_path / "out.gpkg").read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["out.gpkg"]
    rb.write_footprints(footprints.take(np.array([0])), tmp_path / "out.gpkg", overwrite=True)
    assert len(rb.read_footprints(tmp_path / "out.gpkg")) == 1


def test_a_shapefile_is_replaced_with_its_side_files(tmp_path):
    rb.write_footprints(rb.Footprints.of(SQUARES, crs=CRS, attributes={"a": [1, 2, 3]}), tmp_path / "out.shp")
    rb.write_footprints(rb.Footprints.of(SQUARES[:1], crs=CRS), tmp_path / "out.shp", overwrite=True)
    assert len(rb.read_footprints(tmp_path / "out.shp")) == 1


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("out.gpk", r"unknown file ending '\.gpk' \(did you mean '\.gpkg'\?\)"),
        ("out", "unknown file ending ''"),
        ("no/out.gpkg", "there is no folder"),
    ],
)
def test_a_file_that_cannot_be_written_is_reported(tmp_path, name, message):
    with pytest.raises(OutputError, match=message):
        rb.write_footprints(rb.Footprints.of(SQUARES, crs=CRS), tmp_path / name)


def test_an_unknown_crs_is_refused_before_writing(tmp_path):
    with pytest.raises(CRSError, match="'EPSG:999999' is not a coordinate reference system"):
        rb.write_footprints(rb.Footprints.of(SQUARES, crs="EPSG:999999"), tmp_path / "out.gpkg")


def test_a_shapefile_without_its_projection_has_no_crs(tmp_path):
    rb.write_footprints(rb.Footprints.of(SQUARES, crs=CRS), tmp_path / "out.shp")
    (tmp_path / "out.prj").unlink()
    assert rb.read_footprints(tmp_path / "out.shp").crs is None
    (tmp_path / "out.shx").unlink()
    shutil.rmtree(tmp_path / "none", ignore_errors=True)
    with pytest.raises(InputError, match=r"out\.shp: its index \(out\.shx\) is missing: .* SHAPE_RESTORE_SHX"):
        rb.read_footprints(tmp_path / "out.shp")


def test_geojson_in_metres_with_heights_and_without_a_crs_is_read(tmp_path):
    ring = [[500_000, 5_700_000, 7], [500_010, 5_700_000, 7], [500_010, 5_700_010, 7], [500_000, 5_700_000, 7]]
    feature = {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    file = tmp_path / "roofs.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    found = rb.read_footprints(file)
    assert found.crs is None
    assert found.areas == pytest.approx([50.0])


# Names that GDAL's wrappers would change


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("name", ["a!b", "a\nb", "a;b", "zip:a", " a", "a\udcff"])
def test_files_and_folders_of_any_name_are_written_and_read_where_they_are(tmp_path, monkeypatch, ending, name):
    folder = tmp_path / f"folder {name}"
    folder.mkdir()
    monkeypatch.chdir(folder)
    footprints = rb.Footprints.of(SQUARES, crs=CRS, building_ids=["x", "y", "x"])
    for path in (f"{name}.{ending}", folder / f"second {name}.{ending}"):
        after = there_and_back(footprints, path)
        assert shapely.equals(after.polygons, footprints.polygons).all()
        assert after.building_ids.tolist() == ["x", "y", "x"]
    stems = {item.name.partition(f"{name}.")[0] for item in folder.iterdir()}
    assert stems == {"", "second "}


# Geometry types that pyogrio or GEOS do not name


@pytest.mark.parametrize(("z", "m"), [(1, 0), (0, 1), (1, 1), (2, 2)])
def test_a_layer_of_any_geometry_with_heights_or_measures_is_read(tmp_path, z, m):
    path = tmp_path / "any.gpkg"
    rb.write_footprints(rb.Footprints.of(SQUARES, crs=CRS, building_ids=[3, 3, 4]), path)
    with contextlib.closing(sqlite3.connect(path)) as db:
        db.execute("UPDATE gpkg_geometry_columns SET geometry_type_name = 'GEOMETRY', z = ?, m = ?", (z, m))
        db.commit()
    after = rb.read_footprints(path)
    assert shapely.equals(after.polygons, SQUARES).all()
    assert (after.crs, after.building_ids.tolist()) == (CRS, [3, 3, 4])


def surface(code, faces, *, order="<", axes=3):
    """WKB of a surface of triangles; `faces` are arrays of closed rings."""
    mark = struct.pack("B", order == "<")
    face = {1016: 1017, 1015: 1003}[code]
    parts = [
        mark + struct.pack(f"{order}III", face, 1, len(ring)) + struct.pack(f"{order}{3 * len(ring)}d", *ring.ravel())
        for ring in faces
    ]
    return mark + struct.pack(f"{order}II", code, len(parts)) + b"".join(parts)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("code", [1015, 1016], ids=["polyhedral surface", "TIN"])
def test_the_footprint_of_a_surface_is_the_union_of_its_faces(tmp_path, code, order):
    a, b, c, d = ([85000.0 + x, 447000.0 + y, 5.0] for x, y in ((0, 0), (10, 0), (10, 8), (0, 8)))
    low = [85000.0, 447000.0, 0.0]
    faces = [np.array(ring) for ring in ([a, b, c, a], [a, c, d, a], [low, a, d, low])]  # the last one is a wall
    single = surface(code, faces, order=order)
    nested = struct.pack("<BII", 1, 1007, 1) + struct.pack("<BII", 1, 1007, 1) + single
    geometries, closed = geometries_of_wkb(np.array([single, nested], dtype=object), tmp_path / "a.shp")
    footprints = rb.Footprints.of(geometries)
    assert closed == []
    assert footprints.areas == pytest.approx([80.0, 80.0])


def test_collections_nested_to_any_depth_keep_their_polygons():
    geometry = SQUARES[0]
    for _ in range(5):
        geometry = shapely.GeometryCollection([geometry])
    mixed = shapely.GeometryCollection([geometry, shapely.MultiPolygon(SQUARES[1:]), shapely.Point(85000, 447000)])
    footprints = rb.Footprints.of([geometry, shapely.GeometryCollection([mixed])])
    assert footprints.areas.tolist() == [100.0, 300.0]


def test_an_impossible_date_loses_its_own_value_only(tmp_path):
    path = tmp_path / "dates.shp"
    dates = np.array(["2020-01-01", "2020-01-02", "2020-01-03"], dtype="datetime64[D]")
    rb.write_footprints(rb.Footprints.of(SQUARES, crs=CRS, attributes={"built": dates, "n": [7, 8, 9]}), path)
    table = path.with_suffix(".dbf")
    content = table.read_bytes()
    place = content.index(b"20200102")
    table.write_bytes(content[:place] + b"20201345" + content[place + 8 :])
    attributes = rb.read_footprints(path).attributes
    assert attributes["n"].tolist() == [7, 8, 9]
    assert attributes["built"].astype("datetime64[D]").astype(str).tolist() == ["2020-01-01", "NaT", "2020-01-03"]


def test_a_text_of_another_encoding_changes_no_other_text(tmp_path):
    path = tmp_path / "names.gpkg"
    rb.write_footprints(rb.Footprints.of(SQUARES, crs=CRS, attributes={"name": ["Bühne", "K_nig", "x"]}), path)
    path.write_bytes(path.read_bytes().replace(b"K_nig", b"K\xf6nig"))
    assert rb.read_footprints(path).attributes["name"].tolist() == ["Bühne", "König", "x"]
