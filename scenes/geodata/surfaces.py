"""Surfaces of points: per cell the highest return, or the mean intensity, for pictures and quick looks."""

from __future__ import annotations

import numpy as np

from .points import PointCloud
from .raster import Elevation, Grid

__all__ = ["highest_surface", "mean_intensity"]


def highest_surface(points: PointCloud, grid: Grid) -> Elevation:
    """Return the digital surface model: the height of the highest point per cell, NaN without one."""
    index, inside = grid.cells(points.x, points.y)
    highest = np.full(grid.rows * grid.columns, -np.inf)
    np.maximum.at(highest, index[inside], points.z[inside])
    highest[np.isneginf(highest)] = np.nan
    return Elevation(highest.reshape(grid.shape).astype(np.float32), grid)


def mean_intensity(points: PointCloud, grid: Grid) -> Elevation | None:
    """Return the mean intensity per cell, NaN without a point; None when the points have no intensity."""
    if points.intensity is None:
        return None
    index, inside = grid.cells(points.x, points.y)
    size = grid.rows * grid.columns
    count = np.bincount(index[inside], minlength=size)
    total = np.bincount(index[inside], weights=points.intensity[inside], minlength=size)
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return Elevation(mean.reshape(grid.shape).astype(np.float32), grid)
