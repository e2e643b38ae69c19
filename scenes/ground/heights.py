"""Heights above ground: what every detector that reads points starts from.

The *ground* is the scene's DEM where it is known, else (or beyond it) a surface estimated from the points. A *height*
is metres above that ground; a *sane* height is finite and neither far below the ground nor as high as a bird flies.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ..geodata.points import PointCloud
from ..geodata.raster import Elevation
from ..scene import Scene
from .filter import fill_unknown, ground_surface

__all__ = ["ground_of", "heights_above_ground"]


def ground_of(scene: Scene, *, use_dem: bool = True) -> Elevation:
    """Return the bare earth of a scene, known everywhere: its DEM, else a surface filtered from its points.

    Small gaps of the DEM are interpolated; a DEM that knows nothing, or covers less than half of the scene's extent,
    is not used. Without points and DEM the ground is at height 0.

    Parameters
    ----------
    scene : Scene
    use_dem : bool
        False to filter the points although there is a DEM.
    """
    dem = scene.dem if use_dem else None
    if dem is not None and _covered(dem, scene) >= 0.5:
        return Elevation(fill_unknown(dem.values), dem.grid)
    points = scene.points
    empty = np.empty(0)
    ground = ground_surface(PointCloud(empty, empty, empty) if points is None else points, scene.extent)
    if np.isnan(ground.values).all():
        return dataclasses.replace(ground, values=np.zeros(ground.grid.shape, dtype=np.float32))
    return ground


def _covered(dem: Elevation, scene: Scene) -> float:
    """Return the share of the scene's extent over which the DEM is known."""
    xmin, ymin, xmax, ymax = scene.extent
    x, y = np.meshgrid(np.linspace(xmin, xmax, 50), np.linspace(ymin, ymax, 50))
    index, inside = dem.grid.cells(x, y)
    return float(np.mean(inside & np.isfinite(dem.values.ravel()[index])))


def heights_above_ground(points: PointCloud, ground: Elevation, *, highest: float = 500.0) -> NDArray[np.float32]:
    """Return the height of each point above the ground, metres, shape (n,); NaN where it is not sane.

    Parameters
    ----------
    points : PointCloud
    ground : Elevation
        Known everywhere; clamped beyond its border.
    highest : float
        Heights beyond this many metres, or more than 10 m below the ground, are errors.
    """
    finite = np.isfinite(points.x) & np.isfinite(points.y) & np.isfinite(points.z)
    heights = np.full(len(points), np.nan, dtype=np.float32)
    sampled = ground.sample(points.x[finite], points.y[finite])
    above = points.z[finite] - sampled
    heights[finite] = np.where((above > -10) & (above < highest), above, np.nan)
    return heights
