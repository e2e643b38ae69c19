"""The examples of the guide, run as they stand there."""

import re
import shutil
from pathlib import Path
from subprocess import run

import numpy as np
import pytest

import roofbench as rb
from roofbench.detectors.registry import make_detector

PAGE = Path(rb.__file__).parent / "docs" / "guide" / "external-detectors.md"


def example(language, tmp_path):
    """Write the example of a language to a file and return it."""
    (code,) = re.findall(rf"^```{language}\n(#!.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    file = tmp_path / f"detect.{language}"
    file.write_text(code)
    file.chmod(0o755)
    return file


@pytest.fixture(scope="module")
def scene():
    """Two houses of 10 x 14 m, 5 m high, on level ground."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 60, (2, 15_000))
    roof = (abs(y - 30) < 7) & ((abs(x - 15) < 5) | (abs(x - 45) < 5))
    once = np.ones(len(x), np.uint8)
    points = rb.PointCloud(
        x + 500_000, y + 5_700_000, np.where(roof, 105.0, 100.0), return_number=once, number_of_returns=once
    )
    return rb.Scene("level", (500_000, 5_700_000, 500_060, 5_700_060), crs="EPSG:25832", points=points)


@pytest.mark.parametrize(("language", "tool"), [("sh", "ogr2ogr"), ("js", "node"), ("r", "Rscript")])
def test_an_example_finds_both_houses(language, tool, scene, tmp_path):
    if shutil.which(tool) is None:
        pytest.skip(f"{tool} is not installed")
    if language == "r" and run(["Rscript", "-e", "library(sf)"], capture_output=True, check=False).returncode:
        pytest.skip("the R package sf is not installed")
    detector = make_detector("command", {"run": str(example(language, tmp_path)), "points": "csv"})
    found = rb.detect(scene, detector)
    assert len(found) == 2
    assert found.areas == pytest.approx([140.0, 140.0], rel=0.25)
    higher = make_detector(
        "command", {"run": str(example(language, tmp_path)), "points": "csv", "settings": "height=6.5"}
    )
    assert len(rb.detect(scene, higher)) == 0


def test_points_are_written_as_las_and_csv(scene, tmp_path):
    for kind in ("las", "csv"):
        file = tmp_path / f"keep-{kind}.sh"
        file.write_text(
            f'#!/bin/sh\ncp $1/points.{kind} {tmp_path}\necho \'{{"type":"FeatureCollection","features":[]}}\' > $3\n'
        )
        file.chmod(0o755)
        rb.detect(scene, make_detector("command", {"run": str(file), "points": kind}))
    lines = (tmp_path / "points.csv").read_text().splitlines()
    assert lines[0] == "x,y,z,return_number,number_of_returns"
    assert len(lines) == 1 + len(scene.points)
    from roofbench.scenes.geodata.las_files import read_points

    assert len(read_points(tmp_path / "points.las")) == len(scene.points)
