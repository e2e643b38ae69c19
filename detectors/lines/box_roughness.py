"""How rough the laser points in candidate rectangles are, which no image changes.

Nouns
-----
roughness
    Standard deviation, metres, of the points above the height threshold about their plane, in windows of 3 cells; each
    cell has the smallest value of the windows that contain it (see `shared.cues`). A cell is a point spacing wide.

Source: reading. Awrangjeb, Zhang & Fraser (2011) tell trees by the texture of the image alone. Where the image was made
of the colours of points one or two per square metre, its texture no longer separates them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Grid
from ..shared.cues import cell_cues
from .boxes import Boxes, rescaled
from .extension import mean_in_boxes

__all__ = ["Roughness", "mean_roughness", "roughness_sums"]

#: Cells along a side of a window.
_WINDOW = 3
#: Roughness beyond which more says nothing, metres.
_MOST = 2.0
#: Least share of the cells of a rectangle with a roughness; with fewer it is unknown.
_LEAST_SHARE = 0.02


class Roughness(NamedTuple):
    """Row prefix sums (see `boxes`) over cells of several pixels.

    Attributes
    ----------
    total : ndarray of int32, shape (rows, columns + 1)
        Roughness, millimetres; 0 where unknown.
    known : ndarray of int32, shape (rows, columns + 1)
        Cells with a roughness.
    pixels : int
        Pixels of the image along a side of one cell.
    """

    total: NDArray[np.int32]
    known: NDArray[np.int32]
    pixels: int


def roughness_sums(
    points: PointCloud, heights: NDArray[np.float64], grid: Grid, *, spacing: float, threshold: float
) -> Roughness:
    """Return the roughness of points on cells of the point spacing that are whole pixels of a grid.

    Parameters
    ----------
    points : PointCloud
    heights : ndarray, shape (n,)
        Above ground, metres.
    grid : Grid
        Of the image.
    spacing, threshold : float
        Point spacing, and height above which points are looked at, metres.
    """
    pixels = max(1, round(spacing / grid.gsd))
    rows, columns = math.ceil(grid.rows / pixels), math.ceil(grid.columns / pixels)
    cells = Grid(grid.west, grid.north, grid.gsd * pixels, rows, columns)
    cues = cell_cues(points, heights.astype(np.float32), cells, threshold=threshold, window=_WINDOW * cells.gsd)
    known = np.isfinite(cues.roughness)
    total = np.where(known, np.round(np.minimum(cues.roughness, _MOST) * 1000), 0).astype(np.int32)
    return Roughness(_prefixes(total), _prefixes(known), pixels)


def _prefixes(values: NDArray[np.generic]) -> NDArray[np.int32]:
    return np.pad(np.cumsum(values, axis=1, dtype=np.int32), ((0, 0), (1, 0)))


def mean_roughness(roughness: Roughness, boxes: Boxes) -> NDArray[np.float64]:
    """Return the mean roughness of the cells in each box, metres, shape (n,); NaN where unknown."""
    cells = rescaled(boxes, roughness.pixels)
    total, known = mean_in_boxes(roughness.total, cells), mean_in_boxes(roughness.known, cells)
    return np.where(known >= _LEAST_SHARE, total / np.maximum(known, _LEAST_SHARE) / 1000, np.nan)
