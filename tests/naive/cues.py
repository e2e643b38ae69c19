"""Slow obvious oracle of the roughness: a least-squares plane through the points of every window, one by one."""

import numpy as np


def roughness(x, y, z, grid, width):
    row, column = (np.floor(value).astype(int) for value in grid.to_pixel(x, y))
    least = np.full(grid.shape, np.inf)
    for top in range(-width, grid.rows + 1):
        for left in range(-width, grid.columns + 1):
            inside = (top <= row) & (row < top + width) & (left <= column) & (column < left + width)
            n = inside.sum()
            if n < 6:
                continue
            design = np.column_stack([np.ones(n), x[inside] - x[inside].mean(), y[inside] - y[inside].mean()])
            solution = np.linalg.lstsq(design, z[inside], rcond=None)[0]
            sigma = np.sqrt(np.sum((z[inside] - design @ solution) ** 2) / (n - 3))
            window = least[max(top, 0) : top + width, max(left, 0) : left + width]
            np.minimum(window, sigma * (1 + 1 / np.sqrt(2 * (n - 3))), out=window)
    holds = np.zeros(grid.shape, dtype=bool)
    holds[row, column] = True
    return np.where(holds & np.isfinite(least), least, np.nan)


def tally(index, inside, heights, returns, threshold, size):
    """Return per cell points, high points, those of several and of unknown returns, and the sum of their heights."""
    tallies = np.zeros((5, size))
    for cell, is_inside, height, number in zip(index, inside, heights, returns, strict=True):
        if is_inside and np.isfinite(height):
            tallies[0, cell] += 1
            if height > threshold:
                tallies[1:, cell] += 1, number > 1, number == 0, height
    return tallies
