"""The six tasks of a first hour, in an empty environment with empty caches: seconds by the clock and of the CPU.

``python -m tests.performance.first_hour`` installs the package from this clone with its dependencies from the package
index, so it needs a network. Reading and typing are not part of the times.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_TWO_FILES = (
    "import geopandas, shapely, roofbench as rb; scene = rb.open_scene('delft'); "
    "frame = scene.reference.to_geopandas(); frame['bag_id'] = [str(n) for n in range(len(frame))]; "
    "frame[['bag_id', 'geometry']].to_file('register.gpkg'); "
    "rb.write_footprints(rb.detect(scene, 'ndsm'), 'detected.gpkg')"
)
#: Task, and the commands that a reader of README and guide types.
TASKS = (
    ("install", [f"{sys.executable} -m venv env", f"env/bin/pip install -q {ROOT} pytest"]),
    ("first picture: leaderboard and report", ["roofbench run -q"]),
    (
        "two own files compared",
        ["roofbench evaluate detected.gpkg register.gpkg --building-id bag_id --verdicts v.gpkg --plot v.png"],
    ),
    (
        "own detector on the leaderboard",
        [
            "roofbench new detector my-detector",
            "cd my-detector && pytest -q",
            "roofbench run quick -q -d my-detector/my_detector.py:MyDetector -d ndsm",
        ],
    ),
    (
        "own scene imported",
        [
            "roofbench scenes import tile.laz --reference register.gpkg --building-id bag_id -o my-scene",
            "roofbench run my-scene -q -d my-detector/my_detector.py:MyDetector -d ndsm",
        ],
    ),
    (
        "gate in CI",
        [
            "roofbench baseline save -q -d my-detector/my_detector.py:MyDetector -o baseline.json",
            "roofbench gate baseline.json",
        ],
    ),
)


def _seconds() -> tuple[float, float]:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter(), used.ru_utime + used.ru_stime


def main() -> None:
    """Do the tasks one after another; print a table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = f"{folder / 'env' / 'bin'}{os.pathsep}{os.environ['PATH']}"
        environment = {**os.environ, "HOME": name, "XDG_CACHE_HOME": f"{name}/cache", "PATH": path, "PYTHONPATH": ""}

        def run(command: str) -> None:
            subprocess.run(["bash", "-c", command], cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)

        print("| task | commands | by the clock, s | CPU, s |\n|---|--:|--:|--:|")
        for task, commands in TASKS:
            if task.startswith("two own"):
                run(f'python -c "{_TWO_FILES}"')
            if task.startswith("own scene"):
                run(f"cp {ROOT}/scenes/data/delft/points.laz tile.laz")
            before = _seconds()
            for command in commands:
                run(command)
            clock, cpu = (after - start for after, start in zip(_seconds(), before, strict=True))
            print(f"| {task} | {len(commands)} | {clock:.0f} | {cpu:.0f} |", flush=True)


if __name__ == "__main__":
    main()
