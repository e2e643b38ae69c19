"""Bilinear sampling of a raster at many points: one pass, without arrays of the points' size in between."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel

__all__ = ["bilinear", "bilinear_at"]


@kernel(inline="always")
def bilinear_at(values: NDArray[np.float32], west: float, north: float, cell: float, x: float, y: float) -> float:
    """Return the value at one point; see `bilinear`. The coordinates must be finite."""
    rows, columns = values.shape
    row = min(max((north - y) / cell - 0.5, 0.0), rows - 1.0)
    column = min(max((x - west) / cell - 0.5, 0.0), columns - 1.0)
    top, left = min(int(row), max(rows - 2, 0)), min(int(column), max(columns - 2, 0))
    bottom, right = min(top + 1, rows - 1), min(left + 1, columns - 1)
    down, across = row - top, column - left
    upper = values[top, left] * (1 - across) + values[top, right] * across
    lower = values[bottom, left] * (1 - across) + values[bottom, right] * across
    return float(upper * (1 - down) + lower * down)


@kernel
def bilinear(
    values: NDArray[np.float32],
    west: float,
    north: float,
    cell: float,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the values at points, interpolated between cell centres; clamped at the border, NaN beside NaN.

    Parameters
    ----------
    values : ndarray, shape (rows, columns)
    west, north, cell : float
        Upper left corner and cell size of the grid, metres.
    x, y : ndarray, shape (n,)
        Metres; a point that is not finite gives NaN.
    """
    result = np.empty(len(x))
    for i in range(len(x)):
        known = math.isfinite(x[i]) and math.isfinite(y[i])
        result[i] = bilinear_at(values, west, north, cell, x[i], y[i]) if known else np.nan
    return result
