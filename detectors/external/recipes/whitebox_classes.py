"""Classification of Whitebox Workflows, tool ``classify_lidar``: ground, vegetation and building points."""

from __future__ import annotations

import json
import sys

import laspy
import numpy as np

from .recipe_scene import read_call, required_module, write_buildings

__all__ = ["main"]

#: ASPRS class of building points.
_BUILDING = 6


def main() -> None:
    """Run the recipe."""
    whitebox = required_module("whitebox_workflows", "whitebox-workflows")
    call = read_call(search_radius=2.5, planarity=0.85)
    before, after = call.output.with_name("points.las"), call.output.with_name("classified.las")
    with laspy.open(call.folder / "points.laz") as source:
        source.read().write(before)
    whitebox.run_tool_json(
        "classify_lidar",
        json.dumps(
            {
                "input": str(before),
                "output": str(after),
                "search_radius": float(call.settings["search_radius"]),
                "planarity_threshold": float(call.settings["planarity"]),
            }
        ),
    )
    classes = np.asarray(laspy.read(after).classification)
    if len(classes) != len(call.points):
        sys.exit(f"classify_lidar returned {len(classes)} of {len(call.points)} points")
    write_buildings(call, classes == _BUILDING)


if __name__ == "__main__":
    main()
