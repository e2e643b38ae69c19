"""Run the commands and the Python of README.md as a new user would: a fresh clone, an empty virtual environment.

Argument: a folder that does not exist yet. The block with the test command is left out. Exit code 1 if one fails.
"""

import os
import re
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"```(?P<kind>sh|python)\n(?P<text>.*?)```", re.DOTALL)
#: The two files that the README compares.
FILES = """
import geopandas
import roofbench as rb

scene = rb.open_scene("delft")
rb.write_footprints(rb.detect(scene, "ndsm", seed=0), "detected.gpkg")
register = geopandas.GeoDataFrame(
    {"bag_id": [str(label) for label in scene.reference.ids]}, geometry=list(scene.reference.polygons), crs=scene.crs
)
register.to_file("register.gpkg")
"""


def main() -> int:
    """Return the exit code."""
    place = Path(sys.argv[1]).resolve()
    clone, environment = place / "clone", place / "environment"
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(clone)], check=True)
    venv.create(environment, with_pip=True)
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    variables = {
        **kept,
        "PATH": f"{environment / 'bin'}{os.pathsep}{kept['PATH']}",
        "NUMBA_CACHE_DIR": str(place / "c"),
    }
    text = (clone / "README.md").read_text(encoding="utf-8")
    blocks = [found for found in BLOCK.finditer(text) if "'.[test]'" not in found["text"]]
    steps = [(found["kind"], found["text"]) for found in blocks]
    installed = next(number for number, (_, text) in enumerate(steps) if "pip install" in text)
    steps.insert(installed + 1, ("python", FILES))
    for kind, text in steps:
        command = ["bash", "-euo", "pipefail", "-c", text] if kind == "sh" else ["python", "-c", text]
        print(f"--- {kind}\n{text.strip()}", flush=True)
        code = subprocess.run(command, cwd=clone, env=variables, check=False).returncode
        if code:
            print(f"exit code {code}")
            return 1
    print(f"{len(blocks)} blocks of README.md passed in a fresh clone with an empty environment")
    return 0


if __name__ == "__main__":
    sys.exit(main())
