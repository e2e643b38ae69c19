"""The distance of the turning functions of two outlines: how alike two shapes are, whatever their place and size.

Nouns
-----
turning function
    The direction of an outline as a function of the way along it, as a share of the perimeter: a step at each vertex,
    by the angle through which the outline turns there. A full way around adds 2 pi.
shift
    The difference between the starting points of two outlines on the way.

The distance of two outlines is the root mean square difference of their turning functions, the least over all shifts
and over all rotations of one outline (Arkin, Chew, Huttenlocher, Kedem & Mitchell 1991, An efficiently computable
metric for comparing polygonal shapes, IEEE Transactions on Pattern Analysis and Machine Intelligence 13(3), equation
for d_2, doi:10.1109/34.75509). It is 0 exactly for similar shapes.

Minus its uniform growth, a turning function is a sum of sawtooth functions, one for each vertex. With the vertices of
one outline at s_k turning by a_k, and of the other at u_l turning by b_l, the covariance of both at shift t is

    C(t) = 1/2 sum_kl a_k b_l B({t - s_k + u_l}),    B(x) = x**2 - x + 1/6,

with {x} the fraction of x, and the squared distance at the best rotation is V_a + V_b - 2 C(t), with the variances V.
C is convex between the shifts that bring two vertices together, so its maximum is at one of these; sorting them gives
all values by cumulative sums.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

__all__ = ["turning_distances"]

#: Shifts that are worked on at once, and beyond which those of one pair are taken from a lattice.
_CHUNK = 1 << 21
#: Points of that lattice.
_LATTICE = 1 << 16


def turning_distances(first: NDArray[np.object_], second: NDArray[np.object_]) -> NDArray[np.float64]:
    """Return the distance of the turning functions of each pair of polygons, radians, shape (n,).

    Exterior rings are compared; of a multipolygon that of its largest part. The resolution is about 1e-7.

    Parameters
    ----------
    first, second : ndarray of polygons, shape (n,)

    Examples
    --------
    A square and a rectangle twice as long as wide differ by a right angle on a sixth of the way: the mean difference is
    pi/12, its variance (pi/2)**2 (1/6 - 1/36), and the root of that pi/2 times sqrt(5)/6.

    >>> square, double = (np.array([shapely.box(0, 0, length, 1)]) for length in (1, 2))
    >>> round(float(turning_distances(square, double)[0]), 4)
    0.5854
    >>> round(float(turning_distances(square, np.array([shapely.Polygon([(0, 0), (3, 3), (0, 6), (-3, 3)])]))[0]), 6)
    0.0
    """
    sides = [_turning_functions(polygons) for polygons in (first, second)]
    counts = [np.diff(start) for start, _, _ in sides]
    distances = np.empty(len(first))
    for m, n in sorted(set(zip(*(count.tolist() for count in counts), strict=True))):
        rows = np.flatnonzero((counts[0] == m) & (counts[1] == n))
        at_once = max(1, _CHUNK // max(m * n, 1))
        for start in range(0, len(rows), at_once):
            some = rows[start : start + at_once]
            one, two = (_stacked(side, some, number) for side, number in zip(sides, (m, n), strict=True))
            distances[some] = _distances(*one, *two) if m * n <= _CHUNK else _on_lattice(*one, *two)
    return distances


_Functions = tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]


def _turning_functions(polygons: NDArray[np.object_]) -> _Functions:
    """Return the start of each outline in the rows, and the place (0 to 1) and angle of the turn at each vertex."""
    parts, owner = shapely.get_parts(polygons, return_index=True)
    largest = np.lexsort((-shapely.area(parts), owner))
    largest = largest[np.unique(owner[largest], return_index=True)[1]]
    rings = shapely.get_exterior_ring(shapely.orient_polygons(parts[largest]))
    points, ring = shapely.get_coordinates(rings, return_index=True)
    inside = ring[1:] == ring[:-1]
    edges, of = np.diff(points, axis=0)[inside], ring[:-1][inside]
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    edges, of, lengths = edges[lengths > 0], of[lengths > 0], lengths[lengths > 0]
    start = np.searchsorted(of, np.arange(len(polygons) + 1))
    before = np.arange(len(of)) - 1
    before[start[:-1]] = start[1:] - 1  # the edge before the first is the last
    ahead = np.einsum("ij,ij->i", edges[before], edges)
    across = edges[before, 0] * edges[:, 1] - edges[before, 1] * edges[:, 0]
    turns = np.arctan2(across, ahead)
    perimeters = np.bincount(of, weights=lengths, minlength=len(polygons))
    way = np.cumsum(lengths) - lengths
    return start, (way - way[start[:-1]][of]) / perimeters[of], turns


def _stacked(
    functions: _Functions, rows: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return places and turns of some outlines of `count` vertices, each of shape (rows, count)."""
    start, places, turns = functions
    take = start[rows][:, None] + np.arange(count)
    return places[take], turns[take]


