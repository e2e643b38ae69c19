"""Plain outlines, compiled: read from the bytes of WKB, and recognised as valid without an overlay library.

Nouns
-----
plain outline
    A polygon in two dimensions of one ring, alone or as the only part of a multipolygon.
clearly simple
    A ring whose edges meet nowhere but at common corners, by a margin that rounding cannot bridge, so the polygon is
    valid. Other rings may be valid, too: GEOS decides.

Most footprints are plain and clearly simple. The areas have the bits of GEOS.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel

__all__ = ["PlainOutlines", "clearly_simple", "plain_outlines"]

#: Rings of more vertices are left to GEOS, since every pair of edges is compared.
_MOST_VERTICES = 64
#: Share of (largest coordinate x extent) below which a turn may be rounding.
_ROUNDING = 1e-12
#: Coordinates of no system on earth, m.
_FARTHEST = 1e9


class PlainOutlines(NamedTuple):
    """What is read of some rows of WKB.

    Attributes
    ----------
    rows : ndarray of int64, shape (n,)
        Rows whose polygon is plain and clearly simple.
    start : ndarray of int64, shape (n + 1,)
    points : ndarray, shape (m, 2)
        Closed rings, as of `Footprints.rings`.
    areas : ndarray, shape (n,)
        m2, more than 0.
    """

    rows: NDArray[np.int64]
    start: NDArray[np.int64]
    points: NDArray[np.float64]
    areas: NDArray[np.float64]


def plain_outlines(offsets: NDArray[np.int64], data: NDArray[np.uint8]) -> PlainOutlines:
    """Return the plain, clearly simple outlines among geometries of WKB.

    Parameters
    ----------
    offsets : ndarray of int64, shape (n + 1,)
        Geometry i has the bytes ``data[offsets[i]:offsets[i + 1]]``.
    data : ndarray of uint8
    """
    counts = np.empty(len(offsets) - 1, dtype=np.int64)
    _count(offsets, data, counts)
    rows = np.flatnonzero(counts)
    start = np.concatenate([[0], np.cumsum(counts[rows])]).astype(np.int64)
    points = np.empty((start[-1], 2))
    _copy(offsets, data, rows, start, points.view(np.uint8).reshape(-1))
    areas = np.empty(len(rows))
    clear = np.empty(len(rows), dtype=np.bool_)
    _examine(start, points, areas, clear)
    if clear.all():
        return PlainOutlines(rows, start, points, areas)
    kept = np.repeat(clear, counts[rows])
    start = np.concatenate([[0], np.cumsum(counts[rows[clear]])]).astype(np.int64)
    return PlainOutlines(rows[clear], start, points[kept], areas[clear])


def clearly_simple(start: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which closed rings are clearly simple, shape (n,); ring i has the points ``start[i]`` to ``start[i + 1]``.

    Examples
    --------
    >>> square, bow_tie = [(0, 0), (2, 0), (2, 2), (0, 2), (0, 0)], [(0, 0), (2, 2), (2, 0), (0, 2), (0, 0)]
    >>> clearly_simple(np.array([0, 5, 10]), np.array([*square, *bow_tie], dtype=float)).tolist()
    [True, False]
    """
    areas, clear = np.empty(len(start) - 1), np.empty(len(start) - 1, dtype=np.bool_)
    _examine(start, points, areas, clear)
    return clear


@kernel
def _ring_begin(begin: int, data: NDArray[np.uint8]) -> int:
    """Return where the number of points of a geometry's only ring is; -1 if it is no polygon of one ring.

    Numbers are little-endian. A multipolygon of one part is such a polygon.
    """
    place = begin
    if data[begin + 1] == 6:
        for k in range(9):
            if data[begin + k] != (1 if k == 0 or k == 5 else (6 if k == 1 else 0)):
                return -1
        place = begin + 9
    for k in range(9):
        if data[place + k] != (1 if k == 0 or k == 5 else (3 if k == 1 else 0)):
            return -1
    return place + 9


