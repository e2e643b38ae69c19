"""Time, memory and bits of a detector on a growing city: ``python tests/performance/bench_city.py SCENE WORK``.

A scene folder is mirrored to N x N copies (`mirrored_town`), kept in WORK for the next call. For each size the
detector runs tile by tile with two workers, and for one of them (``--compare``, 4 copies along each axis) also with
one worker and on a Dask cluster of separate processes (``--modes``), each from the files on disk to the footprints on
disk. Runs that WORK/city.csv holds already are not repeated. One line is printed and appended to WORK/city.csv for
each: wall time, processor time of all processes, the highest memory of a worker and of this process, points per
second, and the checksum of the output, which must not depend on the mode. WORK/city.png shows time and memory against
the number of copies on logarithmic axes, with a line of equal time per copy.

At the end all lines are printed as a Markdown table, with the processor seconds for a million points.

``--kill`` stops the run with two workers of that size when half of the tiles are done, by the signal KILL, and starts
it again: the result must be the same, and no finished tile is computed again. ``--peers`` adds other programs on the
scene itself; what is not installed is named.
"""

import argparse
import csv
import hashlib
import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

from mirrored_town import mirror

from roofbench.core.memory import highest_memory
from roofbench.scenes.folder import open_scene

COLUMNS = (
    "copies", "points", "detector", "mode", "tiles", "seconds", "cpu_seconds", "worker_mb", "driver_mb",
    "points_per_second", "footprints", "sha256",
)  # fmt: skip
#: Peers: what users of other tools would run, and our plain detectors beside it.
PEERS = ("mpp", "ndsm", "command[recipe=pysmrf]", "command[recipe=whitebox]", "command[recipe=cloth-filter]")


@contextmanager
def cluster(folder, workers):
    """Start a Dask scheduler and workers as processes; yield the address."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    environment = {**os.environ, "DASK_DISTRIBUTED__WORKER__DAEMON": "False"}

    def start(name, *words):
        command = [sys.executable, "-m", f"distributed.cli.{name}", *map(str, words), "--no-dashboard"]
        return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    processes = [start("dask_scheduler", "--host", "127.0.0.1", "--port", port)]
    try:
        for _ in range(workers):
            processes.append(
                start("dask_worker", address, "--nthreads", 1, "--no-nanny", "--local-directory", folder / "dask")
            )
        import distributed

        with distributed.Client(address, timeout="60s") as client:
            client.wait_for_workers(workers, timeout=120)
        yield address
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait()


def processor_time():
    """Return the processor time of the processes that ended, seconds."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


#: Names of the modes in the plot.
LABELS = {"jobs1": "1 job", "jobs2": "2 jobs", "dask": "Dask"}

#: What a child runs: a city, whose numbers it prints as JSON.
CHILD = """
import json, sys
from pathlib import Path
from roofbench.benchmark.execution.city import City, detect_city
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.core.memory import highest_memory
from roofbench.detectors.registry import make_detector
town, detector, output, tile, jobs, scheduler = sys.argv[1:]
execution = Execution(scheduler=scheduler) if scheduler else Execution(jobs=int(jobs))
found = detect_city(
    SceneRecipe.of_folder(town), make_detector(detector), Path(output), City(tile=float(tile)), execution=execution,
    overwrite=True, progress=lambda done, total, *_: print(done, total, file=sys.stderr, flush=True),
)
print(json.dumps([found.tiles, found.footprints, found.peak_memory, highest_memory(), len(found.failed), found.reused]))
"""


