"""Runs: lines of rectangles end to end, whose roofs are read as one row.

Houses of a row that differ much, or that stand a little apart, have a rectangle each, so that their party walls lie
between parts and not in one. Two rectangles are in one run when they have one direction, one begins where the other
ends, and they are about equally deep and beside each other: a lower wing is seldom as deep as its house.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from .arrays import Floats, Rectangles
from .rectangles import corners

__all__ = ["runs_of"]

#: Degrees: greatest difference of direction; metres: how far apart two ends are at most, or how far they overlap.
_STRAIGHT, _APART = 5.0, 1.0
#: Common depth of two rectangles at least, share of the deeper one.
_ALIKE = 0.7
#: Metres: deepest run; the sections of deeper roofs are no houses.
_DEEPEST = 16.0


def runs_of(rectangles: Rectangles, cell: float) -> Rectangles:
    """Return a rectangle along each run of two rectangles or more, as deep as all have in common, shape (runs, 5).

    Parameters
    ----------
    rectangles : ndarray, shape (n, 5)
        Of one block, grid frame.
    cell : float
        Metres.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    one = np.asarray(rectangles, dtype=np.float64).reshape(-1, 5)
    count = len(one)
    if count < 2:
        return np.empty((0, 5))
    # Either side of a rectangle may lie along the run: the second half of the rows is that of the other side.
    angle = np.concatenate([one[:, 4], one[:, 4] + np.pi / 2])
    along = np.concatenate([one[:, 2], one[:, 3]]) / 2
    deep = np.concatenate([one[:, 3], one[:, 2]]) / 2
    place = np.concatenate([one[:, :2], one[:, :2]])
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    i, j = _pairs(one, 2 * _APART / cell)
    apart = place[j] - place[i]
    turn = np.abs((angle[i] - angle[j] + np.pi / 2) % np.pi - np.pi / 2)
    meet = turn <= np.radians(_STRAIGHT)
    for side in (way[i], way[j]):
        ahead = np.abs((apart * side).sum(axis=1))
        aside = np.abs(apart[:, 1] * side[:, 0] - apart[:, 0] * side[:, 1])
        common = np.minimum(2 * np.minimum(deep[i], deep[j]), deep[i] + deep[j] - aside)
        meet &= np.abs(ahead - along[i] - along[j]) * cell <= _APART
        meet &= common >= _ALIKE * 2 * np.maximum(deep[i], deep[j])
    links = coo_matrix((np.ones(np.count_nonzero(meet), np.bool_), (i[meet], j[meet])), shape=(2 * count, 2 * count))
    number, of = connected_components(links, directed=False)
    found = []
    for run in range(number):
        members = np.flatnonzero(of == run)
        if len(members) > 1:
            found.append(_around(place[members], angle[members], along[members], deep[members]))
    runs = np.array(found).reshape(-1, 5)
    deep = runs[:, 3] * cell
    return np.asarray(runs[(deep > 0) & (deep <= _DEEPEST) & (runs[:, 2] > runs[:, 3])])


def _pairs(rectangles: Rectangles, reach: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows of the sides of two rectangles at most some cells apart; the first rectangle is the earlier."""
    outlines = shapely.polygons(corners(rectangles))
    one, other = shapely.STRtree(outlines).query(outlines, predicate="dwithin", distance=reach)
    one, other = one[one < other], other[one < other]
    count = len(rectangles)
    return (
        np.concatenate([one, one, one + count, one + count]),
        np.concatenate([other, other + count, other, other + count]),
    )


def _around(place: Floats, angle: Floats, along: Floats, deep: Floats) -> Floats:
    """Return the rectangle of one run from centres, directions and half sides, in the direction of the longest."""
    longest = int(np.argmax(along))
    way = np.array([np.cos(angle[longest]), np.sin(angle[longest])])
    side = np.array([-way[1], way[0]])
    ahead, aside = place @ way, place @ side
    first, last = (ahead - along).min(), (ahead + along).max()
    low, high = (aside - deep).max(), (aside + deep).min()
    middle = (first + last) / 2 * way + (low + high) / 2 * side
    return np.array([*middle, last - first, high - low, angle[longest]])
