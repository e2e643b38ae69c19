"""Properties of vector files of others: cut off, impossible dates, degrees with latitude first, lines of JSON."""

import json
import sqlite3
import struct
from contextlib import closing

import numpy as np
import pyogrio.raw
import pytest
import shapely

from roofbench.core.errors import CRSError, InputError
from roofbench.scenes.geodata.footprint_stream import open_stream
from roofbench.scenes.geodata.footprints import Footprints
from roofbench.scenes.geodata.vector_files import read_footprints, write_footprints
from roofbench.scenes.geodata.wkb import geometries_of_wkb

SQUARES = shapely.box([500000, 500020, 500040], [0, 0, 0], [500010, 500030, 500050], [10, 10, 10])


def shapefile(path, **columns):
    pyogrio.raw.write(
        path,
        geometry=shapely.to_wkb(SQUARES),
        field_data=list(columns.values()),
        fields=np.array(list(columns), dtype=object),
        driver="ESRI Shapefile",
        geometry_type="Polygon",
        crs="EPSG:25832",
    )
    return path


def collection(squares):
    features = [{"type": "Feature", "properties": {}, "geometry": shapely.geometry.mapping(one)} for one in squares]
    return {"type": "FeatureCollection", "features": features}


@pytest.mark.parametrize("share", [0.3, 0.6, 0.99])
def test_a_shapefile_that_is_cut_off_is_refused(tmp_path, share):
    file = shapefile(tmp_path / "a.shp", number=np.arange(3))
    assert len(read_footprints(file)) == 3
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    with pytest.raises(InputError, match="is truncated"):
        read_footprints(file)


@pytest.mark.parametrize("value", [b"20200100", b"20201301", b"00000101", b"********"])
def test_dates_that_are_no_day_cost_their_column_and_no_footprint(tmp_path, value):
    file = shapefile(tmp_path / "a.shp", number=np.arange(3), built=np.array(["2020-01-02"] * 3, dtype="datetime64[D]"))
    table = file.with_suffix(".dbf")
    assert b"20200102" in table.read_bytes()
    table.write_bytes(table.read_bytes().replace(b"20200102", value, 1))
    found = read_footprints(file)
    assert len(found) == 3
    assert found.attributes["number"].tolist() == [0, 1, 2]


def test_degrees_with_latitude_first_are_refused(tmp_path):
    sydney = shapely.box([-33.861, -33.863], [151.2, 151.201], [-33.860, -33.862], [151.2001, 151.2011])
    (tmp_path / "a.geojson").write_text(json.dumps(collection(sydney)))
    with pytest.raises(CRSError, match="latitude first"):
        read_footprints(tmp_path / "a.geojson")


def test_json_by_lines_has_the_same_crs_as_in_one_piece(tmp_path):
    document = collection(SQUARES)
    (tmp_path / "a.geojson").write_text(json.dumps(document))
    (tmp_path / "a.geojsonl").write_text("\n".join(map(json.dumps, document["features"])) + "\n")
    for name in ("a.geojson", "a.geojsonl"):
        found = read_footprints(tmp_path / name)
        assert found.crs is None
        assert len(found) == 3


def test_a_sound_shapefile_announces_its_size(tmp_path):
    write_footprints(Footprints.of(SQUARES, crs="EPSG:25832"), tmp_path / "a.shp")
    content = (tmp_path / "a.shp").read_bytes()
    assert 2 * struct.unpack_from(">i", content, 24)[0] == len(content)


