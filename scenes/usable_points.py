"""Points that a scene can use: returns from land and from what stands on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .geodata.points import PointCloud
from .ground.heights import HIGHEST_LAND, LOWEST_LAND

__all__ = ["is_land", "is_noise"]

#: ASPRS classes that mark a return as noise: low and high.
_NOISE = (7, 18)


def is_land(z: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which elevations, metres, shape (n,), can be those of land."""
    return np.asarray(~((z < LOWEST_LAND) | (z > HIGHEST_LAND)))


def is_noise(cloud: PointCloud) -> NDArray[np.bool_]:
    """Return which points are classified as noise, shape (n,)."""
    if cloud.classification is None:
        return np.zeros(len(cloud), dtype=np.bool_)
    return np.isin(cloud.classification, _NOISE)
