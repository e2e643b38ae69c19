import pyproj
import pytest

from roofbench.core.errors import CRSError
from roofbench.scenes.geodata.crs import (
    common_crs,
    crs_label,
    crs_text,
    file_crs,
    named_crs,
    require_metric,
    same_crs,
    scale_warning,
)

UTM_WKT = pyproj.CRS("EPSG:25832").to_wkt()


def test_codes_and_texts_of_one_system_are_the_same():
    assert same_crs("EPSG:25832", UTM_WKT)
    assert same_crs("EPSG:28992", "EPSG:7415"), "with and without heights"
    assert not same_crs("EPSG:25832", "EPSG:25833")


def test_a_crs_is_kept_by_its_code_and_without_heights():
    assert crs_text(pyproj.CRS("EPSG:7415")) == "EPSG:28992"
    assert crs_text(pyproj.CRS(UTM_WKT)) == "EPSG:25832"
    assert crs_text(pyproj.CRS("+proj=tmerc +lon_0=10 +ellps=GRS80")).startswith("PROJCRS")


def test_a_crs_has_a_short_name_for_people():
    assert [crs_label(text) for text in (None, "epsg:25832", UTM_WKT)] == ["no CRS", "EPSG:25832", "EPSG:25832"]


@pytest.mark.parametrize("text", [None, "EPSG:25832", "EPSG:7415", UTM_WKT, "EPSG:25832+5783"])
def test_metres_pass(text):
    assert require_metric(text, "here") is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("EPSG:4326", "here: EPSG:4326 is geographic"),
        ("EPSG:2263", "here: EPSG:2263 is in US survey foot"),
        ("EPSG:25832+6360", "here: its heights are in US survey foot"),
        ("EPSG:1", "is not a coordinate reference system"),
        ("nonsense", "is not a coordinate reference system"),
    ],
)
def test_anything_else_is_refused(text, message):
    with pytest.raises(CRSError, match=message):
        require_metric(text, "here")


def test_the_unit_of_heights_does_not_matter_to_footprints():
    with pytest.raises(CRSError, match="its heights are in US survey foot"):
        require_metric("EPSG:25832+6360", "here")
    assert require_metric("EPSG:25832+6360", "here", heights=False) is None


def test_two_inputs_must_share_their_crs():
    names = ("one", "other")
    assert common_crs(None, None, names) is None
    assert common_crs("EPSG:25832", UTM_WKT, names) == "EPSG:25832"
    with pytest.raises(CRSError, match="other has no coordinate reference system while the other is in EPSG:25832"):
        common_crs("EPSG:25832", None, names)
    with pytest.raises(CRSError, match="one is in EPSG:25832 but other in EPSG:25833"):
        common_crs("EPSG:25832", "EPSG:25833", names)


@pytest.mark.parametrize("written", ["25832", "epsg:25832", " EPSG:25832", "urn:ogc:def:crs:EPSG::25832", UTM_WKT])
def test_a_crs_may_be_written_in_many_ways(written):
    assert named_crs(written) == "EPSG:25832"


def test_systems_that_stretch_areas_are_warned_of():
    assert "2.38 and lengths 1.54" in scale_warning("EPSG:3857", 1e6, 6.38e6)
    assert scale_warning("EPSG:3857", 1e6, 0.0) is None, "true at the equator"
    assert scale_warning("EPSG:25832", 5e5, 5.5e6) is None
    assert scale_warning("EPSG:28992", 84900, 447500) is None
    assert scale_warning("EPSG:5514", -700_000, -1_000_000) is None, "mirrored, as PROJ has it"
    assert scale_warning("EPSG:25833", -1e12, 5.5e6) is None, "nothing is known so far away"
    assert scale_warning(None, 0.0, 0.0) is None


LOCAL = 'LOCAL_CS["unnamed",UNIT["metre",1]]'


@pytest.mark.parametrize("dialect", ["WKT1_GDAL", "WKT1_ESRI", "WKT2_2019"])
@pytest.mark.parametrize("code", [2193, 2180, 3006, 2443, 5186, 2326, 3035, 31467, 31256, 25832, 28992, 2154])
def test_a_system_is_known_again_by_its_own_wkt_in_any_order_of_axes(code, dialect):
    text = pyproj.CRS.from_epsg(code).to_wkt(dialect)
    assert same_crs(text, f"EPSG:{code}")
    assert crs_text(pyproj.CRS.from_wkt(text)) == f"EPSG:{code}"
    assert crs_label(text) == f"EPSG:{code}"


def test_systems_that_differ_by_their_datum_alone_are_not_the_same():
    for one, other in ((31467, 25832), (25832, 32632), (2180, 25834)):
        assert not same_crs(pyproj.CRS.from_epsg(one).to_wkt("WKT1_GDAL"), f"EPSG:{other}")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("EPSG:4978", "geocentric"),
        ("EPSG:5703", "heights alone"),
        (LOCAL, "local system"),
        ("EPSG:32600", "not a projected system"),
    ],
)
def test_systems_that_are_no_map_are_refused_with_a_reason(text, reason):
    with pytest.raises(CRSError, match=reason):
        require_metric(text, "a.tif")


def test_a_local_system_in_a_file_locates_nothing():
    assert file_crs(pyproj.CRS.from_wkt(LOCAL)) is None
    assert file_crs(pyproj.CRS.from_epsg(25832)) == "EPSG:25832"


@pytest.mark.parametrize("unit", ['"foot",0.3048', '"centimetre",0.01'])
def test_a_local_system_in_other_units_than_metres_is_refused(unit):
    name = unit.split('"')[1]
    with pytest.raises(CRSError, match=rf"a\.tif: its local system is in {name}"):
        file_crs(pyproj.CRS.from_wkt(f'LOCAL_CS["unnamed",UNIT[{unit}]]'), "a.tif")
