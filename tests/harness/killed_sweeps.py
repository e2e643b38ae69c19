"""Kill a sweep at random moments, resume it, and compare the store with that of an uninterrupted one.

The test suite does it with ten moments; by hand, with others every time:
``python -m tests.harness.killed_sweeps 10``.
"""

import os
import random
import signal
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from roofbench.benchmark.store.writer import Store

PLUGIN = f"{Path(__file__).parents[1] / 'plugins' / 'misbehaving.py'}:Misbehaving"


def start_sweep(store, jobs, sides):
    words = ["sweep", PLUGIN, "hamlet[seed=1]", "hamlet[seed=2]", "hamlet[seed=3]", "--vary", f"side=5:{4 + sides}:1"]
    words += ["--detector-seeds", "2", "-j", str(jobs), "--store", str(store), "-q"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "MISBEHAVING_SECONDS": "0.2"}
    command = [sys.executable, "-m", "roofbench", *words]
    return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def content(path):
    """Everything of a store that must not depend on interruptions: runs, detections, verdicts, bytes of the indices."""
    with Store(path, must_exist=True) as store:
        ((key, _),) = store.evaluators()
        rows = sorted(store.runs(), key=lambda row: row.key)
        values = store.index_values([row.id for row in rows], key)
        return [
            (
                row.key,
                row.status,
                row.label,
                row.scene,
                row.seed,
                [polygon.wkb for polygon in store.detections(row.id).polygons],
                {name: None if value is None else struct.pack("<d", value) for name, value in values[row.id].items()},
                [table.to_bytes() for table in store.verdict_tables(row.id, key)],
            )
            for row in rows
        ]


def count_runs(path):
    if not path.exists():
        return 0
    with Store(path) as store:
        return store.count_runs()


def kill_and_resume(folder, moments, *, sides, jobs=2, stream=0):
    """Return (how many runs were stored at each kill, content after resuming, content without interruption)."""
    draw = random.Random(stream)
    whole = start_sweep(folder / "whole.sqlite", jobs, sides)
    assert whole.wait() == 0, whole.stderr.read().decode()
    whole.stderr.close()
    total = sides * 6
    stored = [0]
    for _ in range(moments):
        process = start_sweep(folder / "killed.sqlite", jobs, sides)
        target = stored[-1] + draw.randint(0, max(1, total // (2 * moments)))
        while count_runs(folder / "killed.sqlite") < target and process.poll() is None:
            time.sleep(0.02)
        time.sleep(draw.uniform(0, 0.4))
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stderr.close()
        stored.append(count_runs(folder / "killed.sqlite"))
    resumed = start_sweep(folder / "killed.sqlite", jobs, sides)
    assert resumed.wait() == 0, resumed.stderr.read().decode()
    resumed.stderr.close()
    return stored[1:], content(folder / "killed.sqlite"), content(folder / "whole.sqlite")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    with tempfile.TemporaryDirectory() as name:
        at_kill, after, uninterrupted = kill_and_resume(Path(name), count, sides=8, stream=time.time_ns())
    print(f"killed {count} times with {at_kill} of {len(uninterrupted)} runs stored")
    print("equal run for run" if after == uninterrupted else "DIFFERENT")
    sys.exit(after != uninterrupted)
