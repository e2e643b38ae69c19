"""Start-up of ``roofbench evaluate`` on small files, beside the bare imports of the libraries that it needs.

Run by hand: ``python tests/performance/bench_start.py [--count 1000] [--repeats 9]``.

Processor seconds of whole processes (median), interpreter included; they alternate, so that other programs disturb both
alike. ``python -X importtime -m roofbench evaluate D R 2>imports.txt`` lists what takes the time; the script prints the
modules of compilers and plots among them, of which there must be none.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from bench_evaluate import city

_LIBRARIES = "import numpy, shapely, pyogrio, pyproj, typer, rich"
#: pandas and pyarrow are imported by pyogrio itself where they are installed.
_ABSENT = ("numba", "llvmlite", "matplotlib", "scipy", "rasterio", "distributed")


def processor(command):
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command)} failed")
    return usage.ru_utime + usage.ru_stime


def main():
    import roofbench as rb

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        paths = [str(Path(folder) / name) for name in ("d.fgb", "r.fgb")]
        for path, polygons in zip(paths, city(options.count)[:2], strict=True):
            rb.write_footprints(rb.Footprints.of(polygons, crs="EPSG:25832"), path)
        evaluate = [sys.executable, "-m", "roofbench", "evaluate", *paths]
        imports = [sys.executable, "-c", _LIBRARIES]
        runs = [(processor(evaluate), processor(imports)) for _ in range(options.repeats)]
        own, bare = (statistics.median(column) for column in zip(*runs, strict=True))
        print(f"roofbench evaluate, {options.count} x {options.count}: {own:.2f} s; imports alone: {bare:.2f} s")
        print(f"ratio {own / bare:.2f}")
        listed = subprocess.run(
            [sys.executable, "-X", "importtime", *evaluate[1:]], capture_output=True, text=True, check=True
        ).stderr
        modules = {line.rsplit("|", 1)[-1].strip().split(".")[0] for line in listed.splitlines() if "|" in line}
        print(f"loaded although not needed: {', '.join(sorted(modules & set(_ABSENT))) or 'nothing'}")


if __name__ == "__main__":
    main()
