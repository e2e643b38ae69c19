"""Other tools on the same files in one run: seconds, processor seconds, memory, and what they find.

Run by hand: ``python tests/performance/bench_peers.py [--sizes 10000,100000] [--folder FOLDER] [--peers PYTHON]``.

The files are those of ``bench_national.py``. Each tool runs in a process of its own, one after the other:

- *roofbench*: all 15 indices, and the verdict and reason of each object written as GeoParquet;
- *sedonadb*: join by ST_Intersects, sum of ST_Area(ST_Intersection): no matching, no indices;
- *geopandas*: ``overlay(how="intersection")``, sum of areas: no matching, no indices;
- *faster-coco-eval*: average precision of COCO over image chips of 128 m and 0.25 m, each object in the chip of its
  centre; building the chips is not timed;
- *solaris*: its matching rule (IoU of 0.5, each detection takes its best free reference) by its own function, up to
  `--most-solaris` footprints, since each detection is compared with every reference.

solaris and faster-coco-eval are run by `--peers`, the Python of a scratch environment: ``python -m venv peers &&
peers/bin/pip install --no-deps solaris faster-coco-eval`` (its other libraries come from this environment). solaris
0.4.0 imports ``gdal``, which GDAL 3 no longer has; where the package does not import, its file ``eval/iou.py`` is
loaded alone and the row says so.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import sysconfig
from pathlib import Path

from bench_national import measured

PROGRAMS = {
    "sedonadb": """
import sys, pyarrow, sedonadb
sd = sedonadb.connect()
for name, file in zip("dr", sys.argv[1:]):
    sd.read_parquet(file).to_view(name)
table = pyarrow.table(sd.sql(
    "SELECT COUNT(*) AS pairs, SUM(ST_Area(ST_Intersection(d.geometry, r.geometry))) AS area "
    "FROM d JOIN r ON ST_Intersects(d.geometry, r.geometry)"
))
pairs, area = (table.column(name)[0].as_py() for name in ("pairs", "area"))
print(f"{sedonadb.__version__}: {pairs} pairs, {area:.1f} m2")
""",
    "geopandas": """
import sys, geopandas
one, two = (geopandas.read_parquet(file) for file in sys.argv[1:])
common = geopandas.overlay(one, two, how="intersection", keep_geom_type=True)
print(f"{geopandas.__version__}: {len(common)} pairs, {common.area.sum():.1f} m2")
""",
    "solaris": """
import importlib.metadata, importlib.util, sys, geopandas
how = "as a package"
try:
    from solaris.eval.iou import calculate_iou
except ImportError as error:
    how = f"eval/iou.py alone, since the package does not import ({error})"
    folder = importlib.util.find_spec("solaris").submodule_search_locations[0]
    described = importlib.util.spec_from_file_location("iou", folder + "/eval/iou.py")
    module = importlib.util.module_from_spec(described)
    described.loader.exec_module(module)
    calculate_iou = module.calculate_iou
found, free = (geopandas.read_parquet(file) for file in sys.argv[1:])
hits = 0
for polygon in found.geometry:
    scores = calculate_iou(polygon, free)
    if len(scores) and scores["iou_score"].max() >= 0.5:
        free = free.drop(scores["iou_score"].idxmax())
        hits += 1
print(f"{importlib.metadata.version('solaris')} ({how}): {hits} true positives")
""",
    "faster-coco-eval": """
