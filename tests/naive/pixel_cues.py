"""Slow obvious oracle of the means of pixels per cell, one cell and one pixel at a time."""

import math

import numpy as np


def green(pixel):
    return (pixel["nir"], pixel["red"]), (pixel["nir"] - pixel["red"]) / max(pixel["nir"] + pixel["red"], 1e-6)


def share_of(name):
    def share(pixel):
        colours = pixel["red"], pixel["green"], pixel["blue"]
        return colours, pixel[name] / max(sum(colours), 1e-6)

    return share


def cell_means(image, grid, value_of, darkest):
    """Return the mean of usable pixels per cell; `value_of` returns the bands that must be bright, and the value."""
    white = np.iinfo(image.values.dtype).max
    width = max(1, round(grid.gsd / image.grid.gsd))

    def square(row, column):
        """Return the sums of values and of usable pixels in the square around a pixel; none around one outside."""
        sums = np.zeros(2)
        if not (0 <= row < image.grid.rows and 0 <= column < image.grid.columns):
            return sums
        for r in range(row - width // 2, row - width // 2 + width):
            for c in range(column - width // 2, column - width // 2 + width):
                inside = 0 <= r < image.grid.rows and 0 <= c < image.grid.columns
                if not inside or (image.valid is not None and not image.valid[r, c]):
                    continue
                pixel = {name: float(image.values[k, r, c]) / white for k, name in enumerate(image.bands)}
                bands, value = value_of(pixel)
                if max(bands) >= darkest:
                    sums += value, 1
        return sums

    means = np.full(grid.shape, np.nan)
    for i in range(grid.rows):
        for j in range(grid.columns):
            x, y = grid.to_world(i + 0.5, j + 0.5)
            row, column = image.grid.to_pixel(x, y)
            row, column = float(row) - 0.5, float(column) - 0.5
            r, c = math.floor(row), math.floor(column)
            value, weight = sum(
                (1 - abs(row - k)) * (1 - abs(column - n)) * square(k, n) for k in (r, r + 1) for n in (c, c + 1)
            )
            if weight > 0.25 * width**2:
                means[i, j] = value / weight
    return means
