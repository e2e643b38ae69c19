"""Slow obvious oracle of bilinear sampling, one point at a time."""

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
