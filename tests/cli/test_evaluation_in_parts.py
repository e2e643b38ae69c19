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
    "writing": ("roofbench.reports.streamed_layers", "_outlines", 1),
}


@pytest.mark.parametrize(
    ("command", "stages"),
    [(["evaluate", "d.gpkg", "r.fgb"], list(KILLED)), (["compare", "d.gpkg", "r.fgb", "r.fgb"], ["writing"])],
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
    refused = roofbench(*command, "--parts", "3", "--plot", "map.png", folder=files, expect=2)
    assert "--plot needs whole files in memory" in " ".join(refused.stderr.split())


def test_files_of_two_places_are_named(files):
    houses = [shapely.affinity.translate(house, 9e4, 0) for house in rb.read_footprints(files / "r.fgb").polygons]
    rb.write_footprints(rb.Footprints.of(houses, crs="EPSG:25832"), files / "far.gpkg")
    answers = [roofbench("evaluate", "d.gpkg", "far.gpkg", *more, folder=files) for more in ([], ["--parts", "2"])]
    for answer in answers:
        assert "d.gpkg lies in x" in answer.stderr
        assert "no overlap at all, check the CRS" in answer.stderr


def test_a_cluster_gives_the_same_bits(files):
    distributed = pytest.importorskip("distributed")
    here = roofbench("evaluate", "d.gpkg", "r.fgb", "--parts", "5", "-f", "json", "--verdicts", "a.fgb", folder=files)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
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
        (["--join-gaps", "0.1"], "needs whole files in memory"),
        (["-e", "iou"], "compares whole files only"),
        (["--area", "pixels", "--gsd", "0.5"], "exact areas and no pixels"),
        (["--verdicts", "v.geojson"], "name such a file"),
        (["--building-id", "blok"], "has no column 'blok'"),
    ],
)
def test_what_parts_cannot_do_is_refused(files, options, sentence):
    result = roofbench("evaluate", "d.gpkg", "r.fgb", "--parts", "2", *options, folder=files, expect=2)
    assert sentence in " ".join(result.stderr.split())
    assert sorted(item.name for item in files.iterdir()) == ["d.gpkg", "r.fgb"]
