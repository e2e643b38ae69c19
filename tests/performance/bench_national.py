"""Time and memory of a comparison in parts, beside SedonaDB's bare join of the same files.

Run by hand: ``python tests/performance/bench_national.py [--sizes 10000,100000,1000000] [--folder FOLDER]``.

Each size is the city of ``bench_evaluate.py`` as two GeoParquet files (several such cities side by side beyond one
million footprints). Measured in processes of their own, one after the other:

- *join*: SedonaDB reads both files, joins them by ST_Intersects and sums ST_Area(ST_Intersection): no matching, no
  indices, no verdicts (where `sedonadb` is installed);
- *evaluate*: ``roofbench evaluate --parts`` with the verdicts of all objects as GeoParquet.

Seconds are wall time; *processor* counts those of all processes and threads; memory is that of all processes together.
Each row is added to ``measured.json`` in the folder; ``--plot FILE`` draws the last one of each size.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

_JOIN = """
import sys, sedonadb
sd = sedonadb.connect()
for name, file in zip("dr", sys.argv[1:]):
    sd.read_parquet(file).to_view(name)
sd.sql(
    "SELECT COUNT(*), SUM(ST_Area(ST_Intersection(d.geometry, r.geometry))) "
    "FROM d JOIN r ON ST_Intersects(d.geometry, r.geometry)"
).show()
"""
_CITY = 1_000_000


def write_cities(count, folder):
    """Write the two files, one city at a time, and return their paths."""
    import pyarrow
    import pyarrow.parquet
    import pyproj
    import shapely
    from bench_evaluate import city

    paths = [folder / f"{side}-{count}.parquet" for side in ("detected", "reference")]
    outline = {"encoding": "WKB", "geometry_types": ["Polygon"], "crs": pyproj.CRS("EPSG:25832").to_json_dict()}
    facts = {"version": "1.0.0", "primary_column": "geometry", "columns": {"geometry": outline}}
    fields = [("geometry", pyarrow.binary()), ("building_id", pyarrow.int64())]
    schema = pyarrow.schema(fields, metadata={"geo": json.dumps(facts)})
    with (
        pyarrow.parquet.ParquetWriter(paths[0], schema) as detected,
        pyarrow.parquet.ParquetWriter(paths[1], schema) as reference,
    ):
        for number, begin in enumerate(range(0, count, _CITY)):
            own = min(_CITY, count - begin)
            found, truth, building = city(own, seed=number + 1)
            for writer, polygons in ((detected, found), (reference, truth)):
                # Cities stand side by side, 30 km apart; false alarms are 1000 km away from them.
                points = shapely.get_coordinates(polygons)
                points += [3e4 * (number % 4), 3e4 * (number // 4)]
                wkb = shapely.to_wkb(shapely.set_coordinates(polygons, points))
                table = pyarrow.table([pyarrow.array(wkb, pyarrow.binary()), building + begin], schema=schema)
                writer.write_table(table)
    return [str(path) for path in paths]


def measured(command, *, environment=None):
    """Return what a command printed or its last line of error, and its seconds, processor seconds and memory (GB).

    The memory is the largest sum over the process and its children, looked at five times a second, or the peak of the
    largest one, whichever is more.
    """
    import psutil

    clock = time.perf_counter()
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        process = subprocess.Popen(command, stdout=output, stderr=errors, env=environment)
        most, ended, status, usage = 0, 0, 0, None
        while not ended:
            ended, status, usage = os.wait4(process.pid, os.WNOHANG)
            with contextlib.suppress(psutil.Error):
                own = psutil.Process(process.pid)
                most = max(most, sum(each.memory_info().rss for each in (own, *own.children(recursive=True))))
            time.sleep(0 if ended else 0.2)
        seconds = time.perf_counter() - clock
        output.seek(0)
        errors.seek(0)
        said = output.read().strip() if not status else f"failed: {errors.read().strip().splitlines()[-1:]}"
    processor = usage.ru_utime + usage.ru_stime
    memory = max(usage.ru_maxrss / 2**20, most / 2**30)
    return {"said": said, "seconds": seconds, "processor": processor, "memory": memory}


def plotted(rows, file):
    """Draw processor seconds over size, both on logarithmic axes, beside a line of cost in proportion."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5, 4), layout="constrained")
    axes = figure.subplots()
    for what, mark, colour in (("evaluate", "o", "#0072b2"), ("join", "s", "#d55e00")):
        points = sorted({row["size"]: row["processor"] for row in rows if row["what"] == what}.items())
        axes.plot(*zip(*points, strict=True), marker=mark, color=colour, label=f"{what} ({len(points)} sizes)")
    size, seconds = max((row["size"], row["processor"]) for row in rows if row["what"] == "evaluate")
    axes.plot([size / 1000, size], [seconds / 1000, seconds], color="grey", linestyle=":", label="in proportion")
    axes.set(xscale="log", yscale="log", xlabel="footprints on each side", ylabel="processor seconds")
    axes.legend(frameon=False)
    figure.savefig(file, dpi=120)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="10000,100000,1000000")
    parser.add_argument("--folder", type=Path, default=Path("national"))
    parser.add_argument("--no-join", action="store_true", help="leave SedonaDB out")
    parser.add_argument("--only-write", action="store_true", help="only write the files")
    parser.add_argument("--plot", type=Path, help="draw what has been measured in the folder")
    options = parser.parse_args()
    options.folder.mkdir(exist_ok=True)
    record = options.folder / "measured.json"
    rows = json.loads(record.read_text()) if record.exists() else []
    if options.plot:
        plotted(rows, options.plot)
        return
    print(f"{'size':>10} {'what':>9} {'seconds':>8} {'processor':>9} {'GB':>6}")
    for size in map(int, options.sizes.split(",")):
        paths = [str(options.folder / f"{side}-{size}.parquet") for side in ("detected", "reference")]
        if not all(map(os.path.exists, paths)):
            if not options.only_write:  # in a process of its own, whose memory is not counted for those that follow
                here = [sys.executable, __file__, "--sizes", str(size), "--folder", str(options.folder)]
                subprocess.run([*here, "--only-write"], check=True, stdout=subprocess.DEVNULL)
            else:
                write_cities(size, options.folder)
        if options.only_write:
            continue
        verdicts = str(options.folder / f"verdicts-{size}.parquet")
        evaluate = [sys.executable, "-m", "roofbench", "evaluate", *paths, "--verdicts", verdicts, "--overwrite"]
        runs = {"evaluate": [*evaluate, "--parts", str(1 + size // 200_000), "-q"]}
        if not options.no_join:
            runs = {"join": [sys.executable, "-c", _JOIN, *paths]} | runs
        for what, command in runs.items():
            found = measured(command)
            if found["said"].startswith("failed"):
                raise SystemExit(f"{what}: {found['said']}")
            rows.append({"size": size, "what": what} | found)
            record.write_text(json.dumps(rows))
            figures = f"{found['seconds']:>8.1f} {found['processor']:>9.1f} {found['memory']:>6.2f}"
            print(f"{size:>10,} {what:>9} {figures}", flush=True)


if __name__ == "__main__":
    main()
