"""Whether two footprint sets, or an area and a set, can be of one place."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from .crs import same_crs, scale_warning
from .footprints import Footprints

__all__ = ["Extent", "extent_warnings", "place_warnings", "reaches"]


class Extent(NamedTuple):
    """Bounds of some footprints (xmin, ymin, xmax, ymax, m; None of none), their CRS and their name in messages."""

    bounds: tuple[float, float, float, float] | None
    crs: str | None
    source: str


def place_warnings(detected: Footprints, reference: Footprints) -> list[str]:
    """Return warnings in words: no overlap of the two extents, or a CRS in which areas are far from true ones."""
    return extent_warnings(*(_extent(footprints) for footprints in (detected, reference)))


def extent_warnings(detected: Extent, reference: Extent) -> list[str]:
    """Return warnings in words; see `place_warnings`."""
    boxes = [np.array(side.bounds) for side in (detected, reference) if side.bounds is not None]
    if not boxes:
        return []
    warnings = []
    low, high = np.max([box[:2] for box in boxes], axis=0), np.min([box[2:] for box in boxes], axis=0)
    # Two systems are an error of their own, and their numbers cannot be compared.
    comparable = None in (detected.crs, reference.crs) or same_crs(str(detected.crs), str(reference.crs))
    if comparable and (low > high).any():
        ranges = [f"x {box[0]:.0f} to {box[2]:.0f}, y {box[1]:.0f} to {box[3]:.0f}" for box in boxes]
        warnings.append(
            f"warning: {detected.source} lies in {ranges[0]} and {reference.source} in {ranges[1]}: no overlap at all, "
            "check the CRS and the order of the axes"
        )
    stretched = scale_warning(reference.crs or detected.crs, *((boxes[-1][:2] + boxes[-1][2:]) / 2))
    return [*warnings, stretched] if stretched else warnings


def _extent(footprints: Footprints) -> Extent:
    bounds = tuple(shapely.total_bounds(footprints.polygons).tolist()) if len(footprints) else None
    return Extent(bounds, footprints.crs, footprints.source)


def reaches(area: shapely.Geometry | None, footprints: Footprints) -> bool:
    """Return whether any footprint meets the area."""
    return bool(shapely.intersects(area, footprints.polygons).any())
