"""``roofbench new``: what it writes works as it is."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from harness.command_line import roofbench

import roofbench as rb
from roofbench.benchmark.scaffold import TEMPLATES, write_template
from roofbench.core.errors import OutputError, ParameterError


@pytest.fixture(params=TEMPLATES)
def written(request, tmp_path):
    """Return a template and the folder that it was written to."""
    names = {"detector": "first-try", "evaluator": "cover", "suite": "my-city", "plugin-package": "own-tools"}
    name = names[request.param]
    files = roofbench("new", request.param, name, folder=tmp_path).stdout.split()
    assert sorted(files) == sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file())
    return request.param, tmp_path / name


def test_its_own_tests_pass(written):
    _, folder = written
    environment = {**os.environ, "PYTHONPATH": str(Path(rb.__file__).parents[1])}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout


def test_its_files_are_complete(written):
    template, folder = written
    texts = {path.name: path.read_text(encoding="utf-8") for path in folder.rglob("*") if path.is_file()}
    assert not [name for name, text in texts.items() if re.search(r"@\w+@", name + text)]
    (workflow,) = folder.glob(".github/workflows/*.yml")
    assert "pytest" in workflow.read_text()
    if template in ("detector", "evaluator"):
        project = tomllib.loads(texts["pyproject.toml"])
        ((name, target),) = project["project"]["entry-points"][f"roofbench.{template}s"].items()
        module, _, attribute = target.partition(":")
        assert name == folder.name
        assert f"class {attribute}(" in texts[f"{module}.py"]


def test_the_plugins_of_an_installed_package_are_found_by_name(tmp_path):
    """Without a package index: its metadata are written by the setuptools at hand, as an editable installation does."""
    roofbench("new", "plugin-package", "own-tools", folder=tmp_path)
    folder = tmp_path / "own-tools"
    command = [sys.executable, "-c", "import setuptools; setuptools.setup()", "-q", "egg_info"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    path = os.pathsep.join([str(folder / "src"), str(Path(rb.__file__).parents[1])])
    code = (
        "import roofbench as rb\n"
        "print(rb.make_detector('own-tools', height=3), rb.make_evaluator('own-tools-score'))\n"
        "print(len(rb.detect('hamlet', 'own-tools')))"
    )
    environment = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, env=environment)
    assert done.stdout.splitlines()[0] == "OwnTools(height=3.0) OwnToolsScore()", done.stderr
    assert int(done.stdout.splitlines()[1]) > 0
    # The tests of the package name the detector by its file, which is installed now.
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    other = tmp_path / "other.py"
    other.write_text((folder / "src" / "own_tools" / "detector.py").read_text() + "# changed\n")
    command = [sys.executable, "-m", "roofbench", "info", f"{other}:OwnTools"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment)
    assert "a detector called 'own-tools' exists already" in done.stderr


def test_a_new_detector_gets_on_the_leaderboard(tmp_path):
    roofbench("new", "detector", "own", folder=tmp_path)
    board = roofbench("run", "hamlet", "-d", "own/own.py:Own", "-j", 0, folder=tmp_path).stdout
    assert "own" in board


@pytest.mark.parametrize("name", ["Own", "1st", "my detector", "../own", "own.py", ""])
def test_a_name_that_is_no_name_is_refused(name, tmp_path):
    with pytest.raises(ParameterError, match="cannot be used as a name"):
        write_template("detector", name, tmp_path / "folder")
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_taken_is_refused(tmp_path):
    for template, name in (("detector", "ndsm"), ("evaluator", "threshold-free"), ("suite", "quick")):
        with pytest.raises(ParameterError, match="is already the name of another"):
            write_template(template, name, tmp_path / name)


def test_nothing_is_overwritten(tmp_path):
    with pytest.raises(OutputError, match="exists already"):
        write_template("suite", "own", tmp_path)
