"""Time listing and filtering of a store of 100 000 runs: ``python tests/performance/bench_store.py``."""

import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from roofbench.benchmark.identity.keys import SourceClosure
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe
from roofbench.benchmark.store.outcomes import Cost, Outcome
from roofbench.benchmark.store.records import RunIdentity
from roofbench.benchmark.store.writer import Store

RUNS, REPEATS = 100_000, 5


def fill(store):
    """Store runs of 100 detectors on 100 scenes with 10 seeds, one transaction for all of them."""
    code = SourceClosure({"module": "digest"}, {"numpy": "2"})
    scenes = [SceneRecipe.of_preset("hamlet", seed=seed) for seed in range(100)]
    ok = Outcome(status="ok", cost=Cost(seconds=1.0, cpu_seconds=1.0, peak_memory=100_000_000))
    failed = Outcome(status="failed", reason="ValueError: no", traceback="Traceback")
    store._db.execute("PRAGMA synchronous = OFF")
    for scene in scenes:
        key = scene.key
        for number in range(RUNS // 100):
            identity = RunIdentity(
                detector=PluginRecipe("ndsm", {"height": number // 10}),
                label=f"ndsm[height={number // 10}]",
                fingerprint="",
                code=code,
                scene=scene,
                scene_key=key,
                seed=number % 10,
            )
            store.record(identity, failed if number % 50 == 0 else ok, version="1")


def median(function):
    times = []
    for _ in range(REPEATS):
        started = time.process_time()
        function()
        times.append(time.process_time() - started)
    return statistics.median(times)


def process_median(command):
    """Return the median processor and wall seconds of a process, as text."""
    used, wall = [], []
    for _ in range(REPEATS):
        before, started = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        wall.append(time.perf_counter() - started)
    return f"{statistics.median(used):6.3f} s CPU, {statistics.median(wall):6.3f} s wall"


def main():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "big.sqlite"
        with Store(path) as store:
            started = time.process_time()
            fill(store)
            print(f"recording {RUNS} runs: {(time.process_time() - started) / RUNS * 1e3:.2f} ms CPU each")
        with Store(path) as store:
            print(f"list all            {median(lambda: store.runs()):6.3f} s CPU")
            print(f"failed ones         {median(lambda: store.runs(status='failed')):6.3f} s CPU")
            print(f"by detector pattern {median(lambda: store.runs(detector='ndsm[[]height=7?]')):6.3f} s CPU")
            print(f"by scene pattern    {median(lambda: store.runs(scene='hamlet-1?')):6.3f} s CPU")
            keys = [row.key for row in store.runs(limit=20_000)]
            print(f"status of 20000 keys {median(lambda: store.statuses(keys)):5.3f} s CPU")
        for words in (
            "-n 0",
            "-n 0 -f csv",
            "-n 0 -f json",
            "-n 0 --status failed",
            "-n 0 --detectors ndsm[[]height=7?]",
            "-n 0 --scenes hamlet-1?",
            "--status failed --scenes hamlet-1*",
        ):
            command = [sys.executable, "-m", "roofbench", "ls", "--store", str(path), *words.split()]
            print(f"roofbench ls {words:36} {process_median(command)}, whole process")


if __name__ == "__main__":
    main()