def test_a_ring_of_geoparquet_that_is_not_closed_is_closed_and_reported(tmp_path):
    geopandas = pytest.importorskip("geopandas")
    pq, pa = pytest.importorskip("pyarrow.parquet"), pytest.importorskip("pyarrow")
    file = tmp_path / "a.parquet"
    geopandas.GeoDataFrame({"number": [1, 2, 3]}, geometry=list(SQUARES), crs="EPSG:25832").to_parquet(file)
    table = pq.read_table(file)
    wkb = table["geometry"].to_pylist()
    # One vertex less: the number of points of the ring follows byte order, type and number of rings.
    open_ring = wkb[1][:9] + struct.pack("<I", 4) + wkb[1][13:-16]
    for broken, sound in ((open_ring, True), (wkb[1][:-7], False)):
        column = pa.array([wkb[0], broken, wkb[2]])
        changed = table.set_column(table.schema.get_field_index("geometry"), table.schema.field("geometry"), column)
        pq.write_table(changed, file)
        if sound:
            found = read_footprints(file)
            assert len(found) == 3
            assert shapely.area(found.polygons).tolist() == [100, 100, 100]
            assert found.crs == "EPSG:25832"
            assert [str(repair) for repair in found.repairs] == ["feature 1: a ring that is not closed: repaired"]
        else:
            with pytest.raises(InputError, match="the geometry of feature 1 is damaged"):
                read_footprints(file)


def in_degrees(count=5, west=8.4, south=49.0):
    """Return squares of 1e-4 degrees, as houses are."""
    return [shapely.box(west + i * 2e-4, south, west + i * 2e-4 + 1e-4, south + 1e-4) for i in range(count)]


@pytest.mark.parametrize(
    ("written", "crs", "message"),
    [
        ({}, "EPSG:25832", "are degrees, not metres"),
        ({"crs": None}, None, "is geographic"),
        ({"meta": {"crs": None}}, None, "is geographic"),
        ({"crs": {"type": "name", "properties": {"name": "EPSG:25832"}}}, None, "are degrees, not metres"),
    ],
    ids=["metres given", "none", "none of another member", "metres named"],
)
@pytest.mark.parametrize("stray", [(), (shapely.box(5e5, 5.5e6, 5.1e5, 5.51e6),)], ids=["", "one in metres"])
def test_degrees_are_never_scored_as_metres(tmp_path, written, crs, message, stray):
    features = collection([*in_degrees(), *stray])["features"]
    file = tmp_path / "a.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features, **written}))
    with pytest.raises(CRSError, match=message):
        read_footprints(file, crs=crs)


def test_a_member_that_says_no_crs_counts_wherever_it_stands(tmp_path):
    features = collection([shapely.box(0, 0, 10, 10)])["features"]
    file = tmp_path / "a.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "pad": "x" * 9000, "features": features, "crs": None}))
    assert read_footprints(file).crs is None


@pytest.mark.parametrize("name", ["EPSG:99999999", "urn:ogc:def:crs:EPSG::258320", "my city"])
def test_a_named_crs_that_is_not_known_is_refused(tmp_path, name):
    """GDAL says of such a file that it is in degrees, as of one without a CRS."""
    features = collection([shapely.box(5e5, 5.4e6, 5e5 + 10, 5.4e6 + 10)])["features"]
    file = tmp_path / "a.geojson"
    member = {"type": "name", "properties": {"name": name}}
    file.write_text(json.dumps({"type": "FeatureCollection", "crs": member, "features": features}))
    with pytest.raises(CRSError, match=f"its CRS '{name}' is not known"):
        read_footprints(file)
    assert read_footprints(file, crs="EPSG:25832").crs == "EPSG:25832"


def test_degrees_in_other_formats_are_refused(tmp_path):
    write_footprints(Footprints.of(in_degrees(), crs="EPSG:25832"), tmp_path / "a.gpkg")
    with pytest.raises(CRSError, match="are degrees, not metres"):
        read_footprints(tmp_path / "a.gpkg")
    with pytest.raises(CRSError, match="are degrees, not metres"):
        open_stream(tmp_path / "a.gpkg")


