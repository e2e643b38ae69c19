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

__all__ = ["meeting_bounds", "meeting_bounds_within"]

#: Children of a node.
_WIDTH = 8
#: Footprints that a thread searches at a time.
_CHUNK = 1 << 15


class _Tree(NamedTuple):
    """A packed tree.

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


def meeting_bounds(
    one: NDArray[np.float64], two: NDArray[np.float64], *, most: float, threads: int | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Return the pairs (row in `one`, row in `two`) whose bounds share area, sorted.

    Parameters
    ----------
    one, two : ndarray, shapes (n, 4), (m, 4)
        xmin, ymin, xmax, ymax, m.
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
    >>> [rows.tolist() for rows in meeting_bounds(boxes[:1], boxes, most=10)]
    [[0, 0], [0, 1]]
    """
    return _joined(_planted(one), _planted(two), False, most, threads)


def meeting_bounds_within(
    bounds: NDArray[np.float64], *, most: float, threads: int | None = None
) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Return the pairs of rows of one set whose bounds share area, each once, the lower row first; sorted.

    See `meeting_bounds`.

    Examples
    --------
    >>> boxes = np.array([[0.0, 0, 2, 2], [1, 1, 3, 3], [2, 0, 4, 1]])
    >>> [rows.tolist() for rows in meeting_bounds_within(boxes, most=10)]
    [[0], [1]]
    """
    tree = _planted(bounds)
    return _joined(tree, tree, True, most, threads)


def _planted(bounds: NDArray[np.float64]) -> _Tree:
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
    return _Tree(np.concatenate(levels), start, row)


def _joined(
    one: _Tree, two: _Tree, within: bool, most: float, threads: int | None
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
def _search(one: _Tree, two: _Tree, begin: int, end: int, within: bool) -> NDArray[np.int64]:
    """Return row of one x (number of leaves of two) + row of two, of the leaves `begin` to `end` of one."""
    keys = np.empty(2 * (end - begin) + 16, dtype=np.int64)
    count = 0
    width = len(two.row)
    top = len(two.level) - 2
    nodes = np.empty(8 * (top + 2), dtype=np.int64)
    levels = np.empty(8 * (top + 2), dtype=np.int64)
    for leaf in range(begin, end):
        xmin, ymin, xmax, ymax = one.boxes[leaf, 0], one.boxes[leaf, 1], one.boxes[leaf, 2], one.boxes[leaf, 3]
        own = one.row[leaf]
        nodes[0], levels[0], waiting = two.level[top], top, 1
        if width == 0:
            waiting = 0
        while waiting > 0:
            waiting -= 1
            node, level = nodes[waiting], levels[waiting]
            if not (
                two.boxes[node, 0] < xmax
                and xmin < two.boxes[node, 2]
                and two.boxes[node, 1] < ymax
                and ymin < two.boxes[node, 3]
            ):
                continue
            if level == 0:
                other = two.row[node]
                if within and other <= own:
                    continue
                if count == len(keys):
                    larger = np.empty(2 * count, dtype=np.int64)
                    larger[:count] = keys
                    keys = larger
                keys[count] = own * width + other
                count += 1
                continue
            child = two.level[level - 1] + 8 * (node - two.level[level])
            last = min(child + 8, two.level[level])
            while child < last:
                nodes[waiting], levels[waiting] = child, level - 1
                waiting += 1
                child += 1
    return keys[:count].copy()
