"""Properties of point files of others: stale headers, unreadable CRS records, feet by code, mixed colours."""

import struct

import laspy
import lazrs
import numpy as np
import pyproj
import pytest
from laspy.vlrs.known import GeoKeyEntryStruct, WktCoordinateSystemVlr

from roofbench.core.errors import CRSError, InputError
from roofbench.scenes.geodata.coloured_points import image_from_points
from roofbench.scenes.geodata.las_files import read_las_header, read_points
from roofbench.scenes.geodata.point_chunks import chunk_size

WEST, SOUTH = 500000.0, 5500000.0


def write(path, *, crs="EPSG:25832", wkt=None, keys=(), version="1.4", west=WEST, colour=None, withheld=False):
    """Write points every metre over 20 m x 20 m, laid out from `west`."""
    header = laspy.LasHeader(version=version, point_format=(6 if version == "1.4" else 1) if colour is None else 7)
    header.scales, header.offsets = np.full(3, 0.001), np.array([west, SOUTH, 0.0])
    if wkt is not None:
        header.vlrs.append(WktCoordinateSystemVlr(wkt))
        header.global_encoding.wkt = True
    elif crs is not None:
        header.add_crs(pyproj.CRS.from_user_input(crs))
    for key, value in keys:
        record = header.vlrs.get("GeoKeyDirectoryVlr")[0]
        record.geo_keys.append(GeoKeyEntryStruct(key, 0, 1, value))
        record.geo_keys_header.number_of_keys = len(record.geo_keys)
    x, y = (values.ravel() for values in np.meshgrid(np.arange(0.5, 20), np.arange(0.5, 20)))
    points = laspy.ScaleAwarePointRecord.zeros(len(x), header=header)
    points.x, points.y, points.z = west + x, SOUTH + y, np.full(len(x), 100.0)
    points.return_number[:] = 1
    points.number_of_returns[:] = 1
    if colour is not None:
        points.red, points.green, points.blue = (np.full(len(x), value) for value in colour)
    if withheld:
        points.withheld[:] = 1
    data = laspy.LasData(header)
    data.points = points
    data.write(path)
    return path


def with_bounds(path, xmax, xmin):
    """Overwrite the bounds in x of a header."""
    content = bytearray(path.read_bytes())
    struct.pack_into("<2d", content, 179, xmax, xmin)
    path.write_bytes(content)
    return path


def test_points_outside_the_bounds_of_their_header_are_not_dropped_silently(tmp_path):
    stale = with_bounds(write(tmp_path / "a.las"), WEST + 10, WEST)
    with pytest.raises(InputError, match=r"200 points lie outside the bounds in its header .* write the header anew"):
        read_points(stale, window=(WEST, SOUTH, WEST + 10, SOUTH + 20))
    sound = write(tmp_path / "b.las")
    assert len(read_points(sound, window=(WEST, SOUTH, WEST + 10, SOUTH + 20))) == 200


def test_bounds_of_zero_are_refused(tmp_path):
    zero = write(tmp_path / "a.las")
    content = bytearray(zero.read_bytes())
    struct.pack_into("<6d", content, 179, *np.zeros(6))
    zero.write_bytes(content)
    with pytest.raises(InputError, match="bounds in its header are all 0"):
        read_las_header(zero)


@pytest.mark.parametrize("wkt", ['PROJCS["broken', "+proj=utm +zone=32 +ellps=GRS80 +units=m"])
def test_a_crs_record_that_cannot_be_read_is_replaced_by_the_one_that_is_given(tmp_path, wkt):
    file = write(tmp_path / "a.las", wkt=wkt)
    with pytest.raises(CRSError, match="cannot be read"):
        read_las_header(file)
    assert read_las_header(file, fallback="EPSG:25832").crs == "EPSG:25832"
    assert read_las_header(write(tmp_path / "b.las"), fallback="EPSG:25833").crs == "EPSG:25832"


@pytest.mark.parametrize(("code", "unit"), [(6360, "US survey foot"), (8228, "foot")])
def test_a_vertical_system_in_feet_is_refused_by_its_code_alone(tmp_path, code, unit):
    file = write(tmp_path / "a.las", crs="EPSG:26917", version="1.2", keys=[(4096, code)])
    with pytest.raises(CRSError, match=f"heights are in {unit}, metres are needed"):
        read_las_header(file)


