"""Plant defects and let the gate find them, as a user would: ``python tests/performance/gate_defects.py [FOLDER]``.

Runs ``roofbench baseline save`` and ``roofbench gate`` on the suite ``gate`` (thirty scenes), so the working tree must
be clean. Prints what the gate prints and its exit code. Stored runs in FOLDER are used again.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

SHRUNK = '''
"""The detectors of roofbench with every footprint two percent shorter and narrower, about its centroid."""

from dataclasses import dataclass, replace

import shapely
from roofbench.detectors.lines.improved import Improved
from roofbench.detectors.lines.original import Original
from roofbench.detectors.mpp.mpp_detector import MPP
from roofbench.detectors.ndsm.ndsm_detector import NDSM


class Shrunk:
    def detect(self, scene, rng):
        found = super().detect(scene, rng)
        polygons = found.polygons.copy()
        for place, polygon in enumerate(polygons):
            middle = shapely.get_coordinates(polygon.centroid)
            polygons[place] = shapely.transform(polygon, lambda points: middle + 0.98 * (points - middle))
        return replace(found, polygons=polygons)
'''
CLASS = """

@dataclass(frozen=True, kw_only=True)
class Shrunk{kind}(Shrunk, {kind}):
    name = "shrunk-{name}"
"""
DETECTORS = {"ndsm": "NDSM", "original": "Original", "improved": "Improved", "mpp": "MPP"}
#: Parameters of a detector in the suite.
PARAMETERS = {"mpp": "[level=part]"}


def roofbench(*words):
    command = [sys.executable, "-m", "roofbench", *map(str, words)]
    print(f"$ roofbench {' '.join(map(str, words))}", flush=True)
    done = subprocess.run(command, check=False)
    print(f"exit code {done.returncode}\n", flush=True)


def main(folder):
    plugin, store = folder / "shrunk.py", ("--store", folder / "runs.sqlite", "-q")
    plugin.write_text(SHRUNK + "".join(CLASS.format(name=name, kind=kind) for name, kind in DETECTORS.items()))
    baseline, printed = folder / "baseline.json", folder / "printed.json"
    roofbench("baseline", "save", "-o", baseline, "--overwrite", *store)
    roofbench("gate", baseline, *store)
    for name, kind in DETECTORS.items():
        shrunk, label = f"{plugin}:Shrunk{kind}{PARAMETERS.get(name, '')}", name + PARAMETERS.get(name, "")
        roofbench("gate", baseline, "-d", shrunk, "--against", label, *store)
    doubled = [item for name in ("original", "improved") for item in ("-d", f"{name}[corner_product=0.4]")]
    roofbench("gate", baseline, *doubled, *store)
    # By default segments that stray from their line are split, which the papers do not do: missed corners are repaired.
    roofbench("baseline", "save", "-o", printed, "-d", "original[missed_corner=1000]", "--overwrite", *store)
    roofbench("gate", printed, "-d", "original[missed_corner=1000,corner_product=0.4]", *store)
    roofbench(
        "gate", baseline, "-d", f"{plugin}:ShrunkNDSM", "--against", "ndsm", "--scenes", "knox-small-[1-5]", *store
    )


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]).resolve())
    else:
        with tempfile.TemporaryDirectory() as name:
            main(Path(name))
