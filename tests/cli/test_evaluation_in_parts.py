"""``roofbench evaluate --parts``: the same result, a work folder that resumes, a sentence for what it cannot do."""

import json
import subprocess
import sys

import geopandas
import numpy as np
import pytest
import shapely
from builders.footprint_sets import random_detections, random_reference
from harness.command_line import roofbench
from PIL import Image

import roofbench as rb

pytest.importorskip("pyarrow")


@pytest.fixture
def files(tmp_path):
    rng = np.random.default_rng(7)
    polygons, building = random_reference(rng, general=True)
    rb.write_footprints(rb.Footprints.of(random_detections(rng, polygons), crs="EPSG:25832"), tmp_path / "d.gpkg")
    rb.write_footprints(rb.Footprints.of(polygons, building_ids=building, crs="EPSG:25832"), tmp_path / "r.fgb")
    return tmp_path


def test_the_command_gives_the_same_and_leaves_no_work_folder(files):
    whole = json.loads(roofbench("evaluate", "d.gpkg", "r.fgb", "-f", "json", folder=files).stdout)
    answer = roofbench("evaluate", "d.gpkg", "r.fgb", "--parts", "4", "-f", "json", "--verdicts", "v.fgb", folder=files)
    assert json.loads(answer.stdout)["counts"] == whole["counts"]
    assert "by place into 4 parts" in answer.stderr
    assert sorted(item.name for item in files.iterdir()) == ["d.gpkg", "r.fgb", "v.fgb"]
    again = roofbench("evaluate", "d.gpkg", "r.fgb", "--parts", "4", "--verdicts", "v.fgb", folder=files, expect=2)
    assert "v.fgb exists already" in again.stderr


#: Where a process is killed: while files are read, while parts are measured, and while verdicts are written.
KILLED = {
    "reading": ("roofbench.evaluators.overlay.outline_store", "OutlineStore._append", 4),
    "measuring": ("roofbench.evaluators.overlay.partition", "_pairs_of_part", 2),
    "redrawing": ("roofbench.evaluators.uncertainty.redrawn_files", "_redrawn_values", 1),
    "writing": ("roofbench.reports.streamed_layers", "_outlines", 1),
}


@pytest.mark.parametrize(
    ("command", "stages"),
    [
        (["evaluate", "d.gpkg", "r.fgb"], ["reading", "measuring", "writing"]),
        (["compare", "d.gpkg", "r.fgb", "r.fgb"], ["writing"]),
    ],
)
def test_a_killed_command_leaves_nothing_half_written_and_resumes(files, command, stages):
    arguments = [*command, "--parts", "4", "--verdicts", "v.parquet"]
    for stage in stages:
        kill(arguments, stage, files)
        assert sorted(item.name for item in files.iterdir()) == [".v.parquet.parts", "d.gpkg", "r.fgb"]
    resumed = roofbench(*arguments, folder=files)
    assert "resuming the interrupted" in resumed.stderr
    assert "sorting" not in resumed.stderr
    assert sorted(item.name for item in files.iterdir()) == ["d.gpkg", "r.fgb", "v.parquet"]
    roofbench(*arguments[:-1], "undisturbed.parquet", folder=files)
    assert (files / "v.parquet").read_bytes() == (files / "undisturbed.parquet").read_bytes()


def kill(arguments, stage, folder):
    """Run a command that kills itself at a stage."""
    module, name, times = KILLED[stage]
    owner, _, function = f"module.{name}".rpartition(".")
    program = f"""
import os, signal, sys
import {module} as module
left = {times}
original = {owner}.{function}

def until_killed(*args, **options):
    global left
    left -= 1
    if left < 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return original(*args, **options)

{owner}.{function} = until_killed
sys.argv = ["roofbench", *{arguments!r}]
from roofbench.cli.main import main
main()
"""
    process = subprocess.run([sys.executable, "-c", program], cwd=folder, capture_output=True, text=True)
    assert process.returncode == -9, process.stderr


