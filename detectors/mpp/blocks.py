"""Blocks: one footprint for all that is built together, located by rectangles and outlined along cells.

Nouns
-----
evidence
    Score (`background`) of the high cells around a high cell, summed up with the weights of a Gaussian.
built
    High cells with evidence for a roof, wherever they are, all but low cells inside rectangles, and high cells in gaps
    between those that are narrower than `_NARROW`: rough corners, passages and yards that are roofed over.
block
    Connected part of what is built, after small holes are filled and narrow parts between rectangles cut off, that lies
    at least half inside rectangles. Its outline gets straight walls (`regularise`).

Rectangles locate houses and their party walls. An old block is seldom rectangular: its cells show its edge better.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.outlines import coverage_of_mask, trace
from ...scenes.geodata.raster import Grid
from ..shared.morphology import closed, opened, without_holes
from ..shared.regularise import regularise
from .cells import HIGH, LOW
from .rectangles import inside_any

__all__ = ["outline_blocks"]

#: Metres: sigma of the mean of evidence, radius of the opening, least distance of points that are no wall.
_SIGMA, _OPENING, _STRAIGHT = 0.75, 1.0, 0.5
#: Metres: width of the gaps in which every high cell is built. Crowns are wider.
_NARROW = 5.0
#: Square metres: largest hole that is filled, smallest block.
_HOLE, _SMALLEST = 10.0, 5.0
#: Rows of a strip.
_STRIP = 256
#: Share of a block that must lie inside rectangles.
_CONFIRMED = 0.5


def outline_blocks(
    rectangles: NDArray[np.float64], grid: Grid, state: NDArray[np.uint8], score: NDArray[np.int16]
) -> NDArray[np.object_]:
    """Return the polygons, with courtyards as holes, of the blocks that rectangles, shape (n, 5), belong to.

    Parameters
    ----------
    rectangles : ndarray, shape (n, 5)
        Grid frame.
    grid : Grid
    state : ndarray of uint8, shape (rows, columns)
        See `cells`.
    score : ndarray of int16, shape (rows, columns)
        See `background`.
    """
    gsd = grid.gsd
    traced = _traced(_built(rectangles, gsd, state, score), grid)
    polygons: NDArray[np.object_] = regularise(traced, max(gsd, _STRAIGHT))
    large: NDArray[np.bool_] = shapely.area(polygons) >= _SMALLEST
    return polygons[large]


def _traced(built: NDArray[np.bool_], grid: Grid) -> NDArray[np.object_]:
    """Return the whole outlines of blocks, traced strip by strip of the rows in which they begin.

    The tracing library takes 34 bytes per cell.
    """
    import cv2

    # Cells that touch by a corner stay together here; the tracing library decides whether they are one outline.
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(built.astype(np.uint8), connectivity=8)
    begins = statistics[:, cv2.CC_STAT_TOP]
    ends = begins + statistics[:, cv2.CC_STAT_HEIGHT]
    found = [np.empty(0, dtype=object)]
    for top in range(0, grid.rows, _STRIP):
        own = (begins >= top) & (begins < top + _STRIP)
        own[0] = False
        if own.any():
            mask = own[labels[top : ends[own].max()]]
            strip = Grid(grid.west, grid.north - top * grid.gsd, grid.gsd, len(mask), grid.columns)
            found.append(trace(coverage_of_mask(mask), strip))
    return np.concatenate(found)


def _built(
    rectangles: NDArray[np.float64], gsd: float, state: NDArray[np.uint8], score: NDArray[np.int16]
) -> NDArray[np.bool_]:
    """Return the cells of blocks."""
    import cv2

    inside = inside_any(rectangles, state.shape)
    high = state == HIGH
    around = cv2.GaussianBlur(np.where(high, score, 0).astype(np.float32), (0, 0), _SIGMA / gsd)
    roof = high & (around > 0)
    sure = inside & (state != LOW)
    built = roof | sure
    built |= high & closed(built, 0.5 * _NARROW / gsd)
    built = opened(without_holes(built, _HOLE / gsd**2), _OPENING / gsd) | sure
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(built.astype(np.uint8), connectivity=4)
    kept = np.bincount(labels[inside], minlength=count) >= _CONFIRMED * statistics[:, cv2.CC_STAT_AREA]
    kept[0] = False
    return np.asarray(kept[labels])