def test_a_vertical_system_in_metres_passes_and_so_does_one_that_is_not_registered(tmp_path):
    for code in (5703, 5783, 32767):
        file = write(tmp_path / f"{code}.las", crs="EPSG:26917", version="1.2", keys=[(4096, code)])
        assert read_las_header(file).crs == "EPSG:26917"


def test_colours_of_8_bit_are_stretched_file_by_file(tmp_path):
    wide = write(tmp_path / "w.las", colour=(200 * 257, 100 * 257, 50 * 257))
    narrow = write(tmp_path / "e.las", west=WEST + 20, colour=(200, 100, 50))
    for order in ([wide, narrow], [narrow, wide], [narrow]):
        cloud = read_points(order)
        assert np.unique(cloud.colour, axis=0).tolist() == [[200 * 257, 100 * 257, 50 * 257]]


@pytest.mark.parametrize("narrow", [1, 40, 200, 397, 400])
def test_colours_of_8_and_16_bit_are_mixed_inside_a_file(tmp_path, narrow):
    path = write(tmp_path / "mixed.las", colour=(200, 100, 50))
    data = laspy.read(path)
    wide = np.arange(400) >= narrow
    for name in ("red", "green", "blue"):
        data[name] = np.where(wide, 257 * np.asarray(data[name]), data[name]).astype(np.uint16)
    data.write(path)
    found = np.unique(read_points([path]).colour, axis=0).tolist()
    # A single dark point of 400 may be black paint.
    assert found[-1] == [200 * 257, 100 * 257, 50 * 257]
    assert len(found) == (2 if narrow == 1 else 1)


def test_dark_colours_of_16_bit_are_not_stretched(tmp_path):
    path = write(tmp_path / "dark.las", colour=(1, 1, 1))
    data = laspy.read(path)
    for name in ("red", "green", "blue"):
        data[name] = np.arange(400, dtype=np.uint16) * 4
    data.write(path)
    assert read_points([path]).colour.max() == 1596


@pytest.mark.parametrize(
    ("version", "kind"),
    [*(("1.2", kind) for kind in range(4)), ("1.3", 4), ("1.3", 5), *(("1.4", kind) for kind in range(11))],
)
def test_points_of_every_format_are_read(tmp_path, version, kind):
    header = laspy.LasHeader(version=version, point_format=kind)
    header.scales, header.offsets = np.full(3, 0.001), np.array([WEST, SOUTH, 0.0])
    header.add_crs(pyproj.CRS(25832))
    data = laspy.LasData(header)
    data.x, data.y, data.z = WEST + np.arange(30), SOUTH + np.arange(30), np.linspace(100, 110, 30)
    data.classification = np.full(30, 6, dtype=np.uint8)
    data.write(tmp_path / "a.las")
    versions = [version] if kind > 1 or version != "1.2" else ["1.2", "1.1", "1.0"]
    for older in versions:
        content = bytearray((tmp_path / "a.las").read_bytes())
        content[25] = int(older[-1])
        (tmp_path / "a.las").write_bytes(bytes(content))
        cloud = read_points([tmp_path / "a.las"])
        assert np.allclose(cloud.x - WEST, np.arange(30))
        assert np.allclose(cloud.z, np.linspace(100, 110, 30), atol=1e-3)
        assert (cloud.classification == 6).all()


def test_a_tile_without_colour_gives_no_black_image(tmp_path):
    coloured = write(tmp_path / "w.las", colour=(200 * 257, 100 * 257, 50 * 257))
    for bare in (
        write(tmp_path / "e.las", west=WEST + 20),
        write(tmp_path / "f.las", west=WEST + 20, colour=(0, 0, 0)),
    ):
        image = image_from_points(read_points([coloured, bare]), (WEST, SOUTH, WEST + 40, SOUTH + 20), gsd=1.0)
        assert image.valid[:, :20].all()
        assert not image.valid[:, 24:].any()
        assert (image.values[:, image.valid].T == (200, 100, 50)).all()


def test_a_file_of_withheld_points_alone_is_refused_for_that_reason(tmp_path):
    with pytest.raises(InputError, match="all points are flagged as withheld"):
        read_points(write(tmp_path / "a.las", withheld=True))