def test_two_detections_are_compared_in_parts(files):
    rng = np.random.default_rng(8)
    polygons = rb.read_footprints(files / "r.fgb").polygons
    other = rb.Footprints.of(random_detections(rng, list(polygons)), crs="EPSG:25832")
    rb.write_footprints(other, files / "e.parquet")
    command = ["compare", "d.gpkg", "e.parquet", "r.fgb", "-f", "json"]
    whole = json.loads(roofbench(*command, "--verdicts", "whole.gpkg", folder=files).stdout)
    parts = json.loads(roofbench(*command, "--parts", "3", "--verdicts", "parts.gpkg", folder=files).stdout)
    for key in ("objects", "mcnemar", "blocks", "connected_groups"):
        assert parts[key] == whole[key]
    for key, found in whole["differences"].items():
        for name in ("a", "b", "difference", "interval"):
            one, two = (np.array(side[name], dtype=float) for side in (found, parts["differences"][key]))
            np.testing.assert_allclose(two, one, rtol=1e-9, atol=1e-9, err_msg=f"{key} {name}")
        assert parts["differences"][key]["conclusion"] == found["conclusion"]
    for layer in ("references", "detections_a", "detections_b"):
        one, two = (geopandas.read_file(files / f"{name}.gpkg", layer=layer) for name in ("whole", "parts"))
        assert shapely.equals(one.geometry.array, two.geometry.array).all()
        texts = [name for name in one.columns if one[name].dtype.kind in "OU" and name != "geometry"]
        assert texts
        for name in texts:
            assert one[name].tolist() == two[name].tolist(), (layer, name)


def same_numbers(one, two, **tolerance):
    """Compare nested contents of JSON; numbers to a tolerance."""
    if isinstance(one, dict):
        assert one.keys() == two.keys()
        for key in one:
            same_numbers(one[key], two[key], **tolerance)
    elif isinstance(one, list):
        assert len(one) == len(two)
        for left, right in zip(one, two, strict=True):
            same_numbers(left, right, **tolerance)
    elif isinstance(one, float):
        assert two == pytest.approx(one, **tolerance)
    else:
        assert one == two


def test_uncertainties_in_parts_are_those_of_whole_files(files):
    more = ["-f", "json", "--reference-error", "0.4", "--redraws", "3"]
    for command in (["evaluate", "d.gpkg", "r.fgb", "--interval", "80"], ["compare", "d.gpkg", "r.fgb", "r.fgb"]):
        whole, parts = (
            json.loads(roofbench(*command, *more, *given, folder=files).stdout) for given in ([], ["--parts", "4"])
        )
        same_numbers(whole, parts, rel=1e-8, abs=1e-9)
        found = (parts.get("uncertainty") or parts)["reference_error"]
        assert (found["error"], found["redraws"]) == (0.4, 3)
        assert any(found["changes"].values())
    refused = roofbench("compare", "d.gpkg", "r.fgb", "r.fgb", "--redraws", "3", folder=files, expect=2)
    assert "--redraws needs --reference-error" in refused.stderr


def test_redraws_that_were_interrupted_are_not_made_again(files):
    arguments = ["evaluate", "d.gpkg", "r.fgb", "--parts", "2", "--reference-error", "0.3", "--redraws", "3"]
    kill([*arguments, "--verdicts", "v.fgb"], "redrawing", files)
    assert len(list((files / ".v.fgb.parts").glob("redrawn-*.json"))) == 1
    resumed = roofbench(*arguments, "--verdicts", "v.fgb", "-f", "json", folder=files)
    undisturbed = roofbench(*arguments, "-f", "json", folder=files)
    assert json.loads(resumed.stdout) == json.loads(undisturbed.stdout)


