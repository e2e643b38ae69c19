"""What ``evaluate`` and ``compare`` read: footprints, and the reference with its area."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from .console import say

if TYPE_CHECKING:
    from shapely import Geometry

    from ..scenes.geodata.footprints import Footprints
    from ..scenes.geodata.raster import Grid

__all__ = ["Truth", "print_problems", "read_truth", "short_name"]


class Truth(NamedTuple):
    """The reference, the polygon inside which it is complete, and the pixel grid of its scene."""

    footprints: Footprints
    area: Geometry | None
    grid: Grid | None


def read_truth(reference: str, *, building_id: str | None, crs: str | None, evaluation_area: str | None) -> Truth:
    """Read the reference from a vector file or a scene (folder or name), with its evaluation area and pixel grid."""
    from ..core.errors import InputError
    from ..core.registry import nearest_hint
    from ..scenes.geodata.vector_files import read_footprints, read_polygon
    from ..scenes.shipped import shipped_names, shipped_or_given

    hint = nearest_hint(reference, shipped_names())
    if hint and not Path(reference).exists() and reference not in shipped_names():
        raise InputError(f"{reference}: no such file or scene{hint}")
    if not Path(reference).is_file() and shipped_or_given(reference).is_dir():
        from ..scenes.folder import open_scene

        scene = open_scene(reference)
        if scene.reference is None:
            raise InputError(f"{reference}: the scene has no reference footprints: name a vector file")
        if building_id is not None:
            raise InputError(
                f"{reference} is a scene with its own building ids: leave out building_id=, or name a vector file"
            )
        truth = Truth(scene.reference, scene.area, scene.evaluation_grid)
    else:
        truth = Truth(read_footprints(reference, crs=crs, building_id=building_id), None, None)
    if evaluation_area:
        truth = truth._replace(area=read_polygon(evaluation_area, crs=crs, common_with=truth.footprints))
    return truth


def print_problems(detected: Sequence[Footprints], truth: Truth, *, evaluation_area: str | None, quiet: bool) -> None:
    """Print repairs and signs of different places to standard error; refuse an area that holds no footprint."""
    from ..core.errors import InputError
    from ..scenes.geodata.common_place import place_warnings, reaches

    every = [*detected, truth.footprints]
    if not quiet:
        for footprints in every:
            for repair in footprints.repairs[:10]:
                say(f"{footprints.source}: {repair}")
            if len(footprints.repairs) > 10:
                say(f"{footprints.source}: {len(footprints.repairs) - 10} more repaired or left out")
            if not len(footprints):
                say(f"{footprints.source}: no footprints")
        for found in detected:
            for warning in place_warnings(found, truth.footprints):
                say(warning)
    if evaluation_area and not any(reaches(truth.area, footprints) for footprints in every):
        raise InputError(
            f"{evaluation_area} holds none of the footprints, neither detected nor reference: "
            "check that it shows the same place in the CRS that it names, and the order of its axes"
        )


def short_name(path: str) -> str:
    """Return the last part of a path, with its layer."""
    return path.replace("\\", "/").rstrip("/").rpartition("/")[2]
