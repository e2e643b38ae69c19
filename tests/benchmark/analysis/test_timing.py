"""Run time side by side: the old code really is old, and the same code is refused."""

import sys
from dataclasses import replace

import pytest

from roofbench.benchmark.analysis.baseline import Baseline, BaselineScene, Measured
from roofbench.benchmark.analysis.timing import time_side_by_side
from roofbench.benchmark.identity.detector_code import DetectorCode
from roofbench.benchmark.identity.kept_files import MOST_BYTES, KeptFiles
from roofbench.benchmark.identity.provenance import CodeVersion
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe
from roofbench.core.errors import InputError, UnsupportedError
from roofbench.detectors.registry import make_detector

PLUGIN = '''
"""A detector that takes some time."""
import time
from dataclasses import dataclass
import roofbench as rb

@dataclass(frozen=True, kw_only=True)
class Busy(rb.Detector):
    """Burns processor time."""
    name = "busy-{version}"
    requires = ()

    def detect(self, scene, rng):
        end = time.process_time() + {seconds}
        while time.process_time() < end:
            pass
        return rb.Footprints.empty(crs=scene.crs)
'''

PROGRAM = """
import json, sys, time
while time.process_time() < {seconds}:
    pass
with open(sys.argv[3], "w") as output:
    json.dump({{"type": "FeatureCollection", "crs": None, "features": []}}, output)
"""


@pytest.fixture
def measured(tmp_path_factory):
    def write(version, seconds):
        file = tmp_path_factory.mktemp(version) / "busy.py"
        file.write_text(PLUGIN.format(version=f"{version}-{file.parent.name}", seconds=seconds))
        detector = make_detector(f"{file}:Busy")
        return file, Measured(PluginRecipe.of(detector), (0,), {}, DetectorCode.of(detector))

    return write


def baseline(found, *, scenes=6, commit=None):
    return Baseline(
        suite="s",
        version=CodeVersion("1", commit, False),
        created="2026-01-01T00:00:00+00:00",
        evaluator=PluginRecipe("threshold-free", {}),
        scenes={f"s-{n}": BaselineScene(SceneRecipe.of_preset("hamlet", seed=n), f"hash{n}") for n in range(scenes)},
        detectors={"d": found},
    )


def test_a_slower_plugin_is_found_although_its_old_file_is_gone(measured, tmp_path):
    old_file, old = measured("old", 0.02)
    _, new = measured("new", 0.06)
    baseline(old).save(tmp_path / "b.json")
    before = Baseline.load(tmp_path / "b.json")
    old_file.unlink()
    (conclusion,) = time_side_by_side(before, baseline(new), repeats=1)
    assert (conclusion.conclusion, conclusion.scenes) == ("worse", 6)
    assert 2 < conclusion.candidate < 4


def test_the_same_code_on_both_sides_is_refused(measured):
    _, old = measured("old", 0.0)
    with pytest.raises(UnsupportedError, match=rf"both sides would run the same code \(d {old.code.digest[:10]}\)"):
        time_side_by_side(baseline(old), baseline(old))


def test_other_parameters_of_the_same_code_are_compared(misbehaving):
    sides = []
    for seconds in (0.001, 0.002):
        detector = make_detector(misbehaving, {"seconds": seconds})
        sides.append(baseline(Measured(PluginRecipe.of(detector), (0,), {}, DetectorCode.of(detector)), scenes=1))
    (conclusion,) = time_side_by_side(*sides, repeats=1)
    assert (conclusion.conclusion, conclusion.scenes, conclusion.scenes_needed) == ("not measurable", 1, 6)


def test_a_changed_roofbench_without_a_commit_is_refused(measured):
    _, old = measured("old", 0.0)
    changed = replace(old, code=replace(old.code, framework="other"))
    with pytest.raises(UnsupportedError, match="names no commit"):
        time_side_by_side(baseline(changed), baseline(old))


def test_a_baseline_that_does_not_name_its_code_is_refused(measured):
    _, old = measured("old", 0.0)
    with pytest.raises(UnsupportedError, match="does not say which code of d it measured"):
        time_side_by_side(baseline(replace(old, code=None)), baseline(old))


@pytest.fixture
def command(tmp_path):
    def write(seconds, *, padding=0):
        file = tmp_path / "slow.py"
        file.write_text(PROGRAM.format(seconds=seconds) + "#" * padding)
        detector = make_detector("command", {"run": f"{sys.executable} {file}"})
        return Measured(PluginRecipe.of(detector).relative_to(tmp_path), (0,), {}, DetectorCode.of(detector))

    return write


def test_a_slower_program_is_found_by_the_copy_in_the_baseline(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    baseline(command(0.1)).save(tmp_path / "b.json")
    (conclusion,) = time_side_by_side(Baseline.load(tmp_path / "b.json"), baseline(command(0.4)), repeats=1)
    assert (conclusion.conclusion, conclusion.scenes) == ("worse", 6)


def test_a_program_of_which_there_is_no_copy_is_refused(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    old = command(0.0, padding=MOST_BYTES)
    assert old.code.kept is None
    with pytest.raises(UnsupportedError, match="the old program of d is not available"):
        time_side_by_side(baseline(old), baseline(command(0.1)))


def test_an_unchanged_program_beside_a_changed_detector_is_no_obstacle(command, measured, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (_, old), (_, new) = measured("old", 0.0), measured("new", 0.01)
    sides = [replace(baseline(found, scenes=1), detectors={"d": found, "c": command(0.0)}) for found in (old, new)]
    (conclusion,) = time_side_by_side(*sides, repeats=1)
    assert conclusion.detector == "d"


@pytest.mark.parametrize("facts", [{"text": 3}, {"base64": "?"}, {}, None])
def test_damaged_copies_are_refused(facts, tmp_path):
    with pytest.raises(InputError, match=r"copy of 'a\.py' is damaged"):
        KeptFiles(".", {"a.py": facts}).unpack(tmp_path)


def test_copies_are_not_written_outside_their_folder(tmp_path):
    with pytest.raises(InputError, match="outside its folder"):
        KeptFiles(".", {"../a.py": {"text": ""}}).unpack(tmp_path / "inside")


def test_sources_are_not_written_outside_their_folder(tmp_path):
    code = DetectorCode(framework="a", plugin="b", sources={"../escaped.py": ""})
    with pytest.raises(InputError, match=r"outside its folder: '\.\./escaped\.py'"):
        code.unpack(tmp_path / "inside")
    assert not (tmp_path / "escaped.py").exists()


def test_the_code_of_a_detector_of_roofbench_keeps_no_sources():
    code = DetectorCode.of(make_detector("ndsm"))
    assert (code.plugin, dict(code.sources)) == ("", {})
