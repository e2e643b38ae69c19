"""The evaluation area of a scene: the polygons inside which its reference is complete."""

from __future__ import annotations

import numpy as np
import shapely

from ...core.errors import InputError
from ..geodata.footprints import Footprints
from .place import Place, extent_text

__all__ = ["area_of_extent", "read_area"]


def read_area(place: Place, name: str) -> shapely.Geometry:
    """Read the polygons inside which the reference is complete, as one geometry cut to the place."""
    from ..geodata.vector_files import read_footprints

    polygons = read_footprints(name, to_crs=place.crs).polygons
    parts = shapely.get_parts(shapely.intersection(shapely.union_all(polygons), shapely.box(*place.extent)))
    parts = parts[shapely.area(parts) > 0]
    if not len(parts):
        raise InputError(
            f"{name} does not overlap the scene, {extent_text(place.extent)}: "
            "check that it shows the same place in the CRS that it names, and the order of its axes"
        )
    return shapely.union_all(parts)


def area_of_extent(place: Place, reference: Footprints) -> shapely.Geometry | None:
    """Return the extent as evaluation area when footprints reach beyond it, else None."""
    box = shapely.box(*place.extent)
    beyond = int(np.count_nonzero(~shapely.covers(box, reference.polygons)))
    if not beyond:
        return None
    place.log.derived["area"] = "the extent of the scene, since footprints of the reference reach beyond it"
    place.log.note(f"footprints that reach beyond the scene: {beyond}; its extent was made the evaluation area")
    return box
