"""Slow obvious oracle of bilinear sampling, one point at a time."""

import math

import numpy as np


def bilinear(elevation, xs, ys):
    values, grid = elevation.values.astype(float), elevation.grid
    result = []
    for x, y in zip(xs, ys, strict=True):
        row = np.clip((grid.north - y) / grid.gsd - 0.5, 0, grid.rows - 1)
        column = np.clip((x - grid.west) / grid.gsd - 0.5, 0, grid.columns - 1)
        r = min(int(row), max(grid.rows - 2, 0))
        c = min(int(column), max(grid.columns - 2, 0))
        total = 0.0
        for dr, weight_r in ((0, 1 - (row - r)), (1, row - r)):
            for dc, weight_c in ((0, 1 - (column - c)), (1, column - c)):
                total += weight_r * weight_c * values[min(r + dr, grid.rows - 1), min(c + dc, grid.columns - 1)]
        result.append(total)
    return np.array(result)


def cells(grid, x, y):
    """Return the flat cell index of each point, one by one; 0 and False where it is on no cell."""
    first, last = math.floor(grid.west / grid.gsd + 1e-6), math.ceil(grid.north / grid.gsd - 1e-6)
    east, south = round(grid.west - first * grid.gsd, 6), round(last * grid.gsd - grid.north, 6)
    found = []
    for at_x, at_y in zip(x, y, strict=True):
        if not (math.isfinite(at_x) and math.isfinite(at_y)):
            found.append((0, False))
            continue
        row, column = last - math.ceil((at_y + south) / grid.gsd), math.floor((at_x - east) / grid.gsd) - first
        inside = 0 <= row < grid.rows and 0 <= column < grid.columns
        found.append((row * grid.columns + column, True) if inside else (0, False))
    return found
