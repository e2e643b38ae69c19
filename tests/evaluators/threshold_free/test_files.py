"""Two files compared in parts: the evaluation and the verdict layers of the files read as a whole."""

import geopandas
import numpy as np
import pytest
import shapely
from builders.footprint_sets import random_detections, random_reference

import roofbench as rb
from roofbench.core.errors import CRSError, InputError
from roofbench.evaluators.overlay import file_stores
from roofbench.evaluators.threshold_free.evaluator import ThresholdFree
from roofbench.evaluators.threshold_free.files import evaluate_files
from roofbench.reports.verdict_layers import write_verdicts
from roofbench.reports.verdict_stream import write_verdict_stream
from roofbench.scenes.geodata.footprint_stream import open_stream

pytest.importorskip("pyarrow")


@pytest.fixture
def batches_of_five(monkeypatch):
    monkeypatch.setattr("roofbench.scenes.geodata.footprint_stream._BATCH", 5)


def sides(folder, ending, *, crs="EPSG:25832"):
    rng = np.random.default_rng(7)
    polygons, building = random_reference(rng, general=True)
    bow_tie = shapely.Polygon([(200, 0), (204, 4), (204, 0), (200, 4)])
    detected = [*random_detections(rng, polygons), bow_tie, shapely.box(300, 0, 310, 10)]
    if ending != ".fgb":  # which holds one type of geometry
        detected[-1] = shapely.force_3d(detected[-1], 5.0)
    paths = folder / f"detected{ending}", folder / f"reference{ending}"
    names = np.array([f"house {row}" for row in range(len(detected))], dtype=object)
    raw = rb.Footprints(polygons=np.array(detected, dtype=object), crs="EPSG:25832", attributes={"name": names})
    rb.write_footprints(raw, paths[0])
    rb.write_footprints(rb.Footprints.of(polygons, building_ids=building, crs=crs), paths[1])
    return paths


def read(file, layer=None):
    return geopandas.read_parquet(file) if file.suffix == ".parquet" else geopandas.read_file(file, layer=layer)


@pytest.mark.parametrize("ending", [".parquet", ".gpkg", ".fgb"])
def test_evaluation_and_layers_are_those_of_whole_files(tmp_path, batches_of_five, ending):
    paths = sides(tmp_path, ending)
    whole = rb.evaluate(rb.read_footprints(paths[0]), rb.read_footprints(paths[1]))
    comparison = evaluate_files(ThresholdFree(), tuple(map(open_stream, paths)), tmp_path / "work", parts=3)
    assert comparison.evaluation.counts == whole.counts
    assert comparison.evaluation.notes == whole.notes
    found, expected = tmp_path / f"parts{ending}", tmp_path / f"whole{ending}"
    write_verdict_stream(comparison, found)
    write_verdicts(whole.verdicts, expected)
    for layer in ("detections", "references") if ending == ".gpkg" else (None,):
        one, two = read(found, layer), read(expected, layer)
        assert one.crs == two.crs
        # A GeoPackage that is written whole has multipolygons only where there is one.
        assert shapely.equals(one.geometry.array, two.geometry.array).all()
        for name in ("source_id", "verdict", "reason", *(("side",) if layer is None else ())):
            assert one[name].tolist() == two[name].tolist(), name
        for name in ("partner", "distance", "overlap_area", "iou", "rmse"):
            np.testing.assert_allclose(one[name].astype(float), two[name].astype(float), rtol=1e-6, atol=1e-9)
        if layer != "references":
            assert one["name"].dropna().tolist() == two["name"].dropna().tolist()


def test_a_side_may_be_read_by_another_process(tmp_path, monkeypatch):
    paths = sides(tmp_path, ".fgb")
    alone = evaluate_files(ThresholdFree(), tuple(map(open_stream, paths)), tmp_path / "alone", parts=3)
    monkeypatch.setattr(file_stores, "_PART", 1)
    both = evaluate_files(ThresholdFree(), tuple(map(open_stream, paths)), tmp_path / "both", parts=2)
    assert both.evaluation.tallies.to_dict() == alone.evaluation.tallies.to_dict()


def test_errors_of_the_other_process_are_sentences(tmp_path, monkeypatch):
    monkeypatch.setattr(file_stores, "_PART", 1)
    streams = tuple(map(open_stream, sides(tmp_path, ".gpkg")))
    streams[1].file.write_bytes(b"gone")
    with pytest.raises(InputError, match=r"reference\.gpkg cannot be read as a vector file"):
        evaluate_files(ThresholdFree(), streams, tmp_path / "work")


def test_a_work_folder_belongs_to_the_contents_of_the_files(tmp_path):
    paths, said = sides(tmp_path, ".fgb"), []
    work = tmp_path / "work"

    def compare():
        said.clear()
        return evaluate_files(ThresholdFree(), tuple(map(open_stream, paths)), work, parts=3, say=said.append)

    first = compare()
    again = compare()
    assert said[0].startswith("resuming")
    assert not any(sentence.startswith("sorting") for sentence in said)
    assert again.evaluation.tallies.to_dict() == first.evaluation.tallies.to_dict()
    few = rb.read_footprints(paths[0])
    rb.write_footprints(few.take(np.arange(3)), paths[0], overwrite=True)
    assert compare().evaluation.counts.detected == 3
    assert said[0].startswith("sorting")


def test_files_without_a_common_crs_are_refused(tmp_path):
    paths = sides(tmp_path, ".fgb", crs="EPSG:25833")
    with pytest.raises(CRSError, match="EPSG:25833"):
        evaluate_files(ThresholdFree(), tuple(map(open_stream, paths)), tmp_path / "work")
