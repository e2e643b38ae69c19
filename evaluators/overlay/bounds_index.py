"""Pairs of footprints whose bounds meet, compiled: a packed tree of bounds, searched by several threads.

The leaves of the tree are the bounds in the order of their centres along a Z-shaped curve (Morton order), so that
neighbours in the plane are neighbours in memory; each node is the common bounds of `_WIDTH` successors of the level
below. Neither the order of the footprints nor a few that are far away or very large slow the search.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.footprints import Footprints
from .kept import kept_with_footprints

__all__ = ["BoundsTree", "bounds_tree", "meeting_bounds", "meeting_bounds_within"]

#: Children of a node.
_WIDTH = 8
#: Footprints that a thread searches at a time.
_CHUNK = 1 << 15


class BoundsTree(NamedTuple):
    """A packed tree of bounds.

    Attributes
    ----------
    boxes : ndarray, shape (m, 4)
        xmin, ymin, xmax, ymax: the leaves, then the nodes of each level, the root last.
    level : ndarray of int64, shape (number of levels + 1,)
        Where each level starts in `boxes`.
    row : ndarray of int64, shape (n,)
        Row of each leaf in the set.
    """

    boxes: NDArray[np.float64]
    level: NDArray[np.int64]
    row: NDArray[np.int64]

    @classmethod
    def of(cls, bounds: NDArray[np.float64]) -> BoundsTree:
        """Return the tree of some bounds: xmin, ymin, xmax, ymax, m, shape (n, 4)."""
        keys = np.empty(len(bounds), dtype=np.uint64)
        if len(bounds):
            low, high = bounds[:, :2].min(axis=0), bounds[:, 2:].max(axis=0)
            _morton(bounds, low, np.maximum(high - low, 1e-9), keys)
        row = np.argsort(keys, kind="stable")
        levels = [np.ascontiguousarray(bounds[row])]
        while len(levels[-1]) > 1:
            below = levels[-1]
            begin = np.arange(0, len(below), _WIDTH)
            low, high = (
                reduce.reduceat(below[:, part], begin, axis=0)
                for reduce, part in ((np.minimum, slice(0, 2)), (np.maximum, slice(2, 4)))
            )
            levels.append(np.concatenate([low, high], axis=1))
        start = np.concatenate([[0], np.cumsum([len(level) for level in levels])]).astype(np.int64)
        return cls(np.concatenate(levels), start, row)


@kept_with_footprints
def bounds_tree(footprints: Footprints) -> BoundsTree:
    """Return the tree of the bounds of footprints."""
    return BoundsTree.of(footprints.bounds)


def meeting_bounds(
    one: BoundsTree, two: BoundsTree, *, most: float, threads: int | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Return the pairs (row in `one`, row in `two`) whose bounds share area, sorted.

    Parameters
    ----------
    one, two : BoundsTree
    most : float
        Largest number of pairs.
    threads : int, optional
        By default as many as there are processors; the result does not depend on their number.

    Returns
    -------
    tuple of ndarray of int64, or None
        None where there are more than `most` pairs.

    Examples
    --------
    >>> boxes = np.array([[0.0, 0, 2, 2], [1, 1, 3, 3], [2, 0, 4, 1]])
    >>> [rows.tolist() for rows in meeting_bounds(BoundsTree.of(boxes[:1]), BoundsTree.of(boxes), most=10)]
    [[0, 0], [0, 1]]
    """
    return _joined(one, two, False, most, threads)