@pytest.mark.parametrize(
    ("part", "place", "value", "message"),
    [
        (".dbf", 4, struct.pack("<I", 2), r"table \(.dbf\) has 2 rows for 3 outlines"),
        (".shx", 116, None, r"index \(.shx\) of 2 rows ends at byte 372 of 508"),
        (".shx", 108, struct.pack(">I", 7), "1 outline is damaged .* feature 1"),
        (".shp", 280, struct.pack("<I", 999), "1 outline is damaged .* feature 1"),
    ],
    ids=["rows of the table", "rows of the index", "place", "number of points"],
)
def test_parts_of_a_shapefile_that_do_not_belong_together_lose_no_outline(tmp_path, part, place, value, message):
    file = shapefile(tmp_path / "a.shp", n=np.arange(3))
    content = bytearray(file.with_suffix(part).read_bytes())
    if value is None:
        del content[place:]
        struct.pack_into(">I", content, 24, len(content) // 2)
    else:
        content[place : place + len(value)] = value
    file.with_suffix(part).write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_footprints(file)


def test_a_row_without_outline_is_left_out_of_a_shapefile_and_reported(tmp_path):
    file = shapefile(tmp_path / "a.shp", n=np.arange(3))
    content = bytearray(file.read_bytes())
    struct.pack_into("<I", content, 244, 0)
    file.write_bytes(content)
    footprints = read_footprints(file)
    assert len(footprints) == 2
    assert [str(repair) for repair in footprints.repairs] == ["feature 1: no geometry: left out"]


def test_a_flatgeobuf_that_is_cut_off_loses_no_row_in_silence(tmp_path):
    file = tmp_path / "a.fgb"
    write_footprints(Footprints.of(SQUARES, crs="EPSG:25832"), file)
    whole = file.read_bytes()
    indexed = tmp_path / "b.fgb"
    pyogrio.raw.write(
        indexed, shapely.to_wkb(SQUARES), field_data=[], fields=[], geometry_type="Polygon", crs="EPSG:25832"
    )
    for content in (whole, indexed.read_bytes()):
        for share in (0.6, 0.75, 0.9):
            file.write_bytes(content[: int(share * len(content))])
            for read in (read_footprints, lambda path: list(open_stream(path).outlines())):
                with pytest.raises(InputError, match=r"truncated|cannot be read|no layers"):
                    read(file)


def described(path, **changes):
    """Write GeoParquet whose description of the geometry, or of the file, is changed."""
    import pyarrow.parquet

    write_footprints(Footprints.of(SQUARES, crs="EPSG:25832"), path)
    table = pyarrow.parquet.read_table(path)
    facts = json.loads(table.schema.metadata[b"geo"])
    for name, value in changes.items():
        (facts if name in facts else facts["columns"]["geometry"])[name] = value
    pyarrow.parquet.write_table(table.replace_schema_metadata({b"geo": json.dumps(facts).encode()}), path)
    return path


@pytest.mark.parametrize("crs", [{"type": "ProjectedCRS"}, "EPSG:999999", "local"])
def test_a_crs_of_geoparquet_that_cannot_be_read_is_replaced_by_the_one_that_is_given(tmp_path, crs):
    file = described(tmp_path / "a.parquet", crs=crs)
    with pytest.raises(CRSError, match="name the CRS by crs="):
        read_footprints(file)
    assert len(read_footprints(file, crs="EPSG:25832")) == 3


@pytest.mark.parametrize("changes", [{"primary_column": "geom"}, {"columns": {}}, {"columns": 3}, {"encoding": "WKX"}])
def test_geoparquet_that_describes_something_else_is_refused(tmp_path, changes):
    with pytest.raises(InputError, match="cannot be read as GeoParquet"):
        read_footprints(described(tmp_path / "a.parquet", **changes))


@pytest.mark.parametrize(
    "change",
    [*(lambda blob, size=size: blob[:size] for size in (0, 1, 5, 40, -1)), lambda blob: b"garbage"],
)
def test_an_outline_of_geoparquet_that_is_damaged_is_not_left_out(tmp_path, change):
    import pyarrow
    import pyarrow.parquet

    file = described(tmp_path / "a.parquet")
    table = pyarrow.parquet.read_table(file)
    blobs = [one.as_py() for one in table["geometry"]]
    blobs[1] = change(blobs[1])
    place = table.column_names.index("geometry")
    changed = table.set_column(place, "geometry", pyarrow.array(blobs))
    pyarrow.parquet.write_table(changed, file)
    for read in (read_footprints, lambda path: list(open_stream(path).outlines())):
        with pytest.raises(InputError, match="the geometry of feature 1 is damaged"):
            read(file)


def test_geoparquet_with_text_for_wkb_is_refused(tmp_path):
    import pyarrow
    import pyarrow.parquet

    file = described(tmp_path / "a.parquet")
    table = pyarrow.parquet.read_table(file)
    texts = pyarrow.array([one.wkt for one in SQUARES])
    changed = table.set_column(table.column_names.index("geometry"), "geometry", texts)
    pyarrow.parquet.write_table(changed, file)
    for read in (read_footprints, lambda path: list(open_stream(path).outlines())):
        with pytest.raises(InputError):
            read(file)


def test_a_column_of_geoparquet_that_cannot_be_converted_is_left_out(tmp_path):
    import pyarrow.parquet

    file = described(tmp_path / "a.parquet")
    table = pyarrow.parquet.read_table(file)
    far = pyarrow.array([-1_000_000_000] * 3, pyarrow.date32())
    pyarrow.parquet.write_table(table.append_column("far", far).append_column("n", pyarrow.array([1, 2, 3])), file)
    footprints = read_footprints(file)
    assert len(footprints) == 3
    assert footprints.attributes["n"].tolist() == [1, 2, 3]


@pytest.mark.parametrize("name", ["-dash", "[1]", "~t", "$HOME", "_a", "1"])
def test_a_geopackage_may_have_any_first_letter(tmp_path, name):
    file = tmp_path / f"{name}.gpkg"
    write_footprints(Footprints.of(SQUARES, crs="EPSG:25832"), file)
    assert len(read_footprints(file)) == 3


def geopackage_with(path, row, change):
    """Write twelve squares as a GeoPackage and change the geometry of one row."""
    write_footprints(Footprints.of(list(SQUARES) * 4, crs="EPSG:25832"), path)
    with closing(sqlite3.connect(path)) as database:
        database.create_function("changed", 1, change)
        for trigger in database.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            database.execute(f'DROP TRIGGER "{trigger[0]}"')
        database.execute(f'UPDATE "{path.stem}" SET geom = changed(geom) WHERE fid = {row}')
        database.commit()
    return path


@pytest.mark.parametrize(
    "change",
    [
        *(lambda blob, size=size: blob[:size] for size in (0, 1, 8, 45, -1)),
        lambda blob: b"XX" + blob[2:],
        lambda blob: "POLYGON ((0 0, 1 0, 1 1, 0 0))",
        lambda blob: 7,
    ],
)
def test_an_outline_of_a_geopackage_that_is_damaged_is_not_left_out(tmp_path, change):
    path = geopackage_with(tmp_path / "cut.gpkg", 4, change)
    with pytest.raises(InputError, match=r"1 outline is damaged \(the first is feature 3\)"):
        read_footprints(path)
    with pytest.raises(InputError, match=r"(1 outline is|feature 3 is) damaged"):
        list(open_stream(path).outlines())


def test_a_row_of_a_geopackage_without_outline_is_left_out_and_reported(tmp_path):
    found = read_footprints(geopackage_with(tmp_path / "none.gpkg", 4, lambda blob: None))
    assert len(found) == 11
    assert [(repair.id, repair.problem) for repair in found.repairs] == [(3, "no geometry")]


@pytest.mark.parametrize("coordinates", ["text", [[[0, 0], [1]]], [[["0", "0"], ["1", "0"], ["1", "1"], ["0", "0"]]]])
def test_an_outline_of_json_that_is_damaged_is_not_left_out(tmp_path, coordinates):
    path = tmp_path / "text.geojson"
    whole = collection(SQUARES)
    whole["features"][1]["geometry"]["coordinates"] = coordinates
    path.write_text(json.dumps(whole))
    with pytest.raises(InputError, match=r"1 outline is damaged \(the first is feature 1\)"):
        read_footprints(path, crs="EPSG:25832")


def test_an_index_that_announces_fewer_outlines_than_there_are_loses_none(tmp_path):
    path = shapefile(tmp_path / "index.shp")
    index = bytearray(path.with_suffix(".shx").read_bytes())
    index[24:28] = (54).to_bytes(4, "big")
    path.with_suffix(".shx").write_bytes(bytes(index))
    with pytest.raises(InputError, match="announces 1, so outlines would be missing"):
        read_footprints(path)


def test_a_crs_that_ends_early_is_replaced_by_the_one_that_is_given(tmp_path):
    path = shapefile(tmp_path / "crs.shp")
    path.with_suffix(".prj").write_text('GEOGCS["x"')
    assert read_footprints(path, crs="EPSG:25832").crs == "EPSG:25832"


@pytest.mark.parametrize("member", [5, "a", None, [1], {}, {"type": "Polygon", "coordinates": []}])
@pytest.mark.parametrize("place", [0, 1, 3])
def test_a_member_of_json_that_is_no_feature_is_not_left_out(tmp_path, member, place):
    path = tmp_path / "a.geojson"
    whole = collection(SQUARES)
    whole["features"][1]["properties"] = {"list": [{"a": 1}, 5, "b"], "features": [1]}
    path.write_text(json.dumps(whole))
    assert len(read_footprints(path, crs="EPSG:25832")) == 3  # such properties are no members
    whole["features"].insert(place, member)
    path.write_text(json.dumps(whole))
    with pytest.raises(InputError, match=rf"1 member is not a feature \(the first is member {place}\)"):
        read_footprints(path, crs="EPSG:25832")


@pytest.mark.parametrize(
    "change",
    [
        lambda lines: [lines[0], lines[1][:50], lines[2]],
        lambda lines: [lines[0], "5", *lines[1:]],
        lambda lines: [lines[0] + lines[1], lines[2]],
        lambda lines: [lines[0], "", "\x1e" + lines[1], lines[2]],
    ],
    ids=["cut", "a number", "two in a line", "separators in part"],
)
def test_a_line_of_json_that_is_no_feature_is_not_left_out(tmp_path, change):
    path = tmp_path / "a.geojsonl"
    lines = [json.dumps(feature) for feature in collection(SQUARES)["features"]]
    path.write_text("\n".join(lines))
    assert len(read_footprints(path, crs="EPSG:25832")) == 3
    path.write_text("\n".join(change(lines)))
    with pytest.raises(InputError, match=r"1 line is not a feature|of its 3 lines can be read"):
        read_footprints(path, crs="EPSG:25832")


@pytest.mark.parametrize("size", [3, 8, 20, 100])
def test_a_flatgeobuf_that_ends_inside_its_header_is_refused(tmp_path, size):
    write_footprints(Footprints.of(SQUARES, crs="EPSG:25832"), tmp_path / "a.fgb")
    (tmp_path / "b.fgb").write_bytes((tmp_path / "a.fgb").read_bytes()[:size])
    with pytest.raises(InputError, match=f"is truncated: it has {size} bytes and ends inside its header"):
        read_footprints(tmp_path / "b.fgb")


def test_a_curve_of_geoparquet_is_refused_by_its_feature(tmp_path):
    curve = struct.pack("<BII", 1, 10, 0)  # an empty curve polygon
    with pytest.raises(InputError, match="the outline of feature 1 is a curve: convert it to straight lines"):
        geometries_of_wkb(np.array([shapely.to_wkb(SQUARES[0]), curve], dtype=object), tmp_path / "a.parquet")
