"""The camera: its position, and where points appear in the orthoimage.

Nouns
-----
camera
    Projection centre above the extent; at the centre of the extent the view is off-nadir by `view_angle`.
relief displacement
    A point at height h above the ground, seen from flying height H at the horizontal distance R of the nadir, appears
    ``R h / (H - h)`` too far out (flat ground).
registration error
    The whole image is shifted by `registration_shift`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..geodata.raster import Elevation
from .recipe import SceneParameters
from .streams import stream

__all__ = ["appearance", "camera_position", "registration_offset"]


def camera_position(recipe: SceneParameters, seed: int) -> tuple[float, float, float]:
    """Return the projection centre in local coordinates; azimuth by the seed, distance by the recipe."""
    turn = stream(seed, "image").random() * 2 * math.pi
    away = recipe.flying_height * math.tan(math.radians(recipe.view_angle))
    return (
        recipe.width / 2 + away * math.cos(turn),
        recipe.height / 2 + away * math.sin(turn),
        recipe.elevation + recipe.flying_height,
    )


def registration_offset(recipe: SceneParameters, seed: int) -> tuple[float, float]:
    """Return the registration error: its length follows from the recipe, its direction from the seed."""
    turn = stream(seed, "image").random(2)[1] * 2 * math.pi
    return recipe.registration_shift * math.cos(turn), recipe.registration_shift * math.sin(turn)


def appearance(xyz: NDArray[np.float64], terrain: Elevation, recipe: SceneParameters, seed: int) -> NDArray[np.float64]:
    """Return where in the orthoimage points of the world appear, shape (..., 2), local coordinates.

    The image is rectified with the terrain: a point appears where the ray from the camera through it meets the ground.
    """
    camera = camera_position(recipe, seed)
    offset = registration_offset(recipe, seed)
    x, y = xyz[..., 0], xyz[..., 1]
    for _ in range(3):  # iterated, since the height of the ground depends on the place of appearance
        share = (xyz[..., 2] - terrain.sample(x, y)) / (camera[2] - xyz[..., 2])
        x, y = xyz[..., 0] + share * (xyz[..., 0] - camera[0]), xyz[..., 1] + share * (xyz[..., 1] - camera[1])
    return np.stack([x + offset[0], y + offset[1]], axis=-1)
