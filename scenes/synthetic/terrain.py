"""Terrain: the bare earth, as a plane with relief on it and levelled pads under buildings.

Local world coordinates: x east and y north from the scene's lower left corner, metres; elevations are absolute.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..geodata.raster import Elevation, Grid
from .recipe import SceneParameters
from .solids import Solid
from .streams import fractal_field, stream

__all__ = ["distance_to_rectangle", "natural_terrain", "terraced"]

_MARGIN = 24.0
_FADE = 5.0


def natural_terrain(recipe: SceneParameters, seed: int) -> Elevation:
    """Return the ground before construction, on a 1 m raster with a margin."""
    grid = Grid.covering((-_MARGIN, -_MARGIN, recipe.width + _MARGIN, recipe.height + _MARGIN), 1.0)
    x, y = grid.to_world(np.arange(grid.rows)[:, None] + 0.5, np.arange(grid.columns)[None, :] + 0.5)
    relief = fractal_field(stream(seed, "terrain"), grid.shape, grid.gsd, (260.0, 130.0, 60.0, 25.0), 0.42)
    inside = _inside(grid, recipe)
    relief -= _fitted_plane(relief, inside, x, y)
    dip, aspect = math.tan(math.radians(recipe.slope)), math.radians(recipe.aspect)
    plane = dip * (math.cos(aspect) * x + math.sin(aspect) * y)
    values = plane + _amplitude(plane[inside], relief[inside], recipe.undulation) * relief
    values += recipe.elevation - values[inside].min()
    return Elevation(values.astype(np.float32), grid)


def _fitted_plane(
    relief: NDArray[np.float64],
    inside: tuple[slice, slice],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the plane through the relief of the extent: without it, `slope` alone says how the ground dips."""
    part = relief[inside]
    dx, dy = x - x[:, inside[1]].mean(), y - y[inside[0]].mean()
    across, down = dx[:, inside[1]], dy[inside[0]]
    tilt_x = float((part * across).sum() / (across**2).sum() / part.shape[0])
    tilt_y = float((part * down).sum() / (down**2).sum() / part.shape[1])
    plane: NDArray[np.float64] = tilt_x * dx + tilt_y * dy
    return plane


def _amplitude(plane: NDArray[np.float64], relief: NDArray[np.float64], undulation: float) -> float:
    """Return the factor on the relief with which the ground spans what plane and undulation span together.

    The two ranges add up as the root of the sum of squares, whatever the seed: a hilly preset has its printed
    elevations.
    """
    target = float(np.hypot(np.ptp(plane), undulation))
    low, high = 0.0, (target + float(np.ptp(plane))) / max(float(np.ptp(relief)), 1e-9)
    for _ in range(40):
        middle = (low + high) / 2
        if float(np.ptp(plane + middle * relief)) < target:
            low = middle
        else:
            high = middle
    return high if undulation > 0 else 0.0


def _inside(grid: Grid, recipe: SceneParameters) -> tuple[slice, slice]:
    margin = int(_MARGIN)
    return (
        slice(grid.rows - margin - int(recipe.height), grid.rows - margin),
        slice(margin, margin + int(recipe.width)),
    )


def terraced(terrain: Elevation, buildings: Sequence[Solid], terracing: float) -> Elevation:
    """Level the ground under and around buildings to their floors, fading out over some metres."""
    values = terrain.values.astype(np.float64)
    grid = terrain.grid
    weight = np.zeros(grid.shape)
    level = np.zeros(grid.shape)
    for solid in buildings:
        reach = 0.5 * math.hypot(solid.length, solid.width) + _FADE
        (top, bottom), (left, right) = grid.to_pixel(
            [solid.x - reach, solid.x + reach], [solid.y + reach, solid.y - reach]
        )
        rows = slice(max(0, math.floor(top)), max(0, math.ceil(bottom)))
        columns = slice(max(0, math.floor(left)), max(0, math.ceil(right)))
        window = values[rows, columns]
        if not window.size:
            continue
        x, y = grid.to_world(
            np.arange(rows.start, rows.start + window.shape[0])[:, None] + 0.5,
            np.arange(columns.start, columns.start + window.shape[1])[None, :] + 0.5,
        )
        distance = distance_to_rectangle(x, y, solid)
        near = np.clip(1 - (distance - 1.0) / (_FADE - 1.0), 0, 1) ** 2
        weight[rows, columns] += near
        level[rows, columns] += near * solid.base
    blend = terracing * np.minimum(weight, 1.0)
    levelled = values * (1 - blend) + blend * level / np.maximum(weight, 1e-9)
    return Elevation(levelled.astype(np.float32), grid)


def distance_to_rectangle(x: NDArray[np.float64], y: NDArray[np.float64], solid: Solid) -> NDArray[np.float64]:
    """Return the distance of points to a solid's rectangle, 0 inside, metres."""
    cosine, sine = math.cos(solid.angle), math.sin(solid.angle)
    along = np.abs(cosine * (x - solid.x) + sine * (y - solid.y)) - solid.length / 2
    across = np.abs(-sine * (x - solid.x) + cosine * (y - solid.y)) - solid.width / 2
    beyond: NDArray[np.float64] = np.hypot(np.maximum(along, 0), np.maximum(across, 0))
    return beyond
