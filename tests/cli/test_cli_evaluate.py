"""``roofbench evaluate`` as a person types it."""

import csv
import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely
from harness.command_line import roofbench

import roofbench as rb

HOUSES = [shapely.box(20 * k, 0, 20 * k + 10, 8) for k in range(4)]
MOVED = [shapely.box(20 * k + 1, 0, 20 * k + 11, 8) for k in range(3)]


@pytest.fixture
def files(tmp_path):
    rb.write_footprints(rb.Footprints.of(MOVED, crs="EPSG:25832"), tmp_path / "d.geojson")
    truth = rb.Footprints.of(HOUSES, crs="EPSG:25832", attributes={"register": [1, 1, 2, 3]})
    rb.write_footprints(truth, tmp_path / "r.gpkg")
    return tmp_path


def test_json_keeps_its_contract(files):
    result = json.loads(roofbench("evaluate", "d.geojson", "r.gpkg", "--format", "json", folder=files).stdout)
    assert result["counts"] == {
        "detected": 3,
        "reference": 4,
        "true_positives": 3,
        "false_positives": 0,
        "false_negatives": 1,
        "multiple_detections": 0,
        "overlapping_detections": 0,
        "cross_lapping_detections": 0,
        "cross_lapped_references": 0,
    }
    assert result["object"] == {
        "completeness": 0.75,
        "correctness": 1.0,
        "quality": 0.75,
        "multiple_detection_rate": 0.0,
        "detection_overlap_rate": 0.0,
        "detection_cross_lap_rate": 0.0,
        "reference_cross_lap_rate": 0.0,
    }
    pixel = {"completeness", "correctness", "quality", "area_omission_error", "area_commission_error"}
    assert pixel | {"branching_factor", "miss_factor"} <= set(result["pixel"])
    assert result["geometric"]["rmse"] == pytest.approx(1.0)


def test_undefined_indices_are_null_in_json_and_empty_in_csv(files):
    rb.write_footprints(rb.Footprints.empty(crs="EPSG:25832"), files / "none.gpkg")
    run = roofbench("evaluate", "none.gpkg", "r.gpkg", "--format", "json", folder=files)
    result = json.loads(run.stdout)
    assert result["object"]["completeness"] == 0
    assert result["object"]["correctness"] is None
    assert "none.gpkg: no footprints" in run.stderr
    text = roofbench("evaluate", "none.gpkg", "r.gpkg", "--format", "csv", folder=files).stdout
    rows = {row["key"]: row["value"] for row in csv.DictReader(io.StringIO(text))}
    assert rows["object.correctness"] == ""
    assert rows["object.completeness"] == "0.0"


