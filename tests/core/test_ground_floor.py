"""What evaluating two files needs: the ground floor stands on numpy, shapely and pyogrio (pyproj for their CRS)."""

import json
import subprocess
import sys
import textwrap

import pytest
import shapely

import roofbench as rb

#: Packages that take long to load, or that an environment for evaluation alone lacks.
HEAVY = (
    "numba",
    "llvmlite",
    "pandas",
    "geopandas",
    "pyarrow",
    "matplotlib",
    "rasterio",
    "cv2",
    "scipy",
    "laspy",
    "PIL",
)
#: Those that an interpreter may load when it starts.
OF_THE_SYSTEM = {"sitecustomize", "usercustomize"}
#: Those that pyogrio loads by itself where they are installed.
OF_PYOGRIO = {"pandas", "geopandas", "pyarrow"}

EVALUATE = """
import sys
from roofbench.cli.main import main
sys.argv = ["roofbench", "evaluate", "detected.gpkg", "reference.geojson", "--format", "json"]
try:
    main()
except SystemExit as end:
    assert not end.code, end.code
print(*{name.partition(".")[0] for name in sys.modules}, file=sys.stderr)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("two files")
    squares = shapely.box([0, 20, 40], [0, 0, 0], [10, 30, 50], [10, 10, 10])
    rb.write_footprints(rb.Footprints.of(squares[:2], crs="EPSG:25832"), folder / "detected.gpkg")
    rb.write_footprints(rb.Footprints.of(squares, crs="EPSG:25832"), folder / "reference.geojson")
    return folder


def evaluated(folder, before=""):
    """Run the command in a new interpreter; return its counts, and the packages that it loaded."""
    code = textwrap.dedent(before) + EVALUATE
    environment = {"PYTHONPATH": ":".join(filter(None, sys.path)), "PATH": ""}
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["counts"], set(done.stderr.split())


def test_evaluating_two_files_works_without_any_heavy_package(folder):
    counts, _ = evaluated(
        folder,
        f"""
        import sys
        class Absent:
            def find_spec(self, name, path=None, target=None):
                if name.partition(".")[0] in {HEAVY!r}:
                    raise ModuleNotFoundError(f"no module named {{name}}", name=name)
        sys.meta_path.insert(0, Absent())
        """,
    )
    assert (counts["true_positives"], counts["false_negatives"], counts["false_positives"]) == (2, 1, 0)


def test_evaluating_two_files_loads_no_heavy_package_by_itself(folder):
    assert evaluated(folder)[1].isdisjoint(set(HEAVY) - OF_PYOGRIO)


def test_the_ground_floor_is_imported_with_numpy_and_shapely_alone(tmp_path):
    code = (
        "import sys, roofbench.scenes.geodata.footprints, roofbench.core.parameters, roofbench.core.registry, "
        "roofbench.core.output; print(*{name.partition('.')[0] for name in sys.modules})"
    )
    environment = {"PYTHONPATH": ":".join(filter(None, sys.path)), "PATH": ""}
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    loaded = {name for name in done.stdout.split() if name not in sys.stdlib_module_names and not name.startswith("_")}
    assert loaded <= {"roofbench", "numpy", "shapely", "cython_runtime", *OF_THE_SYSTEM}