def meeting_bounds_within(
    tree: BoundsTree, *, most: float, threads: int | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Return the pairs of rows of one set whose bounds share area, each once, the lower row first; sorted.

    See `meeting_bounds`.

    Examples
    --------
    >>> boxes = np.array([[0.0, 0, 2, 2], [1, 1, 3, 3], [2, 0, 4, 1]])
    >>> [rows.tolist() for rows in meeting_bounds_within(BoundsTree.of(boxes), most=10)]
    [[0], [1]]
    """
    return _joined(tree, tree, True, most, threads)


def _joined(
    one: BoundsTree, two: BoundsTree, within: bool, most: float, threads: int | None
) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    count = len(one.row)
    found: list[NDArray[np.int64]] = []
    total = 0
    search: Callable[[int], NDArray[np.int64]] = lambda begin: _search(  # noqa: E731
        one, two, begin, min(begin + _CHUNK, count), within
    )
    with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
        # Few chunks are in flight at a time, so that a crowd ends the search before it fills the memory.
        for begin in range(0, count, 16 * _CHUNK):
            starts = range(begin, min(begin + 16 * _CHUNK, count), _CHUNK)
            for keys in pool.map(search, starts):
                total += len(keys)
                found.append(keys)
            if total > most:
                return None
    keys = np.concatenate(found) if found else np.empty(0, dtype=np.int64)
    keys.sort()
    width = max(len(two.row), 1)
    first = keys // width
    keys -= first * width
    return first, keys


@kernel
def _morton(
    bounds: NDArray[np.float64], low: NDArray[np.float64], size: NDArray[np.float64], keys: NDArray[np.uint64]
) -> None:
    """Fill the Z-order (Morton) key of the centre of each item."""
    for i in range(len(keys)):
        code = np.uint64(0)
        for axis in range(2):
            share = (0.5 * (bounds[i, axis] + bounds[i, axis + 2]) - low[axis]) / size[axis]
            v = np.uint64(min(max(share, 0.0), 1.0) * 4294967295.0)
            v = (v | (v << np.uint64(16))) & np.uint64(0x0000FFFF0000FFFF)
            v = (v | (v << np.uint64(8))) & np.uint64(0x00FF00FF00FF00FF)
            v = (v | (v << np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
            v = (v | (v << np.uint64(2))) & np.uint64(0x3333333333333333)
            v = (v | (v << np.uint64(1))) & np.uint64(0x5555555555555555)
            code |= v << np.uint64(axis)
        keys[i] = code


@kernel
def _search(one: BoundsTree, two: BoundsTree, begin: int, end: int, within: bool) -> NDArray[np.int64]:
    """Return row of one x (number of leaves of two) + row of two, of the leaves `begin` to `end` of one.

    `_WIDTH` successive leaves go down the tree together, since neighbours meet the same nodes.
    """
    keys = np.empty(2 * (end - begin) + 16, dtype=np.int64)
    count = 0
    width = len(two.row)
    top = len(two.level) - 2
    nodes, levels = np.empty((2, _WIDTH * (top + 3)), dtype=np.int64)
    for low in range(begin, end if width else begin, _WIDTH):
        high = min(low + _WIDTH, end)
        west, south, east, north = np.inf, np.inf, -np.inf, -np.inf
        for leaf in range(low, high):
            west, south = min(west, one.boxes[leaf, 0]), min(south, one.boxes[leaf, 1])
            east, north = max(east, one.boxes[leaf, 2]), max(north, one.boxes[leaf, 3])
        nodes[0], levels[0], waiting = two.level[top], top, 1
        while waiting > 0:
            waiting -= 1
            node, level = nodes[waiting], levels[waiting]
            if level > 0:
                child = two.level[level - 1] + _WIDTH * (node - two.level[level])
                last = min(child + _WIDTH, two.level[level])
                level -= 1
            else:
                child, last = node, node + 1  # the tree is one leaf
            # The last leaf below `child`, and by how much it grows from one child to the next.
            stride = _WIDTH**level
            final = (child - two.level[level] + 1) * stride - 1
            # Written in any case and counted where they meet: these branches are mispredicted too often.
            while child < last:
                meets = (
                    (two.boxes[child, 0] < east)
                    & (west < two.boxes[child, 2])
                    & (two.boxes[child, 1] < north)
                    & (south < two.boxes[child, 3])
                    & ((final > low) | (not within))  # of one set, each pair is found from its earlier leaf
                )
                nodes[waiting], levels[waiting] = child, level
                waiting += meets
                child += 1
                final += stride
            if level > 0:
                continue
            while waiting > 0 and levels[waiting - 1] == 0:
                waiting -= 1
                child = nodes[waiting]
                if count + _WIDTH > len(keys):
                    larger = np.empty(2 * len(keys), dtype=np.int64)
                    larger[:count] = keys[:count]
                    keys = larger
                box, other = two.boxes[child], two.row[child]
                for leaf in range(low, min(high, child) if within else high):
                    meets = (
                        (box[0] < one.boxes[leaf, 2])
                        & (one.boxes[leaf, 0] < box[2])
                        & (box[1] < one.boxes[leaf, 3])
                        & (one.boxes[leaf, 1] < box[3])
                    )
                    own = one.row[leaf]
                    keys[count] = min(own, other) * width + max(own, other) if within else own * width + other
                    count += meets
    return keys[:count].copy()
