"""Kill commands at random moments, run them again, and compare what they wrote with that of an uninterrupted call.

Stages: import, make, detect, run, sweep, report, and evaluate in parts, as national sets are. Ten kills of each:
``python -m tests.harness.killed_stages 10``, or of some: ``python -m tests.harness.killed_stages 10 import report``.
"""

import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from roofbench.benchmark.execution.run_time import processor_time
from roofbench.benchmark.store.writer import Store

__all__ = ["STAGES", "Result", "kill_stage"]

_SCENES = ("hamlet[seed=1]", "hamlet[seed=2]", "hamlet[seed=3]")
#: Arguments of each stage; OUT is what it writes, all else is made by `_prepare`.
STAGES = {
    "import": ("scenes", "import", "scene/points.laz", "--reference-from-class", "-q", "-o", "OUT"),
    "make": ("scenes", "make", "fairfield-3-small", "--seed", "1", "-o", "OUT"),
    "detect": ("detect", "ndsm", "scene", "-o", "OUT.gpkg"),
    "run": ("run", *_SCENES, "-d", "ndsm", "-j", "1", "-q", "--store", "OUT.sqlite"),
    "sweep": ("sweep", "ndsm", *_SCENES, "--vary", "height=2:4:1", "-j", "1", "-q", "--store", "OUT.sqlite"),
    "report": ("report", "runs.sqlite", "-o", "OUT.html"),
    "evaluate": (
        *("evaluate", "detected.gpkg", "scene/reference.gpkg", "--parts", "4"),
        *("--verdicts", "OUT.gpkg", "--format", "json"),
    ),
}
#: Names of the outputs that are compared: equally long, and no word that an output contains.
_WHOLE, _AGAIN = "uninterrupted-7q", "and-once-more-7q"
#: Dates in reports.
_DATE = re.compile(rb"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d)?(\+00:00|Z)?")


@dataclass(frozen=True)
class Result:
    """What kills of a stage showed.

    Attributes
    ----------
    kills : int
        Calls that were killed before they ended.
    partial : int
        Kills after which an output was there that is not whole.
    same : bool
        Whether the last, uninterrupted call wrote the same as a call that was never interrupted.
    """

    kills: int
    partial: int
    same: bool


def kill_stage(stage: str, folder: Path, kills: int, *, stream: int = 0) -> Result:
    """Return what kills at random moments of a stage show."""
    draw = random.Random(f"{stream}{stage}")
    _prepare(folder)
    start = time.monotonic()
    _finish(_start(stage, folder, _WHOLE))
    duration = time.monotonic() - start
    whole = _written(folder, _WHOLE)
    assert whole, f"{stage} writes nothing"
    done = partial = 0
    for _ in range(3 * kills):
        if done == kills:
            break
        process = _start(stage, folder, _AGAIN)
        try:
            process.wait(timeout=draw.uniform(0.2, 0.95) * duration)
            early = True
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            early, done = False, done + 1
        process.communicate()
        if stage in ("run", "sweep"):
            # What is stored is not run again: after a call that was faster than its kill, all work is to be done anew.
            found = _written(folder, _AGAIN) if (folder / f"{_AGAIN}.sqlite").exists() else []
            partial += any(row not in whole for row in found)
            if early:
                _remove(folder, _AGAIN)
        else:
            found = _written(folder, _AGAIN)
            partial += bool(found) and found != whole
            _remove(folder, _AGAIN)
    _finish(_start(stage, folder, _AGAIN))
    return Result(done, partial, _written(folder, _AGAIN) == whole)


def _prepare(folder: Path) -> None:
    _call(folder, "scenes", "make", "fairfield-3-small", "--seed", "2", "-o", "scene")
    _call(folder, "detect", "ndsm", "scene", "-o", "detected.gpkg")
    _call(folder, "run", *_SCENES[:2], "-d", "ndsm", "-j", "0", "-q", "--store", "runs.sqlite")


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "NUMBA_NUM_THREADS": "1"}


def _call(folder: Path, *words: str) -> None:
    command = [sys.executable, "-m", "roofbench", *words]
    subprocess.run(command, cwd=folder, env=_environment(), check=True, capture_output=True)


def _start(stage: str, folder: Path, name: str) -> subprocess.Popen[bytes]:
    words = [word.replace("OUT", name) for word in STAGES[stage]]
    command = [sys.executable, "-m", "roofbench", *words]
    return subprocess.Popen(
        command,
        cwd=folder,
        env=_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def _finish(process: subprocess.Popen[bytes]) -> None:
    _, stderr = process.communicate()
    assert process.returncode == 0, stderr.decode()


def _written(folder: Path, name: str) -> list[object]:
    """Return everything of an output that must not depend on interruptions."""
    store = folder / f"{name}.sqlite"
    if store.exists():
        return _stored(store)
    found: list[object] = []
    for top in sorted(folder.glob(f"{name}*")):
        files = [top] if top.is_file() else sorted(path for path in top.rglob("*") if path.is_file())
        for file in files:
            inside = file.relative_to(folder).as_posix().removeprefix(name)
            data = file.read_bytes().replace(name.encode(), b"OUT")
            found.append((inside, _DATE.sub(b"DATE", data)))
    return found


def _stored(path: Path) -> list[object]:
    """Return the runs of a store in order of their keys: detections, and indices by evaluator."""
    with Store(path, must_exist=True) as store:
        rows = sorted(store.runs(), key=lambda row: row.key)
        keys = sorted(key for key, _ in store.evaluators())
        values = {key: store.index_values([row.id for row in rows], key) for key in keys}
        return [
            (
                row.key,
                row.status,
                [polygon.wkb for polygon in store.detections(row.id).polygons],
                [repr(values[key].get(row.id)) for key in keys],
            )
            for row in rows
        ]


def _remove(folder: Path, name: str) -> None:
    for top in folder.glob(f"{name}*"):
        shutil.rmtree(top) if top.is_dir() else top.unlink()


def _main() -> int:
    kills = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    failed = 0
    for stage in sys.argv[2:] or STAGES:
        start = processor_time()
        with tempfile.TemporaryDirectory() as name:
            result = kill_stage(stage, Path(name), kills, stream=time.time_ns())
        good = result.same and not result.partial and result.kills == kills
        failed += not good
        print(
            f"{stage:9s} {result.kills:3d} kills  {result.partial} partial outputs  "
            f"{'same result' if result.same else 'DIFFERENT RESULT'}  {processor_time() - start:4.0f} s CPU",
            flush=True,
        )
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(_main())