import sys, time, json, resource, numpy as np, geopandas, faster_coco_eval
from faster_coco_eval import COCO, COCOeval_faster
CHIP, GSD = 128.0, 0.25
sides, chips = [], {}
for file in sys.argv[1:]:
    frame = geopandas.read_parquet(file)
    rows = []
    for polygon in frame.geometry:
        x, y = polygon.centroid.coords[0]
        corner = (x // CHIP, y // CHIP)
        chip = chips.setdefault(corner, len(chips) + 1)
        ring = (np.array(polygon.exterior.coords)[:-1] - np.multiply(corner, CHIP)) / GSD
        low, high = ring.min(axis=0), ring.max(axis=0)
        rows.append({"id": len(rows) + 1, "image_id": chip, "category_id": 1, "iscrowd": 0, "score": 1.0,
                     "segmentation": [ring.ravel().tolist()], "area": polygon.area / GSD**2,
                     "bbox": [*low.tolist(), *(high - low).tolist()]})
    sides.append(rows)
images = [{"id": chip, "width": int(CHIP / GSD), "height": int(CHIP / GSD)} for chip in chips.values()]
before, clock = resource.getrusage(resource.RUSAGE_SELF), time.perf_counter()
truth = COCO({"images": images, "annotations": sides[1], "categories": [{"id": 1, "name": "building"}]})
run = COCOeval_faster(truth, truth.loadRes(sides[0]), iouType="segm", print_function=lambda *words: None)
run.evaluate(); run.accumulate(); run.summarize()
after, clock = resource.getrusage(resource.RUSAGE_SELF), time.perf_counter() - clock
spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
print(f"{faster_coco_eval.__version__}: AP {run.stats[0]:.4f}, {len(images)} chips; without making the chips "
      f"{clock:.1f} s, processor {spent:.1f} s")
""",
}


def summary(answer):
    """Return version, true positives and object quality of the answer of roofbench."""
    import roofbench

    if answer.startswith("failed"):
        return answer
    found = json.loads(answer)
    quality = found["object"]["quality"]
    return f"{roofbench.__version__}: {found['counts']['true_positives']} true positives, object quality {quality:.4f}"


def environment():
    """Return an environment in which another Python finds the libraries of this one after its own."""
    paths = [*filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep)), sysconfig.get_path("purelib")]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sizes", default="10000,100000")
    parser.add_argument("--folder", type=Path, default=Path("national"))
    parser.add_argument("--peers", default=sys.executable, help="Python that has solaris and faster-coco-eval")
    parser.add_argument("--most-solaris", type=int, default=10_000)
    parser.add_argument("--most-coco", type=int, default=100_000)
    options = parser.parse_args()
    options.folder.mkdir(exist_ok=True)
    record = options.folder / "peers.json"
    rows = json.loads(record.read_text()) if record.exists() else []
    most = {"solaris": options.most_solaris, "faster-coco-eval": options.most_coco}
    print(f"{'size':>10} {'tool':>16} {'seconds':>8} {'processor':>9} {'GB':>6}  version and result")
    for size in map(int, options.sizes.split(",")):
        paths = [str(options.folder / f"{side}-{size}.parquet") for side in ("detected", "reference")]
        if not all(map(os.path.exists, paths)):
            here = str(Path(__file__).with_name("bench_national.py"))
            write = ["--sizes", str(size), "--folder", str(options.folder), "--only-write"]
            subprocess.run([sys.executable, here, *write], check=True, stdout=subprocess.DEVNULL)
        verdicts = str(options.folder / f"verdicts-{size}.parquet")
        evaluate = [sys.executable, "-m", "roofbench", "evaluate", *paths, "--verdicts", verdicts, "--overwrite"]
        commands = {"roofbench": [*evaluate, "--parts", str(1 + size // 200_000), "-q", "-f", "json"]}
        for tool, program in PROGRAMS.items():
            python = options.peers if tool in most else sys.executable
            if size <= most.get(tool, size):
                commands[tool] = [python, "-W", "ignore", "-c", program, *paths]
        for tool, command in commands.items():
            row = {"size": size, "tool": tool, **measured(command, environment=environment())}
            if tool == "roofbench":
                row["said"] = summary(row["said"])
            rows.append(row)
            record.write_text(json.dumps(rows, indent=1))
            figures = f"{row['seconds']:>8.1f} {row['processor']:>9.1f} {row['memory']:>6.2f}"
            print(f"{size:>10,} {tool:>16} {figures}  {row['said'][:110]}", flush=True)


if __name__ == "__main__":
    main()