def test_an_empty_geojson_is_a_result_too(files):
    (files / "none.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    for pair in (("none.geojson", "r.gpkg"), ("d.geojson", "none.geojson")):
        result = json.loads(roofbench("evaluate", *pair, "-f", "json", folder=files).stdout)
        assert result["counts"]["true_positives"] == 0


def test_tables_name_symbols_units_matching_and_counts(files):
    table = roofbench("evaluate", "d.geojson", "r.gpkg", folder=files).stdout
    assert re.search(r"^quality +Q_l +75\.00 %$", table, re.MULTILINE)
    assert "matching nearest" in table
    assert "3 true positives" in table
    markdown = roofbench("evaluate", "d.geojson", "r.gpkg", "-f", "md", folder=files).stdout
    assert re.search(r"^\| quality +\| Q_l +\| +75\.00 % \|$", markdown, re.MULTILINE)


def test_verdicts_and_plot_are_written(files):
    roofbench("evaluate", "d.geojson", "r.gpkg", "--verdicts", "v.gpkg", "--plot", "v.png", "-q", folder=files)
    assert {name for name, kind in pyogrio.list_layers(files / "v.gpkg") if kind} == {"detections", "references"}
    references = pyogrio.read_dataframe(files / "v.gpkg", layer="references")
    assert references["verdict"].tolist() == ["TP", "TP", "TP", "FN"]
    assert references["partner"].isna().tolist() == [False, False, False, True]
    assert references.crs.to_epsg() == 25832
    assert (files / "v.png").read_bytes().startswith(b"\x89PNG")


def test_a_comparison_of_nothing_with_nothing_can_be_drawn(files):
    rb.write_footprints(rb.Footprints.empty(crs="EPSG:25832"), files / "none.gpkg")
    roofbench("evaluate", "none.gpkg", "none.gpkg", "--plot", "none.png", "-q", folder=files)
    assert (files / "none.png").read_bytes().startswith(b"\x89PNG")


def test_every_repair_is_reported(files):
    flat = shapely.Polygon([(0, 0), (5, 0), (9, 0)])
    from roofbench.scenes.geodata.vector_files import write_layers

    write_layers({"d": (np.array([*MOVED, *[flat] * 14], dtype=object), {})}, files / "flat.gpkg", crs="EPSG:25832")
    run = roofbench("evaluate", "flat.gpkg", "r.gpkg", "-f", "csv", folder=files)
    assert run.stderr.count("left out") == 11
    assert "flat.gpkg: 4 more repaired or left out" in run.stderr


def test_verdicts_in_a_format_of_one_layer_have_a_column_for_the_side(files):
    roofbench("evaluate", "d.geojson", "r.gpkg", "--verdicts", "v.geojson", "-q", folder=files)
    sides = pyogrio.read_dataframe(files / "v.geojson")["side"].value_counts().to_dict()
    assert sides == {"detection": 3, "reference": 4}


def test_options_reach_the_evaluator(files):
    options = ("-f", "json", "--area", "pixels", "--gsd", 0.5, "--matching", "overlap", "--building-id", "register")
    result = json.loads(roofbench("evaluate", "d.geojson", "r.gpkg", *options, folder=files).stdout)
    assert result["parameters"]["area"] == "pixels"
    assert result["parameters"]["matching"] == "overlap"
    assert result["geometric"]["rmse_pixels"] == pytest.approx(2.0)
    assert result["buildings"]["reference"] == 3


def test_only_what_is_needed_is_loaded(files):
    heavy = ("numba", "matplotlib", "cv2", "laspy", "rasterio", "scipy")
    code = (
        "import sys; sys.argv = ['roofbench', 'evaluate', 'd.geojson', 'r.gpkg', '-f', 'json']\n"
        "from roofbench.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        f"print([module for module in {heavy} if module in sys.modules], file=sys.stderr)"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=files, capture_output=True, text=True, check=True)
    assert run.stderr.strip().splitlines()[-1] == "[]"


def test_a_scene_folder_brings_reference_area_and_grid(files):
    scene = rb.Scene(
        "small",
        (-10, -10, 90, 30),
        crs="EPSG:25832",
        reference=rb.Footprints.of(HOUSES, crs="EPSG:25832"),
        area=shapely.box(-5, -5, 35, 25),
    )
    rb.save_scene(scene, files / "small")
    result = json.loads(roofbench("evaluate", "d.geojson", "small/", "-f", "json", folder=files).stdout)
    assert result["counts"]["reference"] == 2
    assert result["left_out"]["reference_outside"] == 2
    message = "1 detection left out: outside the evaluation area, or on references that are left out"
    assert result["notes"][1:] == [message, "2 references outside the evaluation area left out"]
    roofbench("evaluate", "d.geojson", "small/", "--plot", "v.svg", "-q", folder=files)
    drawing = (files / "v.svg").read_text(encoding="utf-8")
    assert "detection left out (1)" in drawing
    assert "reference left out (2)" in drawing


def test_a_scene_that_comes_with_roofbench_is_a_reference_by_its_name(tmp_path):
    rb.write_footprints(rb.open_scene("ign").reference, tmp_path / "detected.gpkg")
    answer = roofbench("evaluate", "detected.gpkg", "ign", "-f", "json", folder=tmp_path)
    assert json.loads(answer.stdout)["object"]["quality"] == 1.0


def test_houses_of_a_row_are_joined_to_blocks_on_request(files):
    row = [shapely.box(6 * k, 0, 6 * k + 5.95, 9) for k in range(5)]
    rb.write_footprints(rb.Footprints.of(row, crs="EPSG:25832"), files / "row.gpkg")
    rb.write_footprints(rb.Footprints.of([shapely.box(0, 0, 29.95, 9)], crs="EPSG:25832"), files / "block.gpkg")
    houses = json.loads(roofbench("evaluate", "block.gpkg", "row.gpkg", "-f", "json", folder=files).stdout)
    blocks = json.loads(
        roofbench("evaluate", "block.gpkg", "row.gpkg", "-f", "json", "--join-gaps", 0.1, folder=files).stdout
    )
    assert houses["object"]["quality"] == pytest.approx(0.2)
    assert blocks["object"]["quality"] == 1
    assert blocks["pixel"]["quality"] == pytest.approx(1)


def test_sets_that_cannot_be_of_one_place_are_warned_of(files):
    swapped = shapely.transform(np.array(HOUSES), lambda points: points[:, ::-1] + np.array([500, 0]))
    rb.write_footprints(rb.Footprints.of(swapped, crs="EPSG:25832"), files / "swapped.gpkg")
    message = roofbench("evaluate", "swapped.gpkg", "r.gpkg", folder=files).stderr
    assert "warning: swapped.gpkg lies in x 500 to" in message
    assert "no overlap at all" in message
    assert roofbench("evaluate", "d.geojson", "r.gpkg", folder=files).stderr == ""


def test_files_of_two_systems_are_refused_without_a_word_on_their_place(files):
    far = shapely.transform(np.array(HOUSES), lambda points: points + np.array([-4e5, 0]))
    rb.write_footprints(rb.Footprints.of(far, crs="EPSG:25833"), files / "zone33.gpkg")
    message = roofbench("evaluate", "zone33.gpkg", "r.gpkg", folder=files, expect=2).stderr
    assert "zone33.gpkg is in EPSG:25833 but r.gpkg in EPSG:25832" in message
    assert "no overlap" not in message


def test_areas_that_a_projection_stretches_are_warned_of(files):
    north = shapely.transform(np.array(HOUSES), lambda points: points + np.array([1e6, 6.38e6]))
    rb.write_footprints(rb.Footprints.of(north, crs="EPSG:3857"), files / "web.gpkg")
    assert "EPSG:3857 shows areas 2.38" in roofbench("evaluate", "web.gpkg", "web.gpkg", folder=files).stderr
    assert roofbench("evaluate", "web.gpkg", "web.gpkg", "-q", folder=files).stderr == ""


BAD_INPUT = {
    "missing file": (["x.gpkg", "r.gpkg"], "x.gpkg: no such file"),
    "no vector file": (["noise.gpkg", "r.gpkg"], "noise.gpkg cannot be read as a vector file"),
    "other CRS": (["utm33.gpkg", "r.gpkg"], "utm33.gpkg is in EPSG:25833 but r.gpkg in EPSG:25832"),
    "no CRS on one side": (["bare.fgb", "r.gpkg"], "set it by --crs"),
    "geographic CRS": (["degrees.gpkg", "r.gpkg"], "geographic"),
    "no polygons": (["points.gpkg", "r.gpkg"], "no polygons"),
    "no geometry": (["table.csv", "r.gpkg"], "table.csv"),
    "unknown column": (["d.geojson", "r.gpkg", "--building-id", "registr"], "did you mean 'register'"),
    "unknown layer": (["d.geojson", "r.gpkg|layername=q"], "no layer 'q'"),
    "unknown CRS": (["d.geojson", "r.gpkg", "--crs", "EPSG:1"], "EPSG:1"),
    "unwritable folder": (["d.geojson", "r.gpkg", "--verdicts", "no/v.gpkg"], "there is no folder no"),
    "unknown ending": (["d.geojson", "r.gpkg", "--verdicts", "v.xyz"], "unknown file ending"),
    "unknown picture": (["d.geojson", "r.gpkg", "--plot", "v.bmp"], "unknown file ending"),
    "existing output": (["d.geojson", "r.gpkg", "--verdicts", "r.gpkg"], "--overwrite"),
    "pixels without size": (["d.geojson", "r.gpkg", "--area", "pixels"], "--gsd"),
    "negative size": (["d.geojson", "r.gpkg", "--area", "pixels", "--gsd", "-1"], "gsd must be at least"),
    "pixels without end": (["d.geojson", "r.gpkg", "--area", "pixels", "--gsd", "1e-6"], "at least 0.001 m"),
    "no finite area": (["d.geojson", "r.gpkg", "--minimum-area", "inf"], "must be a finite number"),
    "area elsewhere": (["d.geojson", "r.gpkg", "--evaluation-area", "elsewhere.gpkg"], "holds none of the footprints"),
    "only NaN": (["d.geojson", "nan.geojson"], "nan.geojson: the geometry of feature 0 is damaged"),
    "unknown evaluator": (["d.geojson", "r.gpkg", "-e", "treshold-free"], "did you mean 'threshold-free'"),
    "unknown parameter": (["d.geojson", "r.gpkg", "-e", "threshold-free[maching=overlap]"], "did you mean 'matching'"),
    "no gap to join": (["d.geojson", "r.gpkg", "--join-gaps", "0"], "more than 0 and up to 100 m"),
    "a folder that is no scene": (["d.geojson", "."], "scene.toml"),
    "endless gap to join": (["d.geojson", "r.gpkg", "--join-gaps", "inf"], "more than 0 and up to 100 m, not inf"),
    "building ids of blocks": (
        ["d.geojson", "r.gpkg", "--building-id", "register", "--join-gaps", "0.1"],
        "--building-id or --join-gaps, not both",
    ),
    "building ids of a scene": (["d.geojson", "small", "--building-id", "register"], "leave out --building-id"),
    "second output of unknown ending": (
        ["d.geojson", "r.gpkg", "--verdicts", "v.gpkg", "--plot", "v.bmp"],
        "unknown file ending",
    ),
    "input as output": (["d.geojson", "r.gpkg", "--verdicts", "r.gpkg", "--overwrite"], "is an input"),
    "area without polygons": (["d.geojson", "r.gpkg", "--evaluation-area", "points.gpkg"], "no polygons"),
}


@pytest.mark.parametrize("case", BAD_INPUT)
def test_bad_input_gets_one_sentence_and_exit_code_two(files, case):
    (files / "noise.gpkg").write_bytes(b"this is no database" * 100)
    (files / "table.csv").write_text("a,b\n1,2\n")
    rb.write_footprints(rb.Footprints.of(MOVED, crs="EPSG:25833"), files / "utm33.gpkg")
    rb.write_footprints(rb.Footprints.of([shapely.box(900, 900, 999, 999)], crs="EPSG:25832"), files / "elsewhere.gpkg")
    (files / "nan.geojson").write_text(re.sub(r"\[ [\d.]+,", "[ NaN,", (files / "d.geojson").read_text()))
    rb.write_footprints(rb.Footprints.of(MOVED), files / "bare.fgb")
    degrees = [shapely.box(9, 50, 9.001, 50.001)]
    rb.write_footprints(rb.Footprints.of(degrees, crs="EPSG:4326"), files / "degrees.gpkg")
    from roofbench.scenes.geodata.vector_files import write_layers

    points = shapely.points([[0, 0], [1, 1]])
    write_layers({"points": (points, {})}, files / "points.gpkg", crs="EPSG:25832")
    truth = rb.Footprints.of(HOUSES, crs="EPSG:25832")
    rb.save_scene(rb.Scene("small", (-10, -10, 90, 30), crs="EPSG:25832", reference=truth), files / "small")
    before = sorted(files.iterdir())
    arguments, expected = BAD_INPUT[case]
    run = roofbench("evaluate", *arguments, folder=files, expect=2)
    assert run.stdout == ""
    (line,) = run.stderr.strip().splitlines()
    assert line.startswith("Error: ")
    assert expected in line
    assert sorted(files.iterdir()) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_read_only_folder_is_reported(files):
    (files / "locked").mkdir(mode=0o555)
    run = roofbench("evaluate", "d.geojson", "r.gpkg", "--verdicts", "locked/v.gpkg", folder=files, expect=2)
    assert "no permission" in run.stderr


SHARED = Path(os.environ.get("ROOFBENCH_SHARED", Path(__file__).resolve().parents[3] / "shared" / "scenes"))
INDIANA = SHARED / "indiana-detectors" / "regularized_footprints.gpkg"


@pytest.mark.skipif(not INDIANA.exists(), reason=f"no real scenes at {SHARED}")
def test_real_detections_of_seven_detectors_compare_in_every_pair():
    names = [name for name, _ in pyogrio.list_layers(INDIANA)]
    layers = {name: rb.read_footprints(INDIANA, layer=name) for name in names}
    assert len(layers) == 7
    for one in layers.values():
        for two in layers.values():
            result = rb.evaluate(one, two)
            counts = result.counts
            assert counts.true_positives + counts.false_positives + counts.multiple_detections == len(one)
            assert counts.true_positives + counts.false_negatives == len(two)
            if one is two:
                assert result.pixel.quality == 1
            else:
                assert 0.3 < result.object.quality < 1


def test_intervals_and_a_redrawn_reference_stand_beside_the_values(files):
    options = ("--interval", "90", "--reference-error", "0.2", "--redraws", "4")
    result = json.loads(roofbench("evaluate", "d.geojson", "r.gpkg", *options, "-f", "json", folder=files).stdout)
    low, high = result["uncertainty"]["interval"]["ends"]["object.completeness"]
    assert low <= result["object"]["completeness"] <= high
    assert result["uncertainty"]["interval"]["blocks"] == 4
    assert 0 < result["uncertainty"]["reference_error"]["changes"]["pixel.quality"] < 0.2
    table = roofbench("evaluate", "d.geojson", "r.gpkg", *options, folder=files).stdout
    assert all(text in table for text in ("90 %", "reference ±0.2 m", "4 redraws"))
    rows = list(
        csv.DictReader(
            io.StringIO(
                roofbench("evaluate", "d.geojson", "r.gpkg", *options, "-f", "csv", "-e", "all", folder=files).stdout
            )
        )
    )
    assert {"low", "high", "reference_change"} <= rows[0].keys()
    assert rows[0]["low"] == str(low)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--interval", "0"), "--interval 0 is not a level in percent"),
        (("--reference-error", "-1"), "--reference-error -1 is not a digitising error"),
        (("--redraws", "5"), "--redraws needs --reference-error"),
    ],
)
def test_uncertainty_that_cannot_be_found_is_refused(files, options, message):
    failed = roofbench("evaluate", "d.geojson", "r.gpkg", *options, folder=files, expect=2)
    assert message in failed.stderr
