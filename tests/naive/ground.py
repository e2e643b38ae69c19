"""Slow obvious oracles of the lowest supported point per cell, the mean near a surface and the seam of a DEM."""

import numpy as np


def lowest_surface(x, y, z, grid):
    row, column = (np.floor(value).astype(int) for value in grid.to_pixel(x, y))
    lowest = np.full(grid.shape, np.nan)
    for r in range(grid.rows):
        for c in range(grid.columns):
            near = (abs(row - r) <= 2) & (abs(column - c) <= 2) & (row >= 0) & (row < grid.rows)
            near &= (column >= 0) & (column < grid.columns)
            for height in sorted(z[(row == r) & (column == c)]):
                if np.sum(abs(z[near] - height) < 1.0) >= max(3, 0.05 * near.sum()):
                    lowest[r, c] = height
                    break
    return lowest


def mean_above(x, y, z, surface, tolerance):
    row, column = surface.grid.to_pixel(x, y)
    above = z - surface.sample(x, y)
    near = abs(above) < tolerance
    mean = np.full(surface.grid.shape, np.nan)
    for r in range(mean.shape[0]):
        for c in range(mean.shape[1]):
            held = near & (row >= r) & (row < r + 1) & (column >= c) & (column < c + 1)
            if held.any():
                mean[r, c] = above[held].mean()
    return mean


def fading(known, cell, seam):
    """Weight of the difference between DEM and filter: 1 where the DEM is known, smoothly 0 from `seam` metres on."""
    places = np.argwhere(known)
    weight = np.zeros(known.shape)
    for row in range(known.shape[0]):
        for column in range(known.shape[1]):
            distance = np.sqrt(((places - (row, column)) ** 2).sum(axis=1).min()) * cell
            left = max(0.0, 1 - distance / seam)
            weight[row, column] = left * left * (3 - 2 * left)
    return weight
