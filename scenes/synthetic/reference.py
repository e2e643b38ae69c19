"""The reference: the entities of every building, with the building's id (see `entities`).

It is measured on the ground, as in a cadastral register, or in the orthoimage by a person, as in the papers
("monoscopic image measurement", Awrangjeb et al. 2010, section 4.3): then every rectangle lies where its eaves appear,
so that it leans and shifts with the image.
"""

from __future__ import annotations

import numpy as np

from ..geodata.footprints import Footprints
from .camera import appearance
from .entities import entities
from .solids import Body
from .streams import stream
from .world import World

__all__ = ["digitise"]


def digitise(world: World, origin: tuple[float, float]) -> Footprints:
    """Return the reference footprints of a world, with roof heights as an attribute."""
    solids = world.solids
    rows = np.flatnonzero(solids.body == Body.BUILDING)
    corners = _corners(solids.rectangle[rows], solids.slant[rows])
    kept = entities(corners, solids.heights[rows], solids.owner[rows])
    corners, rows = corners[kept], rows[kept]
    if world.recipe.digitised == "image":
        eaves = np.broadcast_to(solids.eave[rows][:, None, None], (*corners.shape[:2], 1))
        middle = np.concatenate([corners.mean(axis=1, keepdims=True), eaves[:, :1]], axis=-1)
        # As a whole: a rectangle stays one.
        corners = corners + appearance(middle, world.terrain, world.recipe, world.seed) - middle[..., :2]
    corners = corners + origin
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


def _corners(rectangles: np.ndarray, slant: np.ndarray) -> np.ndarray:
    x, y, angle, length, width = rectangles.T
    cosine, sine = np.cos(angle), np.sin(angle)
    a, b = np.stack([-length, length, length, -length], -1) / 2, np.stack([-width, -width, width, width], -1) / 2
    a = a + slant[:, None] * b
    return np.stack(
        [x[:, None] + cosine[:, None] * a - sine[:, None] * b, y[:, None] + sine[:, None] * a + cosine[:, None] * b], -1
    )
