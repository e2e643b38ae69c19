"""The source archive and the wheel: what is in them, and that they run without the repository.

Marked `slow`: the archives are built once. ``.ci/nightly package`` also installs the dependencies from the index.
"""

import os
import subprocess
import sys
import sysconfig
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("core", "scenes", "evaluators", "detectors", "benchmark", "reports", "cli")
#: Written by Python, or not part of an installed package.
NOT_PACKAGED = {".pyc", ".nbi", ".nbc"}

build = pytest.importorskip("build", reason="the extra [test] brings the package build")
setuptools = pytest.importorskip("setuptools", minversion="77", reason="the extra [test] brings setuptools 77")
pytestmark = pytest.mark.slow


def succeed(*command, folder, **environment):
    """Run a command that must end with 0; return its standard output."""
    ended = subprocess.run(
        [str(part) for part in command],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        env={**os.environ, "PYTHONPATH": "", "PYTHONWARNINGS": "", **environment},
    )
    assert ended.returncode == 0, f"{command}\n{ended.stdout}\n{ended.stderr}"
    return ended.stdout


@pytest.fixture(scope="module")
def archives(tmp_path_factory):
    """Build both as ``python -m build`` does, the wheel from the source archive."""
    folder = tmp_path_factory.mktemp("dist")
    before = set(ROOT.iterdir())
    succeed(sys.executable, "-m", "build", "--no-isolation", "-o", folder, ROOT, folder=folder)
    left = {path.name for path in set(ROOT.iterdir()) - before}
    (source,), (wheel,) = folder.glob("*.tar.gz"), folder.glob("*.whl")
    return source, wheel, left


def packaged_files():
    """Return the files of the package in the repository, by their path in the package."""
    rooms = [path for room in ROOMS for path in (ROOT / room).rglob("*") if path.is_file()]
    files = [*rooms, ROOT / "py.typed", ROOT / "__init__.py", ROOT / "__main__.py"]
    return {path.relative_to(ROOT).as_posix() for path in files if path.suffix not in NOT_PACKAGED}


def test_a_build_leaves_nothing_in_the_clone(archives):
    assert archives[2] - {"__pycache__"} == set()


def test_the_wheel_has_every_file_of_the_package_and_no_other(archives):
    with zipfile.ZipFile(archives[1]) as wheel:
        names = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert names == {f"roofbench/{name}" for name in packaged_files()}


def test_the_source_archive_has_what_a_build_needs(archives):
    with tarfile.open(archives[0]) as source:
        names = {member.name.partition("/")[2] for member in source.getmembers() if member.isfile()}
    assert packaged_files() | {"pyproject.toml", "README.md", "LICENSE", "CITATION.cff", "CHANGELOG.md"} <= names


def test_the_wheel_runs_in_an_empty_environment_outside_the_clone(archives, tmp_path):
    # Nothing but the dependencies is shared with this environment: a path file adds them, but not the editable
    # installation of roofbench, because path files inside that folder are not read.
    succeed(sys.executable, "-m", "venv", "--without-pip", tmp_path / "empty", folder=tmp_path)
    packages = sysconfig.get_path("purelib", vars={"base": str(tmp_path / "empty")})
    with zipfile.ZipFile(archives[1]) as wheel:
        wheel.extractall(packages)
    shared = [path for path in sys.path if path.endswith("site-packages")]
    (Path(packages) / "shared.pth").write_text("\n".join(shared))
    python = tmp_path / "empty" / "bin" / "python"

    def roofbench(*arguments):
        return succeed(python, "-P", "-m", "roofbench", *arguments, folder=tmp_path)

    where = succeed(python, "-P", "-c", "import roofbench; print(roofbench.__file__)", folder=tmp_path)
    assert Path(where.strip()).is_relative_to(tmp_path)
    assert roofbench("--version").startswith("roofbench ")
    assert "delft" in roofbench("list", "scenes")
    roofbench("new", "detector", "first")
    roofbench("run", "hamlet", "ign", "-d", "first/first.py:First", "-q", "-j", "0", "-o", "out")
    assert (tmp_path / "out" / "report.html").stat().st_size > 100_000


def test_the_conda_recipe_names_the_dependencies_of_the_package():
    import tomllib

    recipe = (ROOT / "packaging" / "conda-forge" / "recipe.yaml").read_text(encoding="utf-8")
    run = recipe.partition("  run:\n")[2].partition("\ntests:")[0]
    named = {line.split()[1] for line in run.splitlines() if line.strip().startswith("- ")} - {"python"}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = {requirement.partition(">=")[0].partition("[")[0] for requirement in project["dependencies"]}
    # The names of conda-forge; lazrs is the extra of laspy.
    other = {"matplotlib": "matplotlib-base", "opencv-python-headless": "py-opencv"}
    assert named == {other.get(name, name) for name in asked} | {"lazrs-python"}
    from roofbench.core.package import VERSION

    assert f"version: {VERSION}\n" in recipe
