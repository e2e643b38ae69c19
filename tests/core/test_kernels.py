"""Compiled kernels are kept, and never served after a change of anything that they depend on."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numba import config

import roofbench
from roofbench.core import kernel_files
from roofbench.core.kernels import kernel

ROOT = Path(roofbench.__file__).parent

#: A chain of kernels over three modules of the package's kind.
OWN = {
    "bottom.py": "from roofbench.core.kernels import kernel\nSTEP = 1.0\n"
    "@kernel\ndef bottom(x):\n    return x + STEP\n",
    "middle.py": "from roofbench.core.kernels import kernel\nfrom bottom import bottom\n"
    "@kernel\ndef middle(x):\n    return 10.0 * bottom(x)\n",
    "top.py": "from roofbench.core.kernels import kernel\nfrom middle import middle\n"
    "@kernel\ndef top(x):\n    return middle(x)\n",
}
CALL = "from top import top; print(top(1.0), sum(top.stats.cache_hits.values()))"


def environment(cache, **more):
    names = {"NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "PYTHONDONTWRITEBYTECODE"}
    kept = {name: value for name, value in os.environ.items() if name not in names}
    paths = os.pathsep.join([str(ROOT.parent), *filter(None, sys.path)])
    # Without bytecode files: two edits within a second, of one length, are one to Python.
    return {**kept, "PYTHONPATH": paths, "XDG_CACHE_HOME": str(cache), "PYTHONDONTWRITEBYTECODE": "1", **more}


def python(code, folder, cache, **more):
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment(cache, **more), cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split(), done.stderr


def write(folder, files):
    folder.mkdir(exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    return folder


def edit(file, old, new):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))


def test_a_change_anywhere_below_is_seen_and_nothing_else_compiles_again(tmp_path):
    here, cache = write(tmp_path / "here", OWN), tmp_path / "cache"
    assert python(CALL, here, cache)[0] == ["20.0", "0"]
    there = write(tmp_path / "there", {**OWN, "bottom.py": "# A checkout elsewhere.\n" + OWN["bottom.py"]})
    assert python(CALL, there, cache)[0] == ["20.0", "1"]
    edit(here / "bottom.py", "STEP = 1.0", "STEP = 2.0")
    assert python(CALL, here, cache)[0] == ["30.0", "0"]
    edit(here / "bottom.py", "x + STEP", "x - STEP")
    assert python(CALL, here, cache)[0] == ["-10.0", "0"]
    edit(here / "middle.py", "10.0", "20.0")
    assert python(CALL, here, cache)[0] == ["-20.0", "0"]
    assert python(CALL, there, cache)[0] == ["20.0", "1"]


#: Calls a kernel when the other process is ready, too; prints whether its compiled form was loaded.
TOGETHER = """
import sys, time
from pathlib import Path
from top import top
Path(sys.argv[1]).touch()
while not Path(sys.argv[2]).exists():
    time.sleep(0.001)
print(top(1.0), sum(top.stats.cache_hits.values()))
"""


@pytest.mark.skipif(kernel_files.fcntl is None, reason="no file locks on this platform")
def test_two_processes_at_the_same_time_compile_a_kernel_once(tmp_path):
    here, cache = write(tmp_path / "here", OWN), tmp_path / "cache"
    runs = [
        subprocess.Popen(
            [sys.executable, "-c", TOGETHER, own, other],
            env=environment(cache),
            cwd=here,
            stdout=subprocess.PIPE,
            text=True,
        )
        for own, other in (("first", "second"), ("second", "first"))
    ]
    assert sorted(run.communicate(timeout=120)[0] for run in runs) == ["20.0 0\n", "20.0 1\n"]


def test_the_fields_of_a_named_tuple_that_is_an_argument_count(tmp_path):
    files = {
        "frames.py": "from typing import NamedTuple\nclass Frame(NamedTuple):\n    width: float\n    depth: float\n",
        "top.py": "from roofbench.core.kernels import kernel\n@kernel\ndef top(frame):\n    return frame.width\n",
    }
    folder, cache = write(tmp_path / "here", files), tmp_path / "cache"
    code = "from top import top; from frames import Frame; print(top(Frame(1.0, 2.0)))"
    assert python(code, folder, cache)[0] == ["1.0"]
    edit(folder / "frames.py", "width: float\n    depth: float", "depth: float\n    width: float")
    assert python(code, folder, cache)[0] == ["2.0"]


#: Prints the areas of what a detector finds.
AREAS = """
import roofbench as rb
from roofbench.scenes.builtin import hamlet
print(*rb.detect(hamlet(), "{}").areas)
"""

#: A detector whose footprint is as wide as the common area of two rectangles is large: 8 m2.
OVERLAP = """
from dataclasses import dataclass
import numpy as np, shapely, roofbench as rb
from roofbench.detectors.mpp.energy import overlaps

