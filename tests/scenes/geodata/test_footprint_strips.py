"""Footprints written strip by strip are those written at once."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.core.errors import OutputError
from roofbench.scenes.geodata import footprint_strips
from roofbench.scenes.geodata.footprint_strips import write_strips
from roofbench.scenes.geodata.footprints import Footprints, stacked

ENDINGS = ("geojson", "gpkg", "shp", "fgb", "parquet")
CRS = "EPSG:28992"


def strip(row, count, *, labelled=True, multi=False):
    x = 85000.0 + 20 * np.arange(count)
    polygons = shapely.box(x, 447000 + 20 * row, x + 10, 447010 + 20 * row)
    if multi:
        polygons[0] = shapely.MultiPolygon([polygons[0], shapely.box(84000, 447000, 84010, 447010)])
    columns = {"height": 3.5 + np.arange(count), "part_of": np.arange(count), "flat": np.arange(count) % 2 == 0}
    labels = np.arange(count) + 100 * row if labelled else None
    return Footprints(polygons=polygons, building_ids=labels, crs=CRS, attributes=columns)


def write(strips, path, **options):
    types = np.unique(np.concatenate([shapely.get_type_id(part.polygons) for part in strips])).tolist()
    return write_strips(iter(strips), path, crs=CRS, types=types, **options)


@pytest.fixture(autouse=True)
def small_batches(monkeypatch):
    monkeypatch.setattr(footprint_strips, "_ROWS", 3)


@pytest.mark.parametrize("multi", [False, True])
@pytest.mark.parametrize("ending", ENDINGS)
def test_strips_make_the_file_that_the_whole_makes(tmp_path, ending, multi):
    strips = [strip(0, 2), strip(1, 4, multi=multi), strip(2, 0), strip(3, 1)]
    path, whole = tmp_path / f"strips.{ending}", tmp_path / f"whole.{ending}"
    assert write(strips, path) == 7
    rb.write_footprints(stacked(strips), whole)
    found, expected = rb.read_footprints(path), rb.read_footprints(whole)
    assert shapely.to_wkb(found.polygons).tolist() == shapely.to_wkb(expected.polygons).tolist()
    assert found.crs == expected.crs == CRS
    assert found.building_ids.tolist() == expected.building_ids.tolist()
    assert {n: c.tolist() for n, c in found.attributes.items()} == {
        n: c.tolist() for n, c in expected.attributes.items()
    }
    written = {file.name for file in tmp_path.iterdir()}
    assert written == {file.name.replace("whole", "strips") for file in tmp_path.glob("whole.*")} | {
        file.name for file in tmp_path.glob("whole.*")
    }


@pytest.mark.parametrize("ending", ENDINGS)
def test_equal_strips_make_equal_bytes(tmp_path, ending):
    strips = [strip(row, 3, labelled=False) for row in range(3)]
    for name in "ab":
        (tmp_path / name).mkdir()
        write(strips, tmp_path / name / f"city.{ending}")
    assert (tmp_path / "a" / f"city.{ending}").read_bytes() == (tmp_path / "b" / f"city.{ending}").read_bytes()


@pytest.mark.parametrize("ending", ENDINGS)
def test_no_strip_with_footprints_is_an_empty_file(tmp_path, ending):
    assert write_strips(iter([]), tmp_path / f"city.{ending}", crs=CRS, types=()) == 0
    assert len(rb.read_footprints(tmp_path / f"city.{ending}")) == 0


@pytest.mark.parametrize("ending", ENDINGS)
def test_strips_that_end_in_an_error_leave_the_old_file(tmp_path, ending):
    path = tmp_path / f"city.{ending}"
    write([strip(0, 2)], path)
    before = path.read_bytes()

    def broken():
        yield strip(0, 5)
        raise OutputError("the disk is full")

    with pytest.raises(OutputError, match="full"):
        write_strips(broken(), path, crs=CRS, types=[3], overwrite=True)
    assert path.read_bytes() == before
    assert len(rb.read_footprints(path)) == 2
    assert not [file for file in tmp_path.iterdir() if file.name.startswith(".")]


def test_objects_of_any_type_are_written_at_once(tmp_path):
    strips = [strip(row, 3, labelled=False) for row in range(3)]
    strips = [
        Footprints(polygons=part.polygons, crs=CRS, attributes={"note": np.array([None, row, row], dtype=object)})
        for row, part in enumerate(strips)
    ]
    write(strips, tmp_path / "city.gpkg")
    assert len(rb.read_footprints(tmp_path / "city.gpkg")) == 9


def test_a_geojson_names_its_crs_by_a_code(tmp_path):
    with pytest.raises(OutputError, match="write a GeoPackage"):
        write_strips(
            iter([strip(0, 1)]), tmp_path / "city.geojson", crs="+proj=tmerc +lon_0=7.3 +ellps=GRS80", types=[3]
        )
