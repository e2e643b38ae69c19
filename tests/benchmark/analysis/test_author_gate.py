"""The gate for authors of detectors: a plugin in a repository of its own, roofbench installed elsewhere."""

import json
import os
import shutil
import subprocess
import sys
from copy import copy

import pytest
from harness.effort import NIGHTLY

from roofbench.core.package import FOLDER

#: The detector and the file beside it; the time is processor time, so that a busy machine changes no ratio.
DETECTOR = '''
import time
from dataclasses import dataclass

import numpy as np

import roofbench as rb
from {helper} import kept, seconds
from roofbench.detectors.registry import make_detector


@dataclass(frozen=True, kw_only=True)
class Mine(rb.Detector):
    """Footprints of another detector, some of them."""

    name = "mine"
    requires = ("points",)

    def detect(self, scene, rng):
        start = time.process_time()
        found = make_detector("ndsm").detect(scene, rng)
        while time.process_time() < start + seconds():
            pass
        return found.take(np.arange(len(found)) % 4 < kept())
'''
#: A program that roofbench calls: rectangles around connected cells that are high above the lowest point.
PROGRAM = """
import csv
import json
import sys
import time

from rules import kept, seconds

scene, _, output = sys.argv[1:]
with open(f"{scene}/points.csv") as stream:
    points = [(float(row["x"]), float(row["y"]), float(row["z"])) for row in csv.DictReader(stream)]
high = min(z for _, _, z in points) + 4
cells = {(x // 1, y // 1) for x, y, z in points if z > high}
features = []
for start in sorted(cells):
    region, waiting = [], [start] if start in cells else []
    cells.discard(start)
    while waiting:
        x, y = waiting.pop()
        region.append((x, y))
        for near in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            if near in cells:
                cells.remove(near)
                waiting.append(near)
    if len(region) < 20:
        continue
    west, east = min(x for x, _ in region), max(x for x, _ in region) + 1
    south, north = min(y for _, y in region), max(y for _, y in region) + 1
    ring = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    features.append({"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [ring]}})
features = [feature for number, feature in enumerate(features) if number % 4 < kept()]
while time.process_time() < 4 * seconds():
    pass
with open(output, "w") as stream:
    json.dump({"type": "FeatureCollection", "crs": None, "features": features}, stream)
"""
HELPER = "def kept():\n    return {kept}\n\n\ndef seconds():\n    return {seconds}\n"
SUITE = """
name = "own"

[[scenes]]
preset = "hamlet"
seeds = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]

[[detectors]]
use = "{use}"
"""
FAST = {"kept": 4, "seconds": 0.15}
SLOW, LOSS = {**FAST, "seconds": 0.18}, {**FAST, "kept": 3}


class Author:
    """A repository with a detector, `roofbench` beside the interpreter's packages, and a baseline of the detector."""

    def __init__(self, folder, site, layout, *, in_git):
        self.folder, self.site, self.layout = folder, site, layout
        folder.mkdir()
        more = ""
        if layout == "command":
            (folder / "mine.py").write_text(PROGRAM)
            self.helper, use = folder / "rules.py", "command"
            more = f'run = "{sys.executable} mine.py"\nfiles = "rules.py"\npoints = "csv"\nlabel = "mine"\n'
        elif layout == "package":
            package = folder / "mydetector"
            package.mkdir()
            (package / "__init__.py").write_text("from .model import Mine\n")
            (package / "model.py").write_text(DETECTOR.format(helper=".rules"))
            facts = folder / "mydetector-1.0.dist-info"
            facts.mkdir()
            (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: mydetector\nVersion: 1.0\n")
            (facts / "entry_points.txt").write_text("[roofbench.detectors]\nmine = mydetector.model:Mine\n")
            self.helper, use = package / "rules.py", "mine"
        else:
            (folder / "mine.py").write_text(DETECTOR.format(helper="rules"))
            self.helper, use = folder / "rules.py", "mine.py:Mine"
        self.change(FAST)
        (folder / "suite.toml").write_text(SUITE.format(use=use) + more)
        if in_git:
            self.git("init", "-q")
            self.git("add", "-A")
            self.git("-c", "user.name=a", "-c", "user.email=a@example.org", "commit", "-q", "-m", "first")
        assert self.call("baseline", "save", "--suite", "suite.toml", "-o", "baseline.json").returncode == 0

    def git(self, *words):
        subprocess.run(["git", "-C", self.folder, *words], check=True, capture_output=True)

    def change(self, values):
        self.helper.write_text(HELPER.format(**values))

    def call(self, *words):
        path = [str(self.site), *([str(self.folder)] if self.layout == "package" else [])]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path), "NUMBA_NUM_THREADS": "1"}
        command = [sys.executable, "-m", "roofbench", *words, "-j", "0", "-q"]
        return subprocess.run(
            command, cwd=self.folder, env=environment, capture_output=True, text=True, check=False, timeout=300
        )

    def gate(self, *more):
        """Return exit code, standard error, and conclusion by index."""
        answer = self.call("gate", "baseline.json", "--format", "json", *more)
        try:
            found = {item["index"]: item["conclusion"] for item in json.loads(answer.stdout)["conclusions"]}
        except ValueError:
            found = {}
        return answer.returncode, answer.stderr, found


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder like site-packages with roofbench as pip would put it there: without its repository."""
    place = tmp_path_factory.mktemp("site")
    ignored = shutil.ignore_patterns(".*", "tests", "docs", "__pycache__", "*.sqlite")
    shutil.copytree(FOLDER, place / "roofbench", ignore=ignored)
    return place


@pytest.fixture(scope="module", params=["files in git", "files", "package", "command"] if NIGHTLY else ["files"])
def author(request, site, tmp_path_factory):
    layout = "files" if request.param == "files in git" else request.param
    folder = tmp_path_factory.mktemp("author") / "repository"
    return Author(folder, site, layout, in_git=request.param in ("files in git", "package"))


def test_an_unchanged_plugin_passes_and_its_time_is_not_compared_with_itself(author):
    author.change(FAST)
    code, _, conclusions = author.gate()
    assert code == 0
    assert "worse" not in conclusions.values()
    code, err, _ = author.gate("--time")
    assert code == 2
    assert "both sides would run the same code" in err


def test_a_planted_loss_is_found(author):
    author.change(LOSS)
    code, _, conclusions = author.gate()
    assert code == 1
    assert conclusions["object.completeness"] == "worse"


def test_a_planted_slow_down_of_a_fifth_is_found(author):
    author.change(SLOW)
    code, err, conclusions = author.gate("--time")
    assert code == 1, err
    assert conclusions.pop("cost.cpu_ratio") == "worse"
    assert set(conclusions.values()) <= {"equal"}


def test_a_change_that_costs_nothing_passes(author):
    author.helper.write_text(HELPER.format(**FAST) + "\n\nUNUSED = 1\n")
    code, err, conclusions = author.gate("--time", "--time-margin", "0.15")
    assert code == 0, err
    assert conclusions["cost.cpu_ratio"] in {"equal", "undecided"}


def test_the_baseline_serves_another_clone(author, tmp_path):
    author.change(LOSS)
    assert str(author.folder) not in (author.folder / "baseline.json").read_text()
    clone = copy(author)
    clone.folder = tmp_path / "clone"
    shutil.move(author.folder, clone.folder)
    try:
        code, err, conclusions = clone.gate()
    finally:
        shutil.move(clone.folder, author.folder)
    assert code == 1, err
    assert conclusions["object.completeness"] == "worse"
