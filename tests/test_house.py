"""The house: packages are listed, imports run downwards, and the public names are there."""

import ast
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import roofbench

ROOT = Path(roofbench.__file__).parent
PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())

#: Room to the rooms that it may import from.
FLOORS = {
    "core": {"core"},
    "scenes": {"scenes", "core"},
    "evaluators": {"evaluators", "scenes", "core"},
    "detectors": {"detectors", "scenes", "core"},
    "reports": {"reports", "evaluators", "detectors", "scenes", "core"},
    "benchmark": {"benchmark", "reports", "evaluators", "detectors", "scenes", "core"},
    "cli": {"cli", "benchmark", "reports", "evaluators", "detectors", "scenes", "core"},
}


MODULES = [path for room in FLOORS for path in sorted((ROOT / room).rglob("*.py"))]


def imports(path):
    """Yield (line, whether relative, first room or package) for every import of a module."""
    package = path.relative_to(ROOT).parent.parts
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, False, name.name.split(".")[0]) for name in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield node.lineno, False, node.module.split(".")[0]
        elif isinstance(node, ast.ImportFrom):
            target = (*package[: len(package) - node.level + 1], *(node.module or "").split("."))
            names = [target[0]] if target[0] else [name.name for name in node.names]
            yield from ((node.lineno, True, name) for name in names)


def test_the_packages_are_those_of_the_tree():
    listed = set(PROJECT["tool"]["setuptools"]["packages"])
    root = Path(__file__).parents[1]
    found = {"roofbench"}
    for room in FLOORS:
        for init in (root / room).rglob("__init__.py"):
            found.add(".".join(("roofbench", *init.parent.relative_to(root).parts)))
    assert listed == found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_run_downwards_and_are_relative(path):
    allowed = FLOORS[path.relative_to(ROOT).parts[0]]
    upwards = [found for found in imports(path) if found[1] and found[2] in FLOORS and found[2] not in allowed]
    bare = [found for found in imports(path) if not found[1] and found[2] in {*FLOORS, "roofbench"}]
    assert not upwards
    assert not bare


def test_every_public_name_is_there():
    for name in roofbench.__all__:
        assert getattr(roofbench, name) is not None
    assert set(roofbench.__all__) <= set(dir(roofbench))
    with pytest.raises(AttributeError, match="no attribute 'detekt'"):
        _ = roofbench.detekt


def test_the_version_is_said_once():
    assert roofbench.__version__ == PROJECT["project"]["version"]


@pytest.mark.parametrize("chosen", [None, "elsewhere"])
def test_compiled_kernels_are_kept_outside_the_package_and_where_the_user_says(chosen, tmp_path):
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    if chosen:
        environment["NUMBA_CACHE_DIR"] = str(tmp_path / chosen)
    code = "import numpy, roofbench.detectors.mpp.rectangles as r; print(r.overlap_area(*numpy.ones((2, 5))))"
    subprocess.run([sys.executable, "-c", code], check=True, env=environment, cwd=tmp_path, capture_output=True)
    kept = [path.relative_to(tmp_path).parts[0] for path in tmp_path.rglob("*.nbi")]
    assert set(kept) == {chosen or "roofbench"}
