"""Distances of vertices from outlines, many pairs at once, compiled.

The *vertex distance* of a polygon from another one is the mean, over the vertices of its rings (the closing vertex of
a ring counts once), of the distance to the nearest edge of the other. The mean of both directions is PoLiS (Avbelj,
Müller & Bamler 2015, equation 3, doi:10.1109/LGRS.2014.2330695).
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.footprints import Footprints

__all__ = ["vertex_distances"]

#: Pairs that a thread works on at a time.
_CHUNK = 1 << 14


def vertex_distances(
    one: Footprints,
    two: Footprints,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    *,
    threads: int | None = None,
) -> NDArray[np.float64]:
    """Return PoLiS of footprint `first` of one set and `second` of the other, m, shape (n,).

    The cost of a pair is the product of the numbers of vertices. The bits of the result do not depend on the number of
    `threads` (by default as many as there are processors).

    Examples
    --------
    >>> corners = np.array([(0.0, 0.0), (10, 0), (10, 10), (0, 10)])
    >>> squares = Footprints.from_rectangles([corners, corners + (1, 0)])
    >>> vertex_distances(squares, squares, np.array([0]), np.array([1]))
    array([0.5])
    """
    distances = np.empty(len(first))
    chunks = [slice(start, start + _CHUNK) for start in range(0, len(first), _CHUNK)]
    workers = min(threads or (os.cpu_count() or 1), len(chunks))

    def fill(part: slice) -> None:
        _fill(one.rings, two.rings, first[part], second[part], distances[part])

    if workers > 1:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(fill, chunks))
    else:
        for part in chunks:
            fill(part)
    return distances


@kernel
def _fill(
    one: tuple[NDArray[np.int64], NDArray[np.float64]],
    two: tuple[NDArray[np.int64], NDArray[np.float64]],
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    distances: NDArray[np.float64],
) -> None:
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
