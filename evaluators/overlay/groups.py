"""Connected groups of objects, and what they are made of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Members", "connected_groups"]


class Members(NamedTuple):
    """The members of many groups: polygons of one set, or what they share with polygons of another set.

    Attributes
    ----------
    start : ndarray of int64, shape (groups + 1,)
        Group g has the members ``start[g]`` to ``start[g + 1]``.
    one, two : ndarray of int64, shape (n,)
        Rows in the two sets; a member is what both polygons share. `two` is -1 where it is the polygon of `one` alone.
    """

    start: NDArray[np.int64]
    one: NDArray[np.int64]
    two: NDArray[np.int64]


def connected_groups(
    first: NDArray[np.int64], second: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the connected components of a graph given by its links.

    Returns
    -------
    start, nodes : ndarray of int64
        Component g has the nodes ``nodes[start[g]:start[g + 1]]``, in ascending order; components are in the order of
        their lowest node.

    Examples
    --------
    >>> connected_groups(np.array([1, 7, 2]), np.array([5, 2, 9]))
    (array([0, 2, 5]), array([1, 5, 2, 7, 9]))
    """
    nodes, place = np.unique(np.concatenate([first, second]), return_inverse=True)
    one, two = place[: len(first)], place[len(first) :]
    label = np.arange(len(nodes))
    while True:
        # Each tree is hung on the lowest label that a link of it reaches, then all paths are shortened.
        low = np.minimum(label[one], label[two])
        joined = label.copy()
        np.minimum.at(joined, label[one], low)
        np.minimum.at(joined, label[two], low)
        while not np.array_equal(shorter := joined[joined], joined):
            joined = shorter
        if np.array_equal(joined, label):
            break
        label = joined
    order = np.argsort(label, kind="stable")
    begins = np.flatnonzero(np.diff(label[order], prepend=-1))
    return np.append(begins, len(nodes)).astype(np.int64), nodes[order].astype(np.int64)