@dataclass(frozen=True, kw_only=True)
class Overlap(rb.Detector):
    name = "overlap"
    requires = ("points",)

    def detect(self, scene, rng=None):
        pair = np.array([[0.0, 0.0, 4.0, 4.0, 0.0], [2.0, 0.0, 4.0, 4.0, 0.0]])
        west, south, _, _ = scene.extent
        area = overlaps(pair, 1, pair[1], -1, -1)
        return rb.Footprints.of([shapely.box(west, south, west + area, south + 1)], crs=scene.crs)
"""


def test_a_changed_overlap_area_changes_the_result_of_a_run(tmp_path):
    copy, cache = tmp_path / "roofbench", tmp_path / "cache"
    shutil.copytree(ROOT, copy, ignore=shutil.ignore_patterns("tests", "docs", ".*", "__pycache__"))
    write(tmp_path, {"overlap.py": OVERLAP})
    code = AREAS.format("overlap.py:Overlap")
    paths = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    assert python(code, tmp_path, cache, PYTHONPATH=paths)[0] == ["8.0"]
    with (copy / "detectors" / "mpp" / "rectangles.py").open("a") as file:
        file.write("\n\n@kernel\ndef overlap_area(first, second):\n    return 12.0\n")
    assert python(code, tmp_path, cache, PYTHONPATH=paths)[0] == ["12.0"]


#: A plugin that uses numba as it likes, with a kernel from a module beside it.
PLUGIN = """
from dataclasses import dataclass
import numba, numpy, shapely, roofbench as rb
from beside import width

@numba.njit(cache=True)
def area(x):
    return x * width(x)

@numba.vectorize(["f8(f8)"], cache=True)
def each(x):
    return x * width(x)

@numba.guvectorize(["(f8[:], f8[:])"], "()->()", cache=True)
def every(x, out):
    out[0] = x[0] * width(x[0])

@dataclass(frozen=True, kw_only=True)
class Plugin(rb.Detector):
    name = "plugin"
    requires = ("points",)

    def detect(self, scene, rng=None):
        sides = area(1.0), each(1.0), every(1.0)
        west, south, _, _ = scene.extent
        return rb.Footprints.of([shapely.box(west, south, west + side, south + 1) for side in sides], crs=scene.crs)
