"""The DEM of a scene: the bare earth as an airborne survey would give it.

A ground filter leaves points on open ground only. Below buildings, cars and hedges there are none, below crowns few;
the DEM is interpolated over those gaps and smoothed over the spacing of the points left. So of the pad below a house on
a slope it shows only the rim, and it blurs the edges of terraces and retaining walls, while the error on open ground is
small.

Its error is that of every height model on a slope: sigma_z = a + b tan(slope) (Koppe's formula), where a is the
vertical error on level ground and b the horizontal one, which is several times as large (Hodgson & Bresnahan 2004,
"Accuracy of airborne lidar-derived elevation", PE&RS 70(3)).
"""

from __future__ import annotations

import cv2
import numpy as np

from ..geodata.raster import Elevation, Grid
from ..ground.filling import fill_unknown
from .streams import fractal_field, stream
from .surface import rasterise
from .world import World

__all__ = ["measured_dem"]

#: Horizontal error of the DEM relative to its vertical one.
_HORIZONTAL = 3.0
#: Share of the cells below crowns of which a ground point is known.
_SEEN_THROUGH = 0.35
#: Smoothing by the interpolation, standard deviation, metres.
_SMOOTHING = 1.0


def measured_dem(world: World, origin: tuple[float, float]) -> Elevation:
    """Return the DEM of a world: 1 m cells over the extent, in world coordinates, rounded to millimetres."""
    recipe = world.recipe
    grid = Grid.covering((0, 0, recipe.width, recipe.height), 1.0)
    x, y = grid.to_world(np.arange(grid.rows)[:, None] + 0.5, np.arange(grid.columns)[None, :] + 0.5)
    rng = stream(world.seed, "dem")
    smooth = fractal_field(rng, grid.shape, grid.gsd, (35.0, 12.0, 4.0), 0.6)
    rough = rng.random(grid.shape) + rng.random(grid.shape) + rng.random(grid.shape) - 1.5
    error = recipe.dem_error * (0.9 * smooth / max(float(smooth.std()), 1e-9) + 0.35 * rough / 0.5)
    aside = [fractal_field(rng, grid.shape, grid.gsd, (80.0, 30.0), 0.6) for _ in range(2)]
    aside = [_HORIZONTAL * recipe.dem_error * field / max(float(field.std()), 1e-9) for field in aside]
    ground = world.terrain.sample(x + aside[0], y + aside[1]).astype(np.float32)
    ground[_hidden(world, grid, rng.random(grid.shape))] = np.nan
    ground = cv2.GaussianBlur(fill_unknown(ground), (0, 0), _SMOOTHING, borderType=cv2.BORDER_REPLICATE)
    moved = Grid(grid.west + origin[0], grid.north + origin[1], grid.gsd, grid.rows, grid.columns)
    return Elevation(np.round(ground + error, 3).astype(np.float32), moved)


def _hidden(world: World, grid: Grid, chance: np.ndarray) -> np.ndarray:
    """Return the cells without a ground point: those that touch a solid, and most of those below crowns."""
    label = rasterise(world, grid, np.zeros((1, 1), dtype=np.float32)).label
    solid = cv2.dilate((label > 0).astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) > 0
    hidden: np.ndarray = solid | ((label < 0) & (chance > _SEEN_THROUGH))
    return hidden
