"""How much of a candidate rectangle has smooth laser points, which no image changes.

Nouns
-----
roughness
    Standard deviation, metres, of the points above the height threshold about their plane, in windows of 3 cells; each
    cell has the smallest value of the windows that contain it (see `shared.cues`). A cell is a point spacing wide.
smoothness
    1 for a roughness up to 0.2 m, 0 from 0.4 m on, linear between. Its mean is about the share of a rectangle that is
    roof: half a roof under a tree is half smooth, while the mean roughness is nearly that of the tree.

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

__all__ = ["Smoothness", "mean_smoothness", "smoothness_sums"]

#: Cells along a side of a window.
_WINDOW = 3
#: Roughness up to which a cell is smooth, and from which it is not, metres.
_SMOOTH, _ROUGH = 0.2, 0.4
#: Least share of the cells of a rectangle with a roughness; with fewer its smoothness is unknown.
_LEAST_SHARE = 0.02


class Smoothness(NamedTuple):
    """Row prefix sums (see `boxes`) over cells of several pixels.

    Attributes
    ----------
    total : ndarray of int32, shape (rows, columns + 1)
        Smoothness, thousandths; 0 where unknown.
    known : ndarray of int32, shape (rows, columns + 1)
        Cells with a roughness.
    pixels : int
        Pixels of the image along a side of one cell.
    """

    total: NDArray[np.int32]
    known: NDArray[np.int32]
    pixels: int


def smoothness_sums(
    points: PointCloud, heights: NDArray[np.float64], grid: Grid, *, spacing: float, threshold: float
) -> Smoothness:
    """Return the smoothness of points on cells of the point spacing that are whole pixels of a grid.

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
    smooth = np.clip((_ROUGH - cues.roughness) / (_ROUGH - _SMOOTH), 0, 1)
    total = np.where(known, np.round(smooth * 1000), 0).astype(np.int32)
    return Smoothness(_prefixes(total), _prefixes(known), pixels)


def _prefixes(values: NDArray[np.generic]) -> NDArray[np.int32]:
    return np.pad(np.cumsum(values, axis=1, dtype=np.int32), ((0, 0), (1, 0)))


def mean_smoothness(smoothness: Smoothness, boxes: Boxes) -> NDArray[np.float64]:
    """Return the mean smoothness of the cells in each box, 0 to 1, shape (n,); NaN where unknown."""
    cells = rescaled(boxes, smoothness.pixels)
    total, known = mean_in_boxes(smoothness.total, cells), mean_in_boxes(smoothness.known, cells)
    return np.where(known >= _LEAST_SHARE, total / np.maximum(known, _LEAST_SHARE) / 1000, np.nan)
