"""Measures of outlines that are given as rings: see `Footprints.rings` for their form."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["Quadrilaterals", "centres_of", "quadrilaterals_of"]

#: Indices (m,) and corners (m, 4, 2), counter-clockwise.
Quadrilaterals = tuple[NDArray[np.int64], NDArray[np.float64]]

#: Outlines that are measured at a time: few enough for the cache of a processor.
_CHUNK = 1 << 14


def quadrilaterals_of(start: NDArray[np.int64], points: NDArray[np.float64]) -> Quadrilaterals:
    """Return the convex quadrilaterals without holes.

    Parameters
    ----------
    start : ndarray of int64, shape (n + 1,)
    points : ndarray, shape (m, 2)
    """
    candidates = np.flatnonzero(np.diff(start) == 5)  # a closed ring; two rings take nine rows
    corners, convex = np.empty((len(candidates), 4, 2)), np.empty(len(candidates), dtype=bool)
    for begin in range(0, len(candidates), _CHUNK):
        part = slice(begin, begin + _CHUNK)
        some = points[start[candidates[part]][:, None] + np.arange(4)]
        turns = _turns(some)
        left, right = np.asarray((turns > 0).all(axis=1)), np.asarray((turns < 0).all(axis=1))
        some[right] = some[right, ::-1]
        corners[part], convex[part] = some, left | right
    if convex.all():
        return candidates, corners
    return candidates[convex], corners[convex]


def centres_of(
    start: NDArray[np.int64], points: NDArray[np.float64], quadrilaterals: Quadrilaterals
) -> NDArray[np.float64]:
    """Return the centre of each outline, shape (n, 2): of a convex quadrilateral the intersection of its diagonals.

    Parameters
    ----------
    start : ndarray of int64, shape (n + 1,)
    points : ndarray, shape (m, 2)
    quadrilaterals : tuple of ndarray
        As of `quadrilaterals_of`.
    """
    count = len(start) - 1
    centres = np.empty((count, 2))
    index, corners = quadrilaterals
    others = np.ones(count, dtype=bool)
    others[index] = False
    if others.any():
        centres[others] = _centroids(start, points)[others]
    if len(index):
        first, second = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        offset = corners[:, 1] - corners[:, 0]
        along = offset[:, 0] * second[:, 1] - offset[:, 1] * second[:, 0]
        along /= first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        centres[index] = corners[:, 0] + along[:, None] * first
    return centres


def _turns(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cross product of the two edges at each corner of quadrilaterals (n, 4, 2), shape (n, 4)."""
    edges = np.roll(corners, -1, axis=1) - corners
    following = np.roll(edges, -1, axis=1)
    turns: NDArray[np.float64] = edges[..., 0] * following[..., 1] - edges[..., 1] * following[..., 0]
    return turns


def _centroids(start: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the area centroid of each outline, shape (n, 2)."""
    counts = np.diff(start)
    some = counts > 0
    origin = np.full((len(counts), 2), np.nan)
    origin[some] = points[start[:-1][some]]
    # Coordinates from the first vertex keep all digits however far the scene is from the origin of its CRS.
    x, y = (points[:, axis] - np.repeat(origin[:, axis], counts) for axis in range(2))
    gaps = np.flatnonzero(np.isnan(x))
    x[gaps] = y[gaps] = 0.0  # between two rings: edges to the origin have no turn
    turn = x[:-1] * y[1:] - x[1:] * y[:-1]
    turn[start[1:-1][counts[:-1] > 0] - 1] = 0.0  # between two footprints
    begin = start[:-1][some]
    sums = np.zeros((3, len(counts)))
    sums[0, some] = np.add.reduceat(turn, begin)
    for axis, along in enumerate((x, y)):
        sums[axis + 1, some] = np.add.reduceat(turn * (along[:-1] + along[1:]), begin)
    with np.errstate(divide="ignore", invalid="ignore"):
        centroids: NDArray[np.float64] = origin + (sums[1:] / (3 * sums[0])).T
    return centroids