"""
BESIDE = "import numba\n@numba.njit\ndef width(x):\n    return 2.0\n"


@pytest.mark.parametrize("numba_first", [False, True])
def test_a_plugin_sees_a_change_of_the_module_beside_it(tmp_path, numba_first):
    folder, cache = write(tmp_path / "here", {"plugin.py": PLUGIN, "beside.py": BESIDE}), tmp_path / "cache"
    load = "import plugin" if numba_first else ""
    code = load + AREAS.format("plugin.py:Plugin")
    assert python(code, folder, cache)[0] == ["2.0"] * 3
    edit(folder / "beside.py", "2.0", "5.0")
    assert python(code, folder, cache)[0] == ["5.0"] * 3


def test_kernels_of_modules_that_were_imported_before_are_tracked(tmp_path):
    folder, cache = write(tmp_path / "here", {"plugin.py": PLUGIN, "beside.py": BESIDE}), tmp_path / "cache"
    code = (
        "import plugin; from roofbench.core.kernels import track_dependencies_of_numba as track; track()\n"
        "print(plugin.area(1.0))"
    )
    assert python(code, folder, cache)[0] == ["2.0"]
    edit(folder / "beside.py", "2.0", "5.0")
    assert python(code, folder, cache)[0] == ["5.0"]


def test_settings_of_numba_are_part_of_the_key(tmp_path):
    folder, cache = write(tmp_path / "here", OWN), tmp_path / "cache"
    assert python(CALL, folder, cache)[0] == ["20.0", "0"]
    assert python(CALL, folder, cache, NUMBA_BOUNDSCHECK="1")[0] == ["20.0", "0"]
    assert python("from top import top; print(top(1.0))", folder, cache, NUMBA_DISABLE_JIT="1")[0] == ["20.0"]


def test_damaged_files_are_compiled_again(tmp_path):
    folder, cache = write(tmp_path / "here", OWN), tmp_path / "cache"
    python(CALL, folder, cache)
    for file in cache.rglob("*.kernel"):
        file.write_bytes(file.read_bytes()[:-9] + b"not right")
    assert python(CALL, folder, cache)[0] == ["20.0", "0"]
    assert python(CALL, folder, cache)[0] == ["20.0", "1"]
    for file in cache.rglob("*.kernel"):  # whole, and yet nothing that numba can read
        kernel_files.save(file.parent, file.stem, b"no compiled code")
    assert python(CALL, folder, cache)[0] == ["20.0", "0"]


def test_several_processes_share_a_cache(tmp_path):
    folder, cache = write(tmp_path / "here", OWN), tmp_path / "cache"
    running = [
        subprocess.Popen(
            [sys.executable, "-c", CALL], env=environment(cache), cwd=folder, stdout=subprocess.PIPE, text=True
        )
        for _ in range(3)
    ]
    assert [process.communicate()[0].split()[0] for process in running] == ["20.0"] * 3
    assert python(CALL, folder, cache)[0] == ["20.0", "1"]


def test_where_the_cache_cannot_be_written_kernels_run_and_the_reason_is_named_once(tmp_path):
    folder = write(tmp_path / "here", OWN)
    (tmp_path / "file").touch()
    code = "from top import top; print(top(1.0), top(1))"
    words, messages = python(code, folder, tmp_path / "file")
    assert words == ["20.0", "20.0"]
    assert messages.count("set NUMBA_CACHE_DIR to a writable folder") == 1


@pytest.mark.parametrize("chosen", [None, "elsewhere"])
def test_files_are_outside_the_package_and_where_the_user_wants_them(chosen, tmp_path):
    folder = write(tmp_path / "here", OWN)
    more = {"NUMBA_CACHE_DIR": str(tmp_path / chosen)} if chosen else {}
    python(CALL, folder, tmp_path / "cache", **more)
    kept = {path.relative_to(tmp_path).parts[0] for path in tmp_path.rglob("*.kernel")}
    assert kept == {chosen or "cache"}
    assert not list(folder.rglob("__pycache__"))


def test_a_kernel_with_a_changed_constant_is_not_kept(tmp_path):
    folder, cache = write(tmp_path / "here", OWN), tmp_path / "cache"
    code = "import bottom, top; bottom.bottom(1.0); bottom.STEP = 5.0; print(top.top(1.0))"
    assert python(code, folder, cache)[0] == ["20.0"]  # numba keeps the constant that it compiled
    edit(folder / "bottom.py", "STEP = 1.0", "STEP = 5.0")
    assert python(CALL, folder, cache)[0] == ["60.0", "0"]


def test_a_package_that_is_only_imported_does_not_load_numba(tmp_path):
    assert python("import sys, roofbench; print('numba' in sys.modules)", tmp_path, tmp_path)[0] == ["False"]


@kernel
def shifted(x, step):
    return x + step


@kernel
def shifted_twice(x):
    return shifted(x, 1) * shifted(x, step=2)


def test_a_kernel_is_compiled_once_whatever_constants_it_is_called_with(tmp_path, monkeypatch):
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    assert shifted_twice(1.0) == 6.0
    assert len(shifted.signatures) == 1
