"""GRASS GIS: the modules ``v.lidar.edgedetection``, ``v.lidar.growing`` and ``v.lidar.correction`` (Brovelli et al.).

The three steps give each point a category: 1 terrain, 2 terrain of double returns, 3 object of a double return
(vegetation), 4 object of a single return (building). Points of category 4 that are high above the interpolated terrain
are on buildings. The steps get the last return of every pulse, and the first return of those with several. The points
are read without topology, as the manual of ``v.in.ascii`` advises for many points.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.interpolate import NearestNDInterpolator
from scipy.spatial import cKDTree

from .recipe_scene import RecipeCall, leave, read_call, require_program, run_tool, write_buildings

__all__ = ["main"]

_BUILDING = 4
_SCRIPT = """set -e
export GRASS_VERBOSE=0
v.in.ascii -ztb input=all.txt output=all separator=space x=1 y=2 z=3
v.in.ascii -ztb input=first.txt output=first separator=space x=1 y=2 z=3
g.region w={west} s={south} e={east} n={north} res={step} -a
v.lidar.edgedetection input=all output=edges ew_step={step} ns_step={step} lambda_g=0.5
v.lidar.growing input=edges output=grown first=first
v.lidar.correction input=grown output=corrected terrain=terrain
v.out.ascii input=corrected layer=2 type=point format=point output=corrected.txt separator=space
v.out.ascii input=terrain type=point format=point output=terrain.txt separator=space
"""


def main() -> None:
    """Run the recipe."""
    require_program("grass", "the Debian package grass-core")
    call = read_call(step=4.0)
    region = _write_points(call)
    script = Path("steps.sh")
    script.write_text(_SCRIPT.format(**region, step=float(call.settings["step"])), encoding="utf-8")
    run_tool(["grass", "--tmp-location", "XY", "--exec", "sh", str(script)])
    corrected, terrain = np.loadtxt("corrected.txt", ndmin=2), np.loadtxt("terrain.txt", ndmin=2)
    below = NearestNDInterpolator(terrain[:, :2], terrain[:, 2])
    found = corrected[corrected[:, -1] == _BUILDING]
    found = found[found[:, 2] - below(found[:, 0], found[:, 1]) >= call.settings["height"]]
    points = np.column_stack([call.points.x - call.extent[0], call.points.y - call.extent[1], call.points.z])
    on_building = np.zeros(len(points), dtype=np.bool_)
    if len(found):
        distance, _ = cKDTree(found[:, :3]).query(points, distance_upper_bound=0.01)
        on_building = np.isfinite(distance)
    write_buildings(call, on_building)


def _write_points(call: RecipeCall) -> dict[str, float]:
    """Write last and first returns as text, in metres from the corner of the extent, and return their bounds."""
    points = call.points
    rows = np.column_stack([points.x - call.extent[0], points.y - call.extent[1], points.z])
    number, total = points.return_number, points.number_of_returns
    first, last = np.zeros(len(rows), dtype=np.bool_), np.ones(len(rows), dtype=np.bool_)
    if number is not None and total is not None:
        first, last = (number == 1) & (total > 1), number == total
    if not first.any():
        leave("the points have no pulses with several returns, which v.lidar.growing needs")
    np.savetxt("all.txt", rows[last], fmt="%.3f")
    np.savetxt("first.txt", rows[first], fmt="%.3f")
    (west, south), (east, north) = rows[:, :2].min(axis=0), rows[:, :2].max(axis=0)
    return {"west": west, "south": south, "east": east, "north": north}


if __name__ == "__main__":
    main()
