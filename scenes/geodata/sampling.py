"""Many points on a grid: their cells, and a raster sampled at them, in one pass without arrays in between."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel

__all__ = ["bilinear", "bilinear_at", "cells_at"]


@kernel(inline="always")
def bilinear_at(values: NDArray[np.float32], west: float, north: float, cell: float, x: float, y: float) -> float:
    """Return the value at one point; see `bilinear`. The coordinates must be finite."""
    rows, columns = values.shape
    row = min(max((north - y) / cell - 0.5, 0.0), rows - 1.0)
    column = min(max((x - west) / cell - 0.5, 0.0), columns - 1.0)
    top, left = min(int(row), max(rows - 2, 0)), min(int(column), max(columns - 2, 0))
    down, across = row - top, column - left
    # Unsigned, so that indices are not tested for counting from the end.
    bottom, right = np.uintp(min(top + 1, rows - 1)), np.uintp(min(left + 1, columns - 1))
    upmost, leftmost = np.uintp(top), np.uintp(left)
    upper = values[upmost, leftmost] * (1 - across) + values[upmost, right] * across
    lower = values[bottom, leftmost] * (1 - across) + values[bottom, right] * across
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


@kernel
def cells_at(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    first: tuple[int, int],
    shift: tuple[float, float],
    cell: float,
    shape: tuple[int, int],
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the flat index of the cell of each point and whether it is on the grid (index 0 where it is not).

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Metres.
    first : tuple of int
        Column of the west border and row of the north border, counted from the origin of the CRS.
    shift : tuple of float
        Metres by which these borders are east and south of the multiples of the cell.
    cell : float
        Metres.
    shape : tuple of int
        Rows and columns.
    """
    flat, inside = np.zeros(len(x), dtype=np.intp), np.zeros(len(x), dtype=np.bool_)
    for i in range(len(x)):
        # np.divide does not test for division by zero: a cell is never 0.
        row = first[1] - np.ceil(np.divide(y[i] + shift[1], cell))
        column = np.floor(np.divide(x[i] - shift[0], cell)) - first[0]
        # Coordinates that are not finite fail a comparison.
        if row >= 0 and row < shape[0] and column >= 0 and column < shape[1]:
            flat[i], inside[i] = int(row) * shape[1] + int(column), True
    return flat, inside