def _distances(
    s: NDArray[np.float64], a: NDArray[np.float64], u: NDArray[np.float64], b: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the distance of each row: turns `a` at places `s` against turns `b` at places `u`."""
    shifts = ((s[:, :, None] - u[:, None, :]) % 1.0).reshape(len(s), -1)
    weights = (a[:, :, None] * b[:, None, :]).reshape(len(s), -1)
    order = np.argsort(shifts, axis=1)
    t, w = np.take_along_axis(shifts, order, axis=1), np.take_along_axis(weights, order, axis=1)
    # B(x) of x = t - d for earlier shifts d, and of t - d + 1 for later ones: x**2 + x + 1/6 of x = t - d.
    below = np.cumsum(w, axis=1), np.cumsum(w * t, axis=1)
    total = [np.sum(w * t**power, axis=1, keepdims=True) for power in range(3)]
    squares = total[0] * t**2 - 2 * t * total[1] + total[2]
    linear = -(below[0] * t - below[1]) + ((total[0] - below[0]) * t - (total[1] - below[1]))
    covariance = (squares + linear + total[0] / 6) / 2
    return _root(_variance(s, a) + _variance(u, b) - 2 * covariance.max(axis=1))


def _variance(places: NDArray[np.float64], turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the variance of each turning function without its uniform growth."""
    # The function between two vertices, and its mean there, from which it falls by 2 pi times the way.
    widths = np.diff(places, axis=1, append=1.0)
    middle = np.cumsum(turns, axis=1) - 2 * np.pi * (places + widths / 2)
    mean = np.sum(widths * middle, axis=1, keepdims=True)
    within = np.sum(widths**3, axis=1) * (2 * np.pi) ** 2 / 12
    variance: NDArray[np.float64] = np.sum(widths * (middle - mean) ** 2, axis=1) + within
    return variance


def _on_lattice(
    s: NDArray[np.float64], a: NDArray[np.float64], u: NDArray[np.float64], b: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the distance of each row with the least over the shifts of a lattice, for very many vertices."""
    way = (np.arange(_LATTICE) + 0.5) / _LATTICE
    distances = np.empty(len(s))
    for row in range(len(s)):
        steps = [
            np.cumsum(turns[row])[np.searchsorted(places[row], way, side="right") - 1] - 2 * np.pi * way
            for places, turns in ((s, a), (u, b))
        ]
        one, two = (step - step.mean() for step in steps)
        covariance = np.fft.irfft(np.fft.rfft(one) * np.conj(np.fft.rfft(two)), _LATTICE) / _LATTICE
        distances[row] = _root(one.var() + two.var() - 2 * covariance.max())
    return distances


def _root(squares: NDArray[np.float64]) -> NDArray[np.float64]:
    roots: NDArray[np.float64] = np.sqrt(np.maximum(squares, 0.0))
    return roots
