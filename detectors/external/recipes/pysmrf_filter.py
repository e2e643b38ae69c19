"""The simple morphological filter (Pingel et al. 2013, doi:10.1016/j.isprsjprs.2012.12.002), package ``pysmrf``.

The filter marks points on objects and models the ground below them. Objects that are high above the ground are taken
as buildings; the opening in `write_buildings` is what removes trees.
"""

from __future__ import annotations

import numpy as np

from .recipe_scene import read_call, required_module, write_buildings

__all__ = ["main"]


def main() -> None:
    """Run the recipe."""
    pysmrf = required_module("pysmrf", "pysmrf")
    call = read_call(cell_of_filter=1.0, window=18, slope=0.15, elevation=0.5)
    points, settings = call.points, call.settings
    ground, transform, _, is_object = pysmrf.smrf(
        points.x,
        points.y,
        points.z,
        cellsize=float(settings["cell_of_filter"]),
        windows=int(settings["window"]),
        slope_threshold=float(settings["slope"]),
        elevation_threshold=float(settings["elevation"]),
        inpaint_method="nearest",
    )
    column, row = ~transform * (points.x, points.y)
    rows = np.clip(np.floor(row).astype(np.int64), 0, ground.shape[0] - 1)
    columns = np.clip(np.floor(column).astype(np.int64), 0, ground.shape[1] - 1)
    high = points.z - ground[rows, columns] >= settings["height"]
    write_buildings(call, np.asarray(is_object, dtype=np.bool_) & high)


if __name__ == "__main__":
    main()
