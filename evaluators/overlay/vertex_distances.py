"""Distances of vertices from outlines, many pairs at once, compiled.

The *vertex distance* of a polygon from another one is the mean, over the vertices of its rings (the closing vertex of
a ring counts once), of the distance to the nearest edge of the other. The mean of both directions is PoLiS (Avbelj,
Müller & Bamler 2015, equation 3, doi:10.1109/LGRS.2014.2330695).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel

__all__ = ["Rings", "ring_distances", "vertex_distances"]

#: Start of each outline in the rows of points, and points, m: as of `Footprints.rings`.
Rings: TypeAlias = tuple[NDArray[np.int64], NDArray[np.float64]]

#: Pairs that a thread works on at a time.
_CHUNK = 1 << 14


def vertex_distances(
    one: Rings,
    two: Rings,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    *,
    threads: int | None = None,
) -> NDArray[np.float64]:
    """Return PoLiS of outline `first` of one set and `second` of the other, m, shape (n,).

    The cost of a pair is the product of the numbers of vertices. The bits of the result do not depend on the number of
    `threads` (by default as many as there are processors).

    Examples
    --------
    >>> corners = np.array([(0.0, 0.0), (10, 0), (10, 10), (0, 10)])
    >>> from roofbench import Footprints
    >>> squares = Footprints.from_rectangles([corners, corners + (1, 0)]).rings
    >>> vertex_distances(squares, squares, np.array([0]), np.array([1]))
    array([0.5])
    """
    return _measured(_fill, one, two, (first, second), threads)


def ring_distances(
    one: Rings,
    two: Rings,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    by_corners: NDArray[np.bool_],
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.float64]]:
    """Return the columns of `PairDistances`: outline distance, whether it is measured at corners, and PoLiS.

    Parameters
    ----------
    one, two : Rings
    first, second : ndarray of int64, shape (n,)
        Rows in the two sets.
    by_corners : ndarray of bool, shape (n,)
        Where both outlines are convex quadrilaterals.
    """
    polis = vertex_distances(one, two, first, second)
    outline = polis.copy()
    outline[by_corners] = _measured(_align, one, two, (first[by_corners], second[by_corners]), None)
    return outline, by_corners, polis


def _measured(
    fill: Callable[..., None],
    one: Rings,
    two: Rings,
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]],
    threads: int | None,
) -> NDArray[np.float64]:
    distances = np.empty(len(pairs[0]))
    chunks = [slice(start, start + _CHUNK) for start in range(0, len(distances), _CHUNK)]
    with ThreadPoolExecutor(min(threads or (os.cpu_count() or 1), max(len(chunks), 1))) as pool:
        list(pool.map(lambda part: fill(one, two, pairs[0][part], pairs[1][part], distances[part]), chunks))
    return distances


@kernel
def _align(
    one: tuple[NDArray[np.int64], NDArray[np.float64]],
    two: tuple[NDArray[np.int64], NDArray[np.float64]],
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    distances: NDArray[np.float64],
) -> None:
    # Corners of two convex quadrilaterals in four alignments; `ways` is -1 where one runs against the other.
    """Fill the corner distances of some pairs."""
    for pair in range(len(first)):
        begin, low = one[0][first[pair]], two[0][second[pair]]
        ways = 1
        for start, points in ((begin, one[1]), (low, two[1])):
            turn = (points[start + 1, 0] - points[start, 0]) * (points[start + 2, 1] - points[start + 1, 1]) - (
                points[start + 1, 1] - points[start, 1]
            ) * (points[start + 2, 0] - points[start + 1, 0])
            if turn < 0.0:
                ways = -ways
        least = np.inf
        for shift in range(4):
            total = 0.0
            for k in range(4):
                other = low + (shift + ways * k) % 4
                x, y = one[1][begin + k, 0] - two[1][other, 0], one[1][begin + k, 1] - two[1][other, 1]
                total += x * x + y * y
            least = min(least, total)
        distances[pair] = np.sqrt(least / 4.0)


@kernel
def _fill(
    one: tuple[NDArray[np.int64], NDArray[np.float64]],
    two: tuple[NDArray[np.int64], NDArray[np.float64]],
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    distances: NDArray[np.float64],
) -> None:
    """Fill the distances of some pairs."""
    for pair in range(len(first)):
        i, j = first[pair], second[pair]
        there = _mean_distance(one[1], one[0][i], one[0][i + 1], two[1], two[0][j], two[0][j + 1])
        back = _mean_distance(two[1], two[0][j], two[0][j + 1], one[1], one[0][i], one[0][i + 1])
        distances[pair] = 0.5 * (there + back)


@kernel
def _mean_distance(
    points: NDArray[np.float64], begin: int, end: int, others: NDArray[np.float64], low: int, high: int
) -> float:
    """Return the mean distance of the vertices `begin` to `end` from the edges between the vertices `low` to `high`."""
    total, count = 0.0, 0
    for k in range(begin, end - 1):
        x, y = points[k, 0], points[k, 1]
        if x != x or points[k + 1, 0] != points[k + 1, 0]:
            continue  # between two rings, or the closing vertex of one
        nearest = np.inf
        px, py = others[low, 0] - x, others[low, 1] - y
        for m in range(low + 1, high):
            ax, ay = px, py
            px, py = others[m, 0] - x, others[m, 1] - y
            ex, ey = px - ax, py - ay
            length = ex * ex + ey * ey
            if length != length:
                continue
            along = 0.0 if length == 0.0 else min(max(-(ax * ex + ay * ey) / length, 0.0), 1.0)
            dx, dy = ax + along * ex, ay + along * ey
            square = dx * dx + dy * dy
            nearest = min(nearest, square)
        total += np.sqrt(nearest)
        count += 1
    return total / count
