"""Runs: lines of rectangles end to end, whose roofs are read as one row.

Houses of a row that differ much, or that stand a little apart, have a rectangle each, so that their party walls lie
between parts and not in one. Two rectangles are in one run when they have one direction, one begins where the other
ends, and they are about equally deep and beside each other: a lower wing is seldom as deep as its house.
"""

from __future__ import annotations

import numpy as np

from .arrays import Floats, Rectangles

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
    turn = np.abs((angle[:, None] - angle[None] + np.pi / 2) % np.pi - np.pi / 2)
    apart = place[None] - place[:, None]
    ahead = np.abs(np.einsum("ijk,ik->ij", apart, way))
    aside = np.abs(apart[..., 1] * way[:, None, 0] - apart[..., 0] * way[:, None, 1])
    meet = np.abs(ahead - along[:, None] - along[None]) * cell <= _APART
    common = np.minimum(2 * np.minimum(deep[:, None], deep[None]), deep[:, None] + deep[None] - aside)
    meet &= common >= _ALIKE * 2 * np.maximum(deep[:, None], deep[None])
    meet &= turn <= np.radians(_STRAIGHT)
    number, of = connected_components(meet & meet.T, directed=False)
    found = []
    for run in range(number):
        members = np.flatnonzero(of == run)
        if len(members) > 1:
            found.append(_around(place[members], angle[members], along[members], deep[members]))
    runs = np.array(found).reshape(-1, 5)
    deep = runs[:, 3] * cell
    return np.asarray(runs[(deep > 0) & (deep <= _DEEPEST) & (runs[:, 2] > runs[:, 3])])


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
