"""Which corners of matched footprints lie near each other, one to one.

A *corner* is a vertex of any ring, the closing one not counted. Corners of a pair of footprints are matched by rising
distance, as far as both are free, within a radius: the rule of Nauata & Furukawa 2020 (Vectorizing World Buildings,
ECCV, section 6; 8 pixels there), with a radius in metres and without confidences.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from .greedy import accept_in_order

__all__ = ["MatchedCorners", "match_corners"]

#: Pairs of corners that are measured at once.
_CHUNK = 1 << 20


class MatchedCorners(NamedTuple):
    """Matched corners of each pair.

    Attributes
    ----------
    counts : ndarray of int64, shape (n,)
    distances : ndarray, shape (n,)
        Sum of the distances of the matched corners, m.
    """

    counts: NDArray[np.int64]
    distances: NDArray[np.float64]


def match_corners(first: NDArray[np.object_], second: NDArray[np.object_], radius: float) -> MatchedCorners:
    """Match the corners of each pair of polygons.

    Parameters
    ----------
    first, second : ndarray of polygons, shape (n,)
    radius : float
        Largest distance of matched corners, m; a corner at exactly this distance is matched.

    Examples
    --------
    >>> square, longer = np.array([shapely.box(0, 0, 10, 10)]), np.array([shapely.box(0.5, 0, 15, 10)])
    >>> match_corners(square, longer, 1.0)
    MatchedCorners(counts=array([2]), distances=array([1.]))
    """
    one, two = _corners(first), _corners(second)
    sizes = np.diff(one.start) * np.diff(two.start)
    found = []
    begin = 0
    while begin < len(first):
        end = max(begin + 1, int(np.searchsorted(np.cumsum(sizes[begin:]), _CHUNK, side="right")) + begin)
        found.append(_near(one, two, np.arange(begin, end), radius))
        begin = end
    if not found:
        return MatchedCorners(np.zeros(0, dtype=np.int64), np.zeros(0))
    corner, other, distance = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.lexsort((other, corner, np.round(distance, 9)))
    corner, other, distance = corner[order], other[order], distance[order]
    partner, _ = accept_in_order(corner, other, (len(one.points), len(two.points)))
    accepted = partner[corner] == other
    owner = one.owner[corner[accepted]]
    counts = np.bincount(owner, minlength=len(first)).astype(np.int64)
    sums = np.bincount(owner, weights=distance[accepted], minlength=len(first)).astype(np.float64)
    return MatchedCorners(counts, sums)


class _Corners(NamedTuple):
    start: NDArray[np.int64]
    owner: NDArray[np.int64]
    points: NDArray[np.float64]


def _corners(polygons: NDArray[np.object_]) -> _Corners:
    parts, part_of = shapely.get_parts(polygons, return_index=True)
    rings, ring_of = shapely.get_rings(parts, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    open_ones = np.append(ring[1:] == ring[:-1], False)[: len(ring)]
    owner = part_of[ring_of[ring[open_ones]]]
    return _Corners(np.searchsorted(owner, np.arange(len(polygons) + 1)), owner, points[open_ones])


def _near(
    one: _Corners, two: _Corners, rows: NDArray[np.int64], radius: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return the pairs of corners of some pairs of polygons that are at most `radius` apart, with their distances."""
    low, high = one.start[rows[0]], one.start[rows[-1] + 1]
    corner = np.arange(low, high)
    owner = one.owner[corner]
    sizes = np.diff(two.start)[owner]
    corner = np.repeat(corner, sizes)
    within = np.arange(len(corner)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    other = np.repeat(two.start[owner], sizes) + within
    apart = one.points[corner] - two.points[other]
    distance = np.hypot(apart[:, 0], apart[:, 1])
    near = distance <= radius
    return corner[near], other[near], distance[near]
