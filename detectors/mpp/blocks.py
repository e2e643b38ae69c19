"""Blocks: one footprint for all that is built together, located by rectangles and outlined along cells.

Nouns
-----
block
    Connected part of what is built (`block_cells`) that lies at least half inside rectangles. Its outline gets straight
    walls (`regularise`).

Rectangles locate houses and their party walls. An old block is seldom rectangular: its cells show its edge better.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.outlines import coverage_of_mask, trace
from ...scenes.geodata.raster import Grid
from ..shared.regularise import regularise
from .block_cells import built_cells

__all__ = ["outline_blocks"]

#: Metres: how far walls of one block influence each other.
_REACH = 64.0
#: Metres: least distance of points that are no wall.
_STRAIGHT = 0.5
#: Square metres: smallest block.
_SMALLEST = 5.0
#: Rows of a strip.
_STRIP = 256


def outline_blocks(
    rectangles: NDArray[np.float64],
    grid: Grid,
    height: NDArray[np.uint16],
    state: NDArray[np.uint8],
    score: NDArray[np.int16],
    openness: NDArray[np.uint8],
    *,
    crown_openness: float,
    within: Any = None,
) -> NDArray[np.object_]:
    """Return the polygons, with courtyards as holes, of the blocks that rectangles, shape (n, 5), belong to.

    Parameters
    ----------
    rectangles : ndarray, shape (n, 5)
        Grid frame.
    grid : Grid
    height : ndarray of uint16, shape (rows, columns)
        Height above ground, cm.
    state : ndarray of uint8, shape (rows, columns)
        See `cells`.
    score : ndarray of int16, shape (rows, columns)
        See `scores`.
    openness : ndarray of uint8, shape (rows, columns)
        See `cells`.
    crown_openness : float
        Mean openness of crowns, 0 to 1; nan where it is not known.
    within : shapely Polygon, optional
        Blocks that do not meet it are left out.
    """
    gsd = grid.gsd
    traced = _traced(built_cells(rectangles, gsd, height, state, score, openness, crown_openness), grid)
    if within is not None:
        traced = traced[shapely.intersects(traced, within)]
    polygons: NDArray[np.object_] = regularise(traced, max(gsd, _STRAIGHT), reach=_REACH)
    large: NDArray[np.bool_] = shapely.area(polygons) >= _SMALLEST
    return polygons[large]


def _traced(built: NDArray[np.bool_], grid: Grid) -> NDArray[np.object_]:
    """Return the whole outlines of blocks, traced strip by strip of the rows in which they begin.

    The tracing library takes 34 bytes per cell.
    """
    import cv2
    from scipy.ndimage import find_objects

    # Cells that touch by a corner stay together here; the tracing library decides whether they are one outline.
    _, labels = cv2.connectedComponents(built.astype(np.uint8), connectivity=8)
    # The first label is that of all other cells.
    rows = [(-1, -1), *((place[0].start, place[0].stop) for place in find_objects(labels))]
    begins, ends = np.array(rows).T
    found = [np.empty(0, dtype=object)]
    for top in range(0, grid.rows, _STRIP):
        own = (begins >= top) & (begins < top + _STRIP)
        if own.any():
            mask = own.take(labels[top : ends[own].max()])
            strip = Grid(grid.west, grid.north - top * grid.gsd, grid.gsd, len(mask), grid.columns)
            found.append(trace(coverage_of_mask(mask), strip))
    return np.concatenate(found)
