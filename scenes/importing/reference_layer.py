"""The reference of a scene: footprints of a file or of classified points, joined or decomposed on request."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely

from ...core.errors import InputError
from ...core.wording import counted
from ..geodata.footprints import Footprints
from ..geodata.points import PointCloud
from .place import Place, extent_text, file_paths

__all__ = ["blocks_of", "read_reference", "rectangles_of", "reference_of_class"]


def read_reference(place: Place, name: str, building_id: str | None) -> Footprints:
    """Read reference footprints, brought to the CRS of the place, those outside left out."""
    from ..geodata.vector_files import read_footprints

    footprints = read_footprints(name, building_id=building_id, to_crs=place.crs)
    file = Path(name).name
    if footprints.repairs:
        count = len(footprints.repairs)
        repairs = "; ".join(str(repair) for repair in footprints.repairs[:5]) + ("; ..." if count > 5 else "")
        place.log.note(f"{file}: {counted(count, 'footprint was', 'footprints were')} repaired or left out ({repairs})")
    if not len(footprints):
        place.log.note(f"{file} holds no footprints: the scene has an empty reference")
        return footprints
    box = shapely.box(*place.extent)
    inside = shapely.area(shapely.intersection(footprints.polygons, box)) > 0
    if not inside.any():
        raise InputError(
            f"{name} covers {extent_text(shapely.total_bounds(footprints.polygons))} and lies outside the scene, "
            f"{extent_text(place.extent)}: check that it shows the same place in the CRS that it names, "
            "and the order of its axes"
        )
    if not inside.all():
        place.log.note(f"{file}: {np.count_nonzero(~inside)} of {len(inside)} footprints lie outside and were left out")
    return footprints.take(inside)


def reference_of_class(place: Place, points: PointCloud, files: Sequence[Path]) -> Footprints:
    """Return the outlines of the points that are classified as building."""
    from .class_outlines import outlines_of_class

    reference = outlines_of_class(points, place.extent, crs=place.crs, source=file_paths(files))
    how = place.log.derived["reference"] = "traced around the points of class 6 (building)"
    place.log.note(f"the reference ({counted(len(reference), 'footprint')}) was {how}")
    return reference


def blocks_of(place: Place, reference: Footprints, gap: float) -> Footprints:
    """Return the reference with footprints joined over gaps below `gap` (m)."""
    blocks = reference.joined(gap)
    numbers = f"{counted(len(reference), 'footprint')}, {counted(len(blocks), 'block')}"
    _changed_reference(place, f"joined over gaps below {gap:g} m ({numbers})")
    return blocks


def rectangles_of(place: Place, reference: Footprints) -> Footprints:
    """Return the reference as rectangles, with a note on how well they fit."""
    from ..geodata.rectangles import as_rectangles

    rectangles, fit = as_rectangles(reference)
    _changed_reference(
        place,
        f"decomposed into rectangles ({counted(fit.footprints, 'footprint')}, {counted(fit.rectangles, 'rectangle')}, "
        f"areas agree to {fit.agreement:.1%})",
    )
    if fit.poor:
        ids = ", ".join(map(str, fit.poor[:10])) + (", ..." if len(fit.poor) > 10 else "")
        place.log.note(f"footprints that rectangles do not fit (areas agree below 80%): {ids}")
    return rectangles


def _changed_reference(place: Place, how: str) -> None:
    """Record and note what was made of the reference."""
    before = place.log.derived.get("reference")
    place.log.derived["reference"] = f"{before}, then {how}" if before else how
    place.log.note(f"the reference was {how}")