def test_a_stream_compressed_point_by_point_is_refused_before_it_is_read(tmp_path):
    file = write(tmp_path / "a.laz")
    content = bytearray(file.read_bytes())
    start = content.index(b"laszip encoded")
    # The record begins after its header: user id (16 bytes), number, length, description (32 bytes).
    struct.pack_into("<H", content, start + 16 + 4 + 32, 1)
    file.write_bytes(content)
    with pytest.raises(InputError, match="compressed point by point"):
        read_las_header(file)


@pytest.mark.parametrize("crs", ["EPSG:4978"])
def test_points_in_geocentric_coordinates_are_refused(tmp_path, crs):
    with pytest.raises(CRSError, match="geocentric"):
        read_las_header(write(tmp_path / "a.las", wkt=pyproj.CRS(crs).to_wkt()))


def with_keys(path, keys, numbers=()):
    """Write points with GeoKeys of (id, place of the value, count, value) and numbers for those that need them."""
    directory = struct.pack("<4H", 1, 1, 0, len(keys)) + b"".join(struct.pack("<4H", *key) for key in keys)
    header = laspy.LasHeader(version="1.2", point_format=1)
    header.scales, header.offsets = np.full(3, 0.001), np.array([WEST, SOUTH, 0.0])
    header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "", directory))
    header.vlrs.append(laspy.VLR("LASF_Projection", 34736, "", struct.pack(f"<{len(numbers)}d", *numbers)))
    data = laspy.LasData(header)
    data.x, data.y, data.z = WEST + np.arange(3.0), SOUTH + np.arange(3.0), np.full(3, 100.0)
    data.write(path)
    return path


#: UTM zone 32 north on ETRS89, described by its parameters.
_DESCRIBED = [(1024, 0, 1, 1), (2048, 0, 1, 4258), (3072, 0, 1, 32767), (3075, 0, 1, 1), (3076, 0, 1, 9001)]
_DESCRIBED += [(key, 34736, 1, place) for place, key in enumerate((3080, 3081, 3082, 3083, 3092))]
_ZONE_32 = (9.0, 0.0, 500_000.0, 0.0, 0.9996)


def test_a_user_defined_system_is_read_from_its_parameters(tmp_path):
    for number, keys in enumerate([_DESCRIBED, [(0, 0, 0, 0), *_DESCRIBED]]):
        assert read_las_header(with_keys(tmp_path / f"{number}.las", keys, _ZONE_32)).crs == "EPSG:25832"
    zone_in_feet = [key if key[0] != 3076 else (3076, 0, 1, 9003) for key in _DESCRIBED]
    with pytest.raises(CRSError, match="coordinates are in US survey foot"):
        read_las_header(with_keys(tmp_path / "feet.las", zone_in_feet, _ZONE_32), fallback="EPSG:25832")


@pytest.mark.parametrize(
    ("key", "code", "unit"), [(3076, 9036, "kilometre"), (4099, 9096, "yard"), (4099, 9002, "foot")]
)
def test_any_registered_unit_of_length_but_the_metre_is_refused(tmp_path, key, code, unit):
    keys = [(1024, 0, 1, 1), (3072, 0, 1, 25832), (key, 0, 1, code)]
    with pytest.raises(CRSError, match=f"are in {unit}, metres are needed"):
        read_las_header(with_keys(tmp_path / "a.las", keys))


@pytest.mark.parametrize(
    "keys",
    [
        [(1024, 0, 1, 1), (2048, 0, 1, 4258), (3072, 0, 1, 32767)],
        [(1024, 0, 1, 2), (2048, 0, 1, 4258)],
        [(1024, 0, 1, 1), (3072, 0, 1, 5703)],
    ],
    ids=["user-defined without parameters", "degrees", "heights"],
)
def test_a_record_that_cannot_be_of_the_coordinates_is_replaced_by_the_crs_that_is_given(tmp_path, keys):
    file = with_keys(tmp_path / "a.las", keys)
    with pytest.raises(CRSError, match=r"name the (true )?CRS by crs="):
        read_las_header(file)
    assert read_las_header(file, fallback="EPSG:25832").crs == "EPSG:25832"


