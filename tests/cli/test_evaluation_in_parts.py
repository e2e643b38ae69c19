"""``roofbench evaluate --parts``: the same result, a work folder that resumes, a sentence for what it cannot do."""

import json
import subprocess
import sys

import numpy as np
import pytest
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


def test_a_killed_evaluation_leaves_nothing_half_written_and_resumes(files):
    killed = """
import os, signal, sys
sys.argv = ["roofbench", "evaluate", "d.gpkg", "r.fgb", "--parts", "4", "--verdicts", "v.parquet"]
from roofbench.reports import verdict_stream

def kill(*args, **options):
    os.kill(os.getpid(), signal.SIGKILL)

verdict_stream._rows = kill
from roofbench.cli.main import main
main()
"""
    process = subprocess.run([sys.executable, "-c", killed], cwd=files, capture_output=True, text=True)
    assert process.returncode == -9, process.stderr
    assert not (files / "v.parquet").exists()
    resumed = roofbench("evaluate", "d.gpkg", "r.fgb", "--parts", "4", "--verdicts", "v.parquet", folder=files)
    assert "resuming the interrupted evaluation" in resumed.stderr
    assert (files / "v.parquet").is_file()
    assert not (files / ".v.parquet.parts").exists()


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
