"""``roofbench compare`` as a person types it."""

import csv
import io
import json

import pyogrio
import pytest
import shapely
from harness.command_line import roofbench

import roofbench as rb

HOUSES = [shapely.box(20 * k, 0, 20 * k + 10, 8) for k in range(8)]


@pytest.fixture
def files(tmp_path):
    def write(name, polygons, **more):
        rb.write_footprints(rb.Footprints.of(polygons, crs="EPSG:25832", **more), tmp_path / name)

    write("a.geojson", HOUSES[:5])
    write("b.gpkg", [*HOUSES[3:7], shapely.box(0, 50, 9, 60)])
    write("r.gpkg", HOUSES, attributes={"street": [f"No {k}" for k in range(8)]})
    return tmp_path


def test_the_table_names_what_only_one_finds(files):
    text = roofbench("compare", "a.geojson", "b.gpkg", "r.gpkg", folder=files).stdout
    rows = {line.split("  ")[0]: line.split() for line in text.splitlines()}
    assert "A: a.geojson, B: b.gpkg, reference: r.gpkg" in text
    assert rows["only A finds it"][4] == "3"
    assert rows["only B finds it"][4] == "2"
    assert "p = 1, no significant difference" in text
    assert "paired bootstrap of 9 blocks of 9 connected groups" in text


def test_a_redrawn_reference_moves_the_differences(files):
    words = ("compare", "a.geojson", "b.gpkg", "r.gpkg", "--reference-error", "0.5")
    table = roofbench(*words, folder=files).stdout
    assert "redrawn ±0.5 m" in table
    assert "a smaller difference is not reliable" in table
    redrawn = json.loads(roofbench(*words, "-f", "json", folder=files).stdout)["reference_error"]
    assert (redrawn["error"], redrawn["redraws"]) == (0.5, 50)
    assert redrawn["changes"]["object.completeness"] == 0, "every house still overlaps its reference"
    assert redrawn["changes"]["pixel.quality"] > 0
    rows = list(csv.DictReader(io.StringIO(roofbench(*words, "-f", "csv", folder=files).stdout)))
    assert {row["key"]: row["redrawn"] for row in rows}["object.completeness"] == "0.0"


def test_json_and_csv_hold_the_differences(files):
    result = json.loads(roofbench("compare", "a.geojson", "b.gpkg", "r.gpkg", "-f", "json", folder=files).stdout)
    assert result["objects"] == {"both": 2, "only_a": 3, "only_b": 2, "neither": 1, "left_out": 0}
    assert result["mcnemar"]["p"] == 1
    completeness = result["differences"]["object.completeness"]
    assert completeness["difference"] == pytest.approx(-0.125)
    answer = roofbench("compare", "a.geojson", "b.gpkg", "r.gpkg", "-f", "csv", folder=files).stdout
    first = next(csv.DictReader(io.StringIO(answer)))
    assert [float(first["low"]), float(first["high"])] == completeness["interval"]
    assert "| found by both" in roofbench("compare", "a.geojson", "b.gpkg", "r.gpkg", "-f", "md", folder=files).stdout


def test_layers_and_map_are_written(files):
    options = ("--verdicts", "out.gpkg", "--plot", "out.png")
    roofbench("compare", "a.geojson", "b.gpkg", "r.gpkg", *options, folder=files)
    assert [name for name, kind in pyogrio.list_layers(files / "out.gpkg") if kind] == [
        "references",
        "detections_a",
        "detections_b",
    ]
    layer = pyogrio.read_dataframe(files / "out.gpkg", layer="references")
    assert layer.fate.tolist() == ["only A"] * 3 + ["both"] * 2 + ["only B"] * 2 + ["neither"]
    assert layer.street.tolist()[0] == "No 0"
    assert layer.verdict_a.tolist() == ["TP"] * 5 + ["FN"] * 3
    assert len(pyogrio.read_dataframe(files / "out.gpkg", layer="detections_b")) == 5
    assert (files / "out.png").stat().st_size > 10_000
    roofbench("compare", "a.geojson", "b.gpkg", "r.gpkg", "--verdicts", "out.geojson", folder=files)
    assert pyogrio.read_dataframe(files / "out.geojson").side.value_counts().to_dict() == {
        "reference": 8,
        "detection_a": 5,
        "detection_b": 5,
    }


def test_another_evaluator_compares_too(files):
    answer = roofbench(
        "compare", "a.geojson", "b.gpkg", "r.gpkg", "-e", "iou[threshold=0.3]", "-f", "json", folder=files
    )
    assert json.loads(answer.stdout)["differences"]["iou.recall"]["a"] == 0.625


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("a.geojson", "none.gpkg", "r.gpkg"), "none.gpkg"),
        (("a.geojson", "b.gpkg", "r.gpkg", "-e", "all"), "one evaluator at a time: name it by --evaluator"),
        (("a.geojson", "b.gpkg", "r.gpkg", "--interval", "100"), "--interval 100 is not a level in percent"),
        (("a.geojson", "b.gpkg", "r.gpkg", "--plot", "b.gpkg"), "set --overwrite"),
        (("a.geojson", "b.gpkg", "r.gpkg", "--plot", "map.bmp"), "unknown file ending"),
    ],
)
def test_bad_input_gets_one_sentence(files, arguments, message):
    before = sorted(files.iterdir())
    failed = roofbench("compare", *arguments, folder=files, expect=2)
    assert message in failed.stderr
    assert sorted(files.iterdir()) == before
