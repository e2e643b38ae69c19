"""Plant defects and let the gate find them, as a user would: ``python tests/benchmarks/gate_defects.py [FOLDER]``.

Runs ``roofbench baseline save`` and ``roofbench gate`` on the suite ``gate`` (thirty scenes), so the working tree must
be clean. Prints what the gate prints and its exit code. Stored runs in FOLDER are used again.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

DETECTORS = ("ndsm", "original", "improved", "mpp")
SHRUNK = '''
"""The detectors of roofbench with every footprint two percent shorter and narrower, about its centre."""

from dataclasses import dataclass, replace

import shapely
from roofbench.detectors.lines.improved import Improved
from roofbench.detectors.lines.original import Original
from roofbench.detectors.mpp.detector import MPP
from roofbench.detectors.ndsm import NDSM


def smaller(footprints):
    middles = shapely.get_coordinates(shapely.centroid(footprints.polygons))
    polygons = footprints.polygons.copy()
    for place, (polygon, middle) in enumerate(zip(polygons, middles)):
        polygons[place] = shapely.transform(polygon, lambda points: middle + 0.98 * (points - middle))
    return replace(footprints, polygons=polygons)


def shrunk(detector):
    def detect(self, scene, rng):
        return smaller(detector.detect(self, scene, rng))

    return dataclass(frozen=True, kw_only=True)(type(detector.__name__, (detector,), {"detect": detect}))


NDSM, Original, Improved, MPP = map(shrunk, (NDSM, Original, Improved, MPP))
'''


def roofbench(*words):
    command = [sys.executable, "-m", "roofbench", *map(str, words)]
    print(f"$ roofbench {' '.join(map(str, words))}", flush=True)
    done = subprocess.run(command, check=False)
    print(f"exit code {done.returncode}\n", flush=True)


def main(folder):
    plugin, store = folder / "shrunk.py", ("--store", folder / "runs.sqlite", "-q")
    plugin.write_text(SHRUNK)
    baseline, printed = folder / "baseline.json", folder / "printed.json"
    roofbench("baseline", "save", "-o", baseline, "--overwrite", *store)
    roofbench("gate", baseline, *store)
    names = [item for name in ("NDSM", "Original", "Improved", "MPP") for item in ("-d", f"{plugin}:{name}")]
    roofbench("gate", baseline, *names, *store)
    doubled = [item for name in ("original", "improved") for item in ("-d", f"{name}[corner_product=0.4]")]
    roofbench("gate", baseline, *doubled, *store)
    # By default segments that stray from their line are split, which the papers do not do: missed corners are repaired.
    roofbench("baseline", "save", "-o", printed, "-d", "original[missed_corner=1000]", "--overwrite", *store)
    roofbench("gate", printed, "-d", "original[missed_corner=1000,corner_product=0.4]", *store)
    roofbench("gate", baseline, "-d", f"{plugin}:NDSM", "--scenes", "knox-small-[1-5]", *store)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]).resolve())
    else:
        with tempfile.TemporaryDirectory() as name:
            main(Path(name))