@kernel
def _count(offsets: NDArray[np.int64], data: NDArray[np.uint8], counts: NDArray[np.int64]) -> None:
    """Fill the number of points of each geometry that is a polygon of one ring in two dimensions; else 0."""
    for i in range(len(counts)):
        begin, end = offsets[i], offsets[i + 1]
        counts[i] = 0
        if end - begin < 13 + 4 * 16:
            continue
        place = _ring_begin(begin, data)
        if place < 0:
            continue
        count = np.int64(data[place]) + 256 * np.int64(data[place + 1])
        few = data[place + 2] == 0 and data[place + 3] == 0 and count <= _MOST_VERTICES + 1
        if few and end - place == 4 + 16 * count:
            counts[i] = count


@kernel
def _copy(
    offsets: NDArray[np.int64],
    data: NDArray[np.uint8],
    rows: NDArray[np.int64],
    start: NDArray[np.int64],
    points: NDArray[np.uint8],
) -> None:
    """Fill the bytes of the points of some geometries."""
    for place in range(len(rows)):
        begin, into = _ring_begin(offsets[rows[place]], data) + 4, 16 * start[place]
        for k in range(16 * (start[place + 1] - start[place])):
            points[into + k] = data[begin + k]


@kernel
def _examine(
    start: NDArray[np.int64], points: NDArray[np.float64], areas: NDArray[np.float64], clear: NDArray[np.bool_]
) -> None:
    """Fill the area of each ring, and whether it is clearly simple."""
    for i in range(len(areas)):
        begin, last = start[i], start[i + 1] - 1
        clear[i], areas[i] = False, 0.0
        if last - begin < 3 or last - begin > _MOST_VERTICES:
            continue
        if not (points[begin, 0] == points[last, 0] and points[begin, 1] == points[last, 1]):
            continue  # not closed, or not finite
        # The sum of GEOS (Area::ofRingSigned), term by term.
        x = points[begin, 0]
        doubled, far, extent = 0.0, 0.0, 0.0
        for k in range(begin + 1, last):
            doubled += (points[k, 0] - x) * (points[k - 1, 1] - points[k + 1, 1])
        for k in range(begin, last):
            for axis in range(2):
                far = max(far, abs(points[k, axis]))
                extent = max(extent, abs(points[k, axis] - points[begin, axis]))
        areas[i] = abs(doubled / 2.0)
        # What is not a number fails this comparison.
        if areas[i] > 0.0 and far <= _FARTHEST:
            clear[i] = _is_simple(points, begin, last, 2.0 * _ROUNDING * far * extent)


@kernel
def _is_simple(points: NDArray[np.float64], begin: int, last: int, least: float) -> bool:
    """Return whether no two edges meet, where turns below `least` decide nothing."""
    for i in range(begin, last):
        ax, ay, bx, by = points[i, 0], points[i, 1], points[i + 1, 0], points[i + 1, 1]
        ex, ey = bx - ax, by - ay
        # The following edge begins at the end of this one: it must not run back over it.
        after = i + 2 if i + 1 < last else begin + 1
        fx, fy = points[after, 0] - bx, points[after, 1] - by
        turn = ex * fy - ey * fx
        if not (abs(turn) > least or ex * fx + ey * fy > least):
            return False
        left, right, low, high = min(ax, bx), max(ax, bx), min(ay, by), max(ay, by)
        for j in range(i + 2, last):
            if i == begin and j == last - 1:
                continue  # neighbours over the start of the ring
            cx, cy, dx, dy = points[j, 0], points[j, 1], points[j + 1, 0], points[j + 1, 1]
            if max(cx, dx) < left or min(cx, dx) > right or max(cy, dy) < low or min(cy, dy) > high:
                continue
            one = ex * (cy - ay) - ey * (cx - ax)
            two = ex * (dy - ay) - ey * (dx - ax)
            if (one > least and two > least) or (one < -least and two < -least):
                continue
            gx, gy = dx - cx, dy - cy
            one = gx * (ay - cy) - gy * (ax - cx)
            two = gx * (by - cy) - gy * (bx - cx)
            if (one > least and two > least) or (one < -least and two < -least):
                continue
            return False
    return True
