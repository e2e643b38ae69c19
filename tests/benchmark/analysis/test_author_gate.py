"""The gate for authors of detectors: a plugin in a repository of its own, roofbench installed elsewhere."""

import json
import os
import shutil
import subprocess
import sys

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
        if layout == "package":
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
        (folder / "suite.toml").write_text(SUITE.format(use=use))
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


@pytest.fixture(scope="module", params=["files in git", "files", "package"] if NIGHTLY else ["files"])
def author(request, site, tmp_path_factory):
    layout = "package" if request.param == "package" else "files"
    folder = tmp_path_factory.mktemp("author") / "repository"
    return Author(folder, site, layout, in_git=request.param != "files")


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
