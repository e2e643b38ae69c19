"""The reference: every building-like rectangle of at least 10 m2 and 2.5 m, with its building's id.

The parts of L, T, U and C shapes overlap as they were built, which is the *natural overlap* of the papers. A part that
lies inside another part of its building (a tower on its podium) is not an outline of its own.

Source: Awrangjeb, Ravanbakhsh & Fraser (2010), sections 4.1 and 4.3.
"""

from __future__ import annotations

import numpy as np
import shapely

from ..footprints import Footprints
from .buildings import LOWEST, SMALLEST
from .solids import Body
from .streams import stream
from .world import World

__all__ = ["digitise"]

_WITHIN = 0.9


def digitise(world: World, origin: tuple[float, float]) -> Footprints:
    """Return the reference footprints of a world, with roof heights as an attribute."""
    solids = world.solids
    building = solids.body == Body.BUILDING
    rows = np.flatnonzero(building & (solids.areas >= SMALLEST - 1e-6) & (solids.heights >= LOWEST))
    corners = _corners(solids.rectangle[rows])
    polygons = shapely.polygons(corners)
    kept = _outlines(polygons, solids.owner[rows])
    corners, rows = corners[kept] + origin, rows[kept]
    error = world.recipe.reference_error
    if error > 0:
        # One draw per solid, so that the error of a corner does not depend on what else is in the scene.
        wobble = stream(world.seed, "reference").standard_normal((len(solids), 4, 2))[rows]
        corners = corners + error * wobble
    return Footprints.from_rectangles(
        np.round(corners, 3),
        building_ids=solids.owner[rows].astype(np.int64) + 1,
        crs=f"EPSG:{world.recipe.epsg}",
        attributes={"height": np.round(solids.heights[rows], 2)},
        source="synthetic reference",
    )


def _corners(rectangles: np.ndarray) -> np.ndarray:
    x, y, angle, length, width = rectangles.T
    cosine, sine = np.cos(angle), np.sin(angle)
    a, b = np.stack([-length, length, length, -length], -1) / 2, np.stack([-width, -width, width, width], -1) / 2
    return np.stack(
        [x[:, None] + cosine[:, None] * a - sine[:, None] * b, y[:, None] + sine[:, None] * a + cosine[:, None] * b], -1
    )


def _outlines(polygons: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Return which parts are not swallowed by another part of the same building."""
    kept = np.ones(len(polygons), dtype=bool)
    areas = shapely.area(polygons)
    first, second = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    same = (owner[first] == owner[second]) & (areas[first] < areas[second])
    first, second = first[same], second[same]
    inside = shapely.area(shapely.intersection(polygons[first], polygons[second]))
    kept[first[inside >= _WITHIN * areas[first]]] = False
    return kept