@pytest.mark.parametrize("command", [["evaluate", "d.gpkg", "r.fgb"], ["compare", "d.gpkg", "r.fgb", "r.fgb"]])
def test_maps_in_parts_are_those_of_whole_files(files, command):
    for name, given in (("whole.png", []), ("parts.png", ["--parts", "3"])):
        roofbench(*command, "--plot", name, *given, folder=files)
    whole, parts = (Image.open(files / name).convert("L") for name in ("whole.png", "parts.png"))
    difference = np.abs(np.asarray(whole, dtype=float) - np.asarray(parts, dtype=float))
    assert (difference > 40).mean() < 0.001


def test_of_many_footprints_a_map_of_cells_is_drawn(files, monkeypatch):
    monkeypatch.setattr("roofbench.reports.map_in_parts._MOST_DRAWN", 3)
    for command in (["evaluate", "d.gpkg", "r.fgb"], ["compare", "d.gpkg", "d.gpkg", "r.fgb"]):
        roofbench(*command, "--plot", f"{command[0]}.png", "--parts", "3", folder=files)
        assert (files / f"{command[0]}.png").stat().st_size > 10_000


def test_files_of_two_places_are_named(files):
    houses = [shapely.affinity.translate(house, 9e4, 0) for house in rb.read_footprints(files / "r.fgb").polygons]
    rb.write_footprints(rb.Footprints.of(houses, crs="EPSG:25832"), files / "far.gpkg")
    answers = [roofbench("evaluate", "d.gpkg", "far.gpkg", *more, folder=files) for more in ([], ["--parts", "2"])]
    for answer in answers:
        assert "d.gpkg lies in x" in answer.stderr
        assert "no overlap at all, check the CRS" in answer.stderr


@pytest.mark.filterwarnings("ignore::ResourceWarning:distributed", "ignore::ResourceWarning:tornado")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # sockets that Dask closes late
def test_a_cluster_gives_the_same_bits(files):
    distributed = pytest.importorskip("distributed")
    here = roofbench("evaluate", "d.gpkg", "r.fgb", "--parts", "5", "-f", "json", "--verdicts", "a.fgb", folder=files)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0") as cluster:
        options = ["--scheduler", cluster.scheduler_address, "-f", "json"]
        there = roofbench("evaluate", "d.gpkg", "r.fgb", "--parts", "5", *options, "--verdicts", "b.fgb", folder=files)
        (files / "r.fgb").write_bytes(b"damaged")
        refused = roofbench("evaluate", "d.gpkg", "r.fgb", *options, folder=files, expect=2)
    assert there.stdout == here.stdout
    assert (files / "a.fgb").read_bytes() == (files / "b.fgb").read_bytes()
    assert "r.fgb" in refused.stderr


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["--evaluation-area", "r.fgb"], "needs whole files in memory"),
        (["--join-gaps", "0.1"], "needs whole files in memory"),
        (["-e", "iou"], "compares whole files only"),
        (["--area", "pixels", "--gsd", "0.5"], "exact areas, not pixels"),
        (["--verdicts", "v.geojson"], "name such a file"),
        (["--building-id", "blok"], "has no column 'blok'"),
    ],
)
def test_what_parts_cannot_do_is_refused(files, options, sentence):
    result = roofbench("evaluate", "d.gpkg", "r.fgb", "--parts", "2", *options, folder=files, expect=2)
    assert sentence in " ".join(result.stderr.split())
    assert sorted(item.name for item in files.iterdir()) == ["d.gpkg", "r.fgb"]


@pytest.mark.parametrize("name", ["delft", "scene"])
def test_a_scene_as_reference_is_refused_in_parts(files, name):
    (files / "scene").mkdir()
    for command in (["evaluate", "d.gpkg", name], ["compare", "d.gpkg", "d.gpkg", name]):
        refused = roofbench(*command, "--parts", "2", folder=files, expect=2)
        assert f"{name} is a scene, which is compared as a whole: leave out --parts" in " ".join(refused.stderr.split())
