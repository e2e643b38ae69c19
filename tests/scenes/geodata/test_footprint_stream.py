"""Vector files read in batches: the footprints are those of the file read as a whole."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.core.errors import CRSError, InputError
from roofbench.scenes.geodata.footprint_stream import open_stream

pytest.importorskip("pyarrow")

BOW_TIE = shapely.Polygon([(20, 0), (22, 2), (22, 0), (20, 2)])
HOLE = shapely.box(30, 0, 40, 10) - shapely.box(33, 3, 35, 5)


def written(tmp_path, ending, crs="EPSG:25832"):
    polygons = [shapely.box(k, 0, k + 1, 1) for k in range(7)]
    geometries = np.array([*polygons[:3], BOW_TIE, *polygons[3:], HOLE], dtype=object)
    labels = np.array(["a", "b", None, "a", "", "c", "c", "b", None], dtype=object)
    file = tmp_path / f"side{ending}"
    rb.write_footprints(rb.Footprints(polygons=geometries, crs=crs, attributes={"block": labels}), file)
    return file


@pytest.mark.parametrize("ending", [".parquet", ".gpkg", ".fgb", ".shp"])
def test_batches_hold_what_the_whole_file_does(tmp_path, monkeypatch, ending):
    monkeypatch.setattr("roofbench.scenes.geodata.footprint_stream._BATCH", 4)
    file = written(tmp_path, ending)
    whole = rb.read_footprints(file, building_id="block")
    stream = open_stream(file, building_id="block")
    assert (stream.count, stream.crs, stream.building_id) == (9, whole.crs, "block")
    batches = list(stream.outlines())
    assert len(batches) > 1
    counts = np.concatenate([np.diff(batch.start) for batch, _ in batches])
    np.testing.assert_array_equal(counts, np.diff(whole.rings[0]))
    np.testing.assert_array_equal(np.concatenate([batch.points for batch, _ in batches]), whole.rings[1])
    assert np.concatenate([batch.areas for batch, _ in batches]).tolist() == whole.areas.tolist()
    assert np.concatenate([batch.shape()[0] for batch, _ in batches]).tolist() == whole.centres.tolist()
    assert np.concatenate([batch.ids for batch, _ in batches]).tolist() == whole.ids.tolist()
    assert [repair for batch, _ in batches for repair in batch.repairs] == list(whole.repairs)
    labels = [label for _, own in batches for label in own.to_pylist()]
    assert [label or None for label in labels] == ["a", "b", None, "a", None, "c", "c", "b", None]


def test_files_that_cannot_be_read_in_parts_are_refused(tmp_path):
    with pytest.raises(InputError, match="GeoJSON is not read in parts"):
        open_stream(written(tmp_path, ".geojson"))
    with pytest.raises(InputError, match=r"has no column 'blok'.*block"):
        open_stream(written(tmp_path, ".fgb"), building_id="blok")
    with pytest.raises(CRSError, match="EPSG:4326"):
        open_stream(written(tmp_path, ".gpkg", crs="EPSG:4326"))
    with pytest.raises(InputError, match=r"no such file|does not exist"):
        open_stream(tmp_path / "nothing.parquet")
    (tmp_path / "text.parquet").write_text("no parquet")
    with pytest.raises(InputError, match="cannot be read as GeoParquet"):
        open_stream(tmp_path / "text.parquet")


def test_the_short_name_of_building_ids_in_a_shapefile_is_known(tmp_path):
    houses = rb.Footprints.of([shapely.box(0, 0, 5, 9), shapely.box(5, 0, 9, 9)], building_ids=[4, 4], crs="EPSG:25832")
    rb.write_footprints(houses, tmp_path / "side.shp")
    ((_, labels),) = open_stream(tmp_path / "side.shp").outlines()
    assert labels.to_pylist() == [4, 4]
