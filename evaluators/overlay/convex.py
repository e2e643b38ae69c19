"""Intersection areas of convex quadrilaterals, many pairs at once.

Footprints are mostly rectangles, and general polygon overlay is fifty times slower than clipping one rectangle by the
four half planes of another. All pairs are clipped together, one half plane at a time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["convex_intersection_areas"]

#: Pairs clipped at once: large enough to hide the interpreter, small enough for the processor's cache.
_CHUNK = 1 << 14


def convex_intersection_areas(first: NDArray[np.float64], *others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the area that convex quadrilaterals have in common, for many sets of them at once.

    Parameters
    ----------
    first, *others : ndarray, each of shape (n, 4, 2)
        Corners in counter-clockwise order, metres; row i of all arrays is one set.

    Returns
    -------
    ndarray, shape (n,)
        Square metres; 0 for quadrilaterals that touch or are apart.

    Examples
    --------
    >>> square = np.array([[[0.0, 0], [2, 0], [2, 2], [0, 2]]])
    >>> convex_intersection_areas(square, square + 1.0)
    array([1.])
    """
    areas = np.empty(len(first))
    for start in range(0, len(first), _CHUNK):
        part = slice(start, start + _CHUNK)
        # Coordinates from a corner of the set keep all digits however far the scene is from the origin of its CRS.
        origin = first[part, :1]
        x, y = np.moveaxis(first[part] - origin, 2, 0)
        for window in others:
            x, y = _clip(x, y, window[part] - origin)
        doubled = (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1)
        areas[part] = np.maximum(doubled, 0.0) / 2
    return areas


def _clip(
    x: NDArray[np.float64], y: NDArray[np.float64], window: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Clip convex rings by the left half plane of each edge of their window (Sutherland & Hodgman 1974).

    Rings have shape (n, vertices); a ring with fewer vertices repeats its first one at the end.
    """
    for edge in range(4):
        ax, ay = window[:, edge, 0, None], window[:, edge, 1, None]
        dx = window[:, (edge + 1) % 4, 0, None] - ax
        dy = window[:, (edge + 1) % 4, 1, None] - ay
        side = dx * (y - ay) - dy * (x - ax)
        inside = side >= 0
        next_x, next_y, next_side = (np.roll(array, -1, axis=1) for array in (x, y, side))
        crossing = inside != (next_side >= 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            along = np.where(crossing, side / (side - next_side), 0.0)
        n, vertices = x.shape
        # Each old vertex yields up to two new ones: itself when inside, and the crossing of the edge that follows.
        out_x, out_y = np.empty((n, 2 * vertices)), np.empty((n, 2 * vertices))
        keep = np.empty((n, 2 * vertices), dtype=bool)
        out_x[:, 0::2], out_y[:, 0::2], keep[:, 0::2] = x, y, inside
        out_x[:, 1::2], out_y[:, 1::2] = x + along * (next_x - x), y + along * (next_y - y)
        keep[:, 1::2] = crossing
        # A half plane adds at most one vertex to a convex ring.
        place = np.cumsum(keep, axis=1) - 1
        row, slot = np.nonzero(keep & (place <= vertices))
        target = place[row, slot]
        new_x, new_y = np.zeros((n, vertices + 1)), np.zeros((n, vertices + 1))
        new_x[row, target], new_y[row, target] = out_x[row, slot], out_y[row, slot]
        spare = np.arange(vertices + 1) > place[:, -1:]
        x, y = np.where(spare, new_x[:, :1], new_x), np.where(spare, new_y[:, :1], new_y)
    return x, y
