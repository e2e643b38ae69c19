"""Shapes traced from the cells of a small grid, and how well two shapes agree."""

import numpy as np
import shapely

from roofbench.scenes.geodata.outlines import coverage_of_mask, trace
from roofbench.scenes.geodata.raster import Grid

GRID = Grid(100.0, 240.0, 0.5, 80, 100)


def centres():
    column, row = np.meshgrid(np.arange(GRID.columns) + 0.5, np.arange(GRID.rows) + 0.5)
    return GRID.to_world(row, column)


def covered(polygon):
    """Share of each cell that a polygon covers, exactly."""
    x, y = centres()
    cells = shapely.box(x - 0.25, y - 0.25, x + 0.25, y + 0.25)
    return (shapely.area(shapely.intersection(cells, polygon)) / 0.25).astype(np.float32)


def traced(polygon):
    share = covered(polygon)
    return trace(coverage_of_mask(share >= 0.5, share), GRID)


def iou(one, two):
    return one.intersection(two).area / one.union(two).area