def start(town, detector, output, tile, jobs, scheduler=""):
    """Start a child."""
    words = [sys.executable, "-c", CHILD, town, detector, output, tile, jobs, scheduler]
    return subprocess.Popen([*map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def numbers(process):
    """Return what a child printed; stop where it failed."""
    import json

    printed, messages = process.communicate()
    if process.returncode:
        sys.exit(messages[-3000:])
    return json.loads(printed)


def measured(town, points, copies, mode, options):
    """Run one mode on one town and return its row."""
    output = options.work / f"{copies}" / mode / "city.fgb"
    output.parent.mkdir(parents=True, exist_ok=True)
    before, started = processor_time(), time.perf_counter()
    if mode == "dask":
        with cluster(options.work, 2) as address:
            found = numbers(start(town, options.detector, output, options.tile, 1, address))
    else:
        found = numbers(start(town, options.detector, output, options.tile, mode.removeprefix("jobs")))
    seconds = time.perf_counter() - started
    tiles, footprints, worker, driver, failed, _ = found
    if failed:
        sys.exit(f"{failed} tiles failed")
    return dict(
        zip(
            COLUMNS,
            (
                copies, points, options.detector, mode, tiles, round(seconds, 1), round(processor_time() - before, 1),
                round(worker / 1e6), round(driver / 1e6), round(points / seconds), footprints,
                hashlib.sha256(output.read_bytes()).hexdigest()[:16],
            ),
            strict=True,
        )
    )  # fmt: skip


def killed(town, copies, options):
    """Kill a run when half of its tiles are done, run it again, and return what is printed about it."""
    output = options.work / f"{copies}" / "killed" / "city.fgb"
    output.parent.mkdir(parents=True, exist_ok=True)
    process = start(town, options.detector, output, options.tile, 2)
    done, total, others = 0, 0, []
    for line in process.stderr:
        words = line.split()
        if len(words) != 2 or not all(word.isdigit() for word in words):
            others.append(line)  # a warning, or why the run failed
            continue
        done, total = map(int, words)
        if 2 * done >= total:
            break
    else:
        sys.exit("".join(others[-20:]))
    process.send_signal(signal.SIGKILL)
    process.communicate()
    started = time.perf_counter()
    *_, reused = numbers(start(town, options.detector, output, options.tile, 2))
    digest = hashlib.sha256(output.read_bytes()).hexdigest()[:16]
    seconds = time.perf_counter() - started
    return f"killed after {done} of {total} tiles; {reused} reused, the rest in {seconds:.0f} s, {digest}"


def peers(options, points):
    """Run other programs and ours on the scene itself, from files to footprints, and print points per second."""
    if shutil.which("pdal") is None:
        print("pdal: not installed on this machine, not measured")
    for name in PEERS:
        output = options.work / "peer.gpkg"
        command = [sys.executable, "-m", "roofbench", "detect", name, options.scene, "-o", output, "--overwrite", "-q"]
        # The first run compiles; the second is measured.
        for _ in range(2):
            before, started = processor_time(), time.perf_counter()
            code = subprocess.run([*map(str, command)], capture_output=True, text=True)
            seconds = time.perf_counter() - started
        if code.returncode:
            print(f"{name}: {code.stderr.strip().splitlines()[-1]}")
            continue
        print(
            f"{name}: {seconds:.1f} s, {processor_time() - before:.1f} CPU s, {points / seconds:.0f} points/s",
            flush=True,
        )


def in_markdown(rows):
    """Return the measured runs as a table."""
    lines = [
        "| copies | points | tiles | mode | clock, s | CPU, s | CPU s for a million points | memory of a worker "
        "| of the driver | footprints |",
        "|--:|--:|--:|---|--:|--:|--:|--:|--:|--:|",
    ]
    for row in rows:
        millions = int(row["points"]) / 1e6
        lines.append(
            f"| {row['copies']} | {millions:.1f} million | {row['tiles']} | {row['mode']} | {row['seconds']} | "
            f"{row['cpu_seconds']} | {float(row['cpu_seconds']) / millions:.1f} | {row['worker_mb']} MB | "
            f"{row['driver_mb']} MB | {row['footprints']} |"
        )
    return "\n".join(lines)


def finished(table):
    """Return copies, detector and mode of the runs that are measured."""
    if not table.exists():
        return set()
    with table.open(newline="") as stream:
        return {(row["copies"], row["detector"], row["mode"]) for row in csv.DictReader(stream)}


def plot(rows, path):
    """Draw time and memory against the number of copies."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for mode in dict.fromkeys(row["mode"] for row in rows):
        own = sorted(
            (int(row["copies"]), float(row["seconds"]), float(row["worker_mb"])) for row in rows if row["mode"] == mode
        )
        copies, seconds, memory = zip(*own, strict=True)
        left.loglog(copies, seconds, "o-", label=LABELS.get(mode, mode))
        right.loglog(copies, memory, "o-", label=LABELS.get(mode, mode))
    copies, seconds = zip(*sorted((int(row["copies"]), float(row["seconds"])) for row in rows), strict=True)
    left.loglog(copies, [seconds[-1] * n / copies[-1] for n in copies], "k:", label="equal time per copy")
    left.set(xlabel="copies of the scene", ylabel="time, s")
    right.set(xlabel="copies of the scene", ylabel="highest memory of a worker, MB", yscale="linear")
    right.set_ylim(bottom=0)
    for axis in (left.xaxis, right.xaxis, left.yaxis):
        axis.set_major_formatter("{x:g}")
    left.legend()
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scene", type=Path)
    parser.add_argument("work", type=Path)
    parser.add_argument("--sides", type=int, nargs="+", default=[1, 2, 4], help="copies along each axis")
    parser.add_argument("--compare", type=int, default=4, help="copies along each axis for all modes and --kill")
    parser.add_argument("--detector", default="mpp")
    parser.add_argument("--modes", nargs="+", default=["jobs1", "jobs2", "dask"])
    parser.add_argument("--tile", type=float, default=512.0)
    parser.add_argument("--kill", action="store_true")
    parser.add_argument("--peers", action="store_true")
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    points = len(open_scene(options.scene).points)
    table = options.work / "city.csv"
    if options.peers:
        peers(options, points)
    for side in options.sides:
        town, copies = options.work / f"town-{side}", side * side
        if not (town / "scene.toml").is_file():
            mirror(open_scene(options.scene), town, side, side)
        for mode in options.modes if side == options.compare else ("jobs2",):
            if (str(copies), options.detector, mode) in finished(table):
                continue
            row = measured(town, points * copies, copies, mode, options)
            is_new = not table.exists()
            with table.open("a", newline="") as stream:
                writer = csv.DictWriter(stream, COLUMNS)
                if is_new:
                    writer.writeheader()
                writer.writerow(row)
            print(", ".join(f"{name} {value}" for name, value in row.items()), flush=True)
        if options.kill and side == options.compare:
            print(killed(town, copies, options), flush=True)
    with table.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    plot(rows, options.work / "city.png")
    print(in_markdown(rows))
    for copies in dict.fromkeys(row["copies"] for row in rows):
        sums = {row["sha256"] for row in rows if row["copies"] == copies}
        print(f"{copies} copies: {'same bits in all modes' if len(sums) == 1 else f'DIFFERENT: {sums}'}")
    print(f"this process: {highest_memory() / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