def test_a_table_of_chunks_that_needs_more_than_the_file_is_refused_before_memory_is_reserved(tmp_path):
    path = write(tmp_path / "points.laz")
    content = bytearray(path.read_bytes())
    with laspy.open(path) as reader:
        start = reader.header.offset_to_point_data
    place = int.from_bytes(content[start : start + 8], "little")
    many = content[: place + 4] + (2**31).to_bytes(4, "little") + content[place + 8 :]
    outside = content[:start] + (2**40).to_bytes(8, "little") + content[start + 8 :]
    for damaged, reason in ((many, "2147483648 chunks"), (outside, "outside the file")):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=reason):
            read_points(path)


@pytest.mark.parametrize(("announced", "message"), [(0, "announces 0 points"), (150, "announces 150 points")])
def test_points_that_the_header_does_not_count_are_not_dropped_silently(tmp_path, announced, message):
    file = write(tmp_path / "a.las")
    content = bytearray(file.read_bytes())
    struct.pack_into("<Q", content, 247, announced)
    file.write_bytes(content)
    with pytest.raises(InputError, match=f"{message}, and the file holds 400"):
        read_las_header(file)


def test_bounds_that_end_before_they_begin_are_refused(tmp_path):
    file = with_bounds(write(tmp_path / "a.las"), WEST, WEST + 20)
    with pytest.raises(InputError, match="bounds in its header end before they begin"):
        read_las_header(file)


@pytest.mark.parametrize("version", [(0, 9), (1, 5), (2, 0)])
def test_other_versions_of_las_are_refused_by_their_number(tmp_path, version):
    file = write(tmp_path / "a.las", version="1.2")
    content = bytearray(file.read_bytes())
    content[24:26] = bytes(version)
    file.write_bytes(content)
    with pytest.raises(InputError, match=f"is of LAS version {version[0]}.{version[1]}, versions 1.0 to 1.4 are read"):
        read_las_header(file)


def test_chunks_of_varying_numbers_of_points_are_read(tmp_path):
    file = write(tmp_path / "a.las", version="1.2")
    plain = laspy.read(file)
    header = laspy.LasHeader(version="1.2", point_format=plain.header.point_format.id)
    header.scales, header.offsets = plain.header.scales, plain.header.offsets
    record = lazrs.LazVlr.new_for_compression(header.point_format.id, 0, True)
    header.vlrs.append(laspy.vlrs.known.LasZipVlr(record.record_data()))
    header.update(plain.points)
    header.are_points_compressed = True
    rows = np.frombuffer(plain.points.array.tobytes(), np.uint8).reshape(len(plain), -1)
    with (tmp_path / "b.laz").open("wb") as stream:
        header.write_to(stream)
        compressor = lazrs.LasZipCompressor(stream, record)
        for part in np.split(rows, [1, 40, 41, 300]):
            compressor.compress_many(part.ravel())
            compressor.finish_current_chunk()
        compressor.done()
    with laspy.open(tmp_path / "b.laz") as reader:
        assert chunk_size(reader.header) is None
    one, two = read_points(tmp_path / "b.laz"), read_points(file)
    assert (one.x.tolist(), one.z.tolist()) == (two.x.tolist(), two.z.tolist())


@pytest.mark.parametrize(
    "wkt",
    [
        'LOCAL_CS["unnamed",UNIT["foot",0.3048]]',
        'COMPD_CS["x",LOCAL_CS["a",UNIT["metre",1]],VERT_CS["h",VERT_DATUM["d",2005],UNIT["foot",0.3048]]]',
        pyproj.CRS("EPSG:6360").to_wkt(),
    ],
    ids=["local", "local with heights", "heights alone"],
)
def test_feet_stay_feet_whatever_crs_is_given(tmp_path, wkt):
    with pytest.raises(CRSError, match=r"in (US survey )?foot"):
        read_las_header(write(tmp_path / "a.las", wkt=wkt), fallback="EPSG:25832")


def test_a_point_format_that_does_not_exist_is_refused_by_its_number(tmp_path):
    file = write(tmp_path / "a.las", version="1.2")
    content = bytearray(file.read_bytes())
    content[104] = 77
    file.write_bytes(content)
    with pytest.raises(InputError, match="has points of format 13, formats 0 to 10 are read"):
        read_las_header(file)
