"""Peak memory and time of importing a large tile: ``python tests/performance/bench_import_memory.py [MILLIONS]``.

Makes a LAZ file of 20 million points on 1 km2 (LAS 1.4, point format 6, terrain with houses), then reads and imports
it in fresh processes and prints the peak resident memory beside the size that the points have unpacked as LAS.
"""

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import roofbench as rb
from roofbench.scenes.geodata.las_files import write_points

#: What is measured, as Python source; FILE is the LAZ file, OUT a folder to write.
CASES = {
    "start-up alone": "import roofbench.scenes.importing.scene_import, laspy, rasterio, scipy.ndimage, cv2, numba",
    "read_points": "from roofbench.scenes.geodata.las_files import read_points; cloud = read_points(FILE)",
    "read_points, window of 1 ha": "from roofbench.scenes.geodata.las_files import read_points; "
    "cloud = read_points(FILE, window=(500100, 5700100, 500200, 5700200))",
    "import, classified": "import roofbench as rb; rb.import_scene(OUT, rb.ImportRequest(points=FILE))",
    "import, opening filter": "import roofbench as rb; "
    "rb.import_scene(OUT, rb.ImportRequest(points=FILE, ground_filter='opening'))",
    "import, cloth filter": "import roofbench as rb; "
    "rb.import_scene(OUT, rb.ImportRequest(points=FILE, ground_filter='cloth'))",
}
MEASURE = """
import json, time
FILE, OUT = {file!r}, {out!r}
began = time.process_time()
{source}
seconds = time.process_time() - began
# Not getrusage: its peak begins with that of the process which started this one.
peak = next(int(line.split()[1]) * 1024 for line in open("/proc/self/status") if line.startswith("VmHWM"))
print(json.dumps([peak, seconds]))
"""


def make_tile(path: Path, count: int) -> None:
    """Write `count` points on 1 km2: rolling terrain, a house of 10 m every 25 m, 8 m high."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 1000, count), rng.uniform(0, 1000, count)
    roof = (x % 25 < 10) & (y % 25 < 10)
    z = 100 + 5 * np.sin(x / 150) + 5 * np.cos(y / 170) + np.where(roof, 8.0, 0.0) + rng.normal(0, 0.03, count)
    one = np.ones(count, np.uint8)
    cloud = rb.PointCloud(
        x=x + 500_000,
        y=y + 5_700_000,
        z=z,
        return_number=one,
        number_of_returns=one,
        intensity=rng.integers(1, 60_000, count).astype(np.uint16),
        classification=np.where(roof, 6, 2).astype(np.uint8),
    )
    write_points(cloud, path, crs="EPSG:25832")


def main(millions: float) -> None:
    """Print one row per case."""
    count = int(millions * 1e6)
    las = count * 30
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "tile.laz"
        began = time.process_time()
        make_tile(file, count)
        made = time.process_time() - began
        print(f"{count:,} points, 1 km2: {file.stat().st_size / 1e6:.0f} MB as LAZ, {las / 1e6:.0f} MB as LAS")
        print(f"(made in {made:.0f} CPU s, peak {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.1f} GB)")
        print(f"{'case':<30}{'peak MB':>10}{'x LAS':>8}{'CPU s':>8}")
        for number, (name, source) in enumerate(CASES.items()):
            script = MEASURE.format(file=str(file), out=f"{folder}/out{number}", source=source)
            done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
            peak, seconds = json.loads(done.stdout.splitlines()[-1])
            print(f"{name:<30}{peak / 1e6:>10.0f}{peak / las:>8.2f}{seconds:>8.1f}")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 20.0)
