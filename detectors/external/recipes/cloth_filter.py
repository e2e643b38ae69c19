"""The cloth simulation filter (Zhang et al. 2016, doi:10.3390/rs8060501), package ``cloth-simulation-filter``.

The filter separates ground points from others. The others are on buildings where they are high above the cloth; the
opening in `write_buildings` is what removes trees, so most large trees stay: the filter has no class for them.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import NearestNDInterpolator

from .recipe_scene import read_call, required_module, write_buildings

__all__ = ["main"]


def main() -> None:
    """Run the recipe."""
    csf = required_module("CSF", "cloth-simulation-filter")
    call = read_call(cloth_resolution=1.0, rigidness=2, class_threshold=0.5)
    points = call.points
    filtered = csf.CSF()
    filtered.params.bSloopSmooth = True
    filtered.params.cloth_resolution = float(call.settings["cloth_resolution"])
    filtered.params.rigidness = int(call.settings["rigidness"])
    filtered.params.class_threshold = float(call.settings["class_threshold"])
    filtered.setPointCloud(np.column_stack([points.x, points.y, points.z]))
    ground, others = csf.VecInt(), csf.VecInt()
    filtered.do_filtering(ground, others, False)
    rows = np.array(ground, dtype=np.int64)
    below = NearestNDInterpolator(np.column_stack([points.x[rows], points.y[rows]]), points.z[rows])
    height = points.z - below(points.x, points.y)
    high = height >= call.settings["height"]
    high[rows] = False
    write_buildings(call, high)


if __name__ == "__main__":
    main()
