"""Patches: connected cells of roof, and what they touch.

Nouns
-----
patch
    Cells (roof, or any that a mask chooses) connected through their four sides by steps no higher than a limit.
label
    Number of a patch, from 1, by the place of its first cell: row by row from the north, in a row from the west; 0 is
    no patch.
rim
    The neighbours of a patch outside it, each counted as often as it touches. Cells without points do not count; the
    border of the grid does.

Bands of rows are labelled independently, each with numbers from that of its first cell on, so that bands share no
number. Then patches that touch across a border of bands are joined, and renumbered in rising order. The smallest number
of a patch is that of its first cell, so labels do not depend on the bands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...core.kernels import kernel
from .arrays import Heights, Integers, Labels, Mask, States
from .cells import VOID
from .threads import ONE_THREAD, Threads

__all__ = [
    "Division",
    "Rims",
    "cells_of_patches",
    "count_rims",
    "divide_patches",
    "label_patches",
    "longer_patches",
    "patch_sizes",
]


class Division(NamedTuple):
    """The grid of squares that divides long patches, in cells.

    Attributes
    ----------
    row, column : int
        Number of the first row and column, counted from the origin of the CRS.
    side : int
    longest : int
        Longer patches are divided. A window whose halo is as wide shows of every patch of its core how long it is.
    """

    row: int
    column: int
    side: int
    longest: int


def label_patches(
    height: Heights, mask: Mask | Labels, step: int, *, threads: Threads = ONE_THREAD
) -> tuple[Labels, int]:
    """Label the patches of the cells that a mask chooses; also return how many there are.

    Parameters
    ----------
    height : ndarray of int32, shape (rows, columns)
        Centimetres.
    mask : ndarray of bool or int32, shape (rows, columns)
        Not 0 where a cell belongs to a patch.
    step : int
        Centimetres by which neighbours in a patch differ at most.
    threads : Threads
    """
    labels = np.empty(height.shape, dtype=np.int32)
    # Sized for the worst case, a patch for each cell; pages that are not written take no memory.
    parent = np.empty(height.size + 1, dtype=np.int32)
    numbered = threads.bands(
        lambda first, last: _label_rows(height, mask, step, first, last, labels, parent), len(height)
    )
    bands = np.array(numbered, dtype=np.int64)
    for row in bands[1:, 0]:
        _join_rows(height, labels, step, row, parent)
    count = _renumber(parent, bands, height.shape[1])
    threads.bands(lambda first, last: _relabel(labels, parent, first, last), len(height))
    return labels, count


def divide_patches(labels: Labels, count: int, division: Division) -> tuple[Labels, int]:
    """Divide long patches, measured along rows or columns, at the borders of the squares, in place.

    No building is so long. A terrace or a wood can be, and what is made of it must not depend on its far end, which a
    window may not show. Return the labels, pieces after all others, and how many there are.
    """
    long = np.flatnonzero(longer_patches(labels, count, division.longest))
    if len(long) == 0:
        return labels, count
    from scipy.ndimage import find_objects

    places = find_objects(labels, count)
    for number in long.tolist():
        place = places[number - 1]
        part = labels[place]
        row, column = np.nonzero(part == number)
        square_row = (row + place[0].start + division.row) // division.side
        square_column = (column + place[1].start + division.column) // division.side
        squares = np.stack([square_row, square_column], axis=1)
        _, piece = np.unique(squares, axis=0, return_inverse=True)
        part[row, column] = np.where(piece.ravel() == 0, number, count + piece.ravel())
        count += int(piece.max())
    return labels, count


@kernel
def _label_rows(
    height: Heights, mask: Mask | Labels, step: int, first: int, last: int, labels: Labels, parent: Labels
) -> tuple[int, int]:
    """Fill labels of some rows, for some patches several numbers that `parent` joins; return first row, last number."""
    columns = height.shape[1]
    number = first * columns
    for r in range(first, last):
        for c in range(columns):
            if not mask[r, c]:
                labels[r, c] = 0
                continue
            west, north = 0, 0
            if c > 0 and labels[r, c - 1] > 0 and abs(height[r, c - 1] - height[r, c]) <= step:
                west = labels[r, c - 1]
            if r > first and labels[r - 1, c] > 0 and abs(height[r - 1, c] - height[r, c]) <= step:
                north = labels[r - 1, c]
            label = max(west, north)
            if label == 0:
                number += 1
                label = number
                parent[number] = number
            elif west != north and min(west, north) > 0:
                label = _unite(parent, west, north)
            labels[r, c] = label
    return first, number


@kernel
def _unite(parent: Labels, one: int, other: int) -> int:
    """Join two numbers in place; return the smallest of what now belongs together."""
    while parent[one] != one:
        parent[one] = parent[parent[one]]
        one = parent[one]
    while parent[other] != other:
        parent[other] = parent[parent[other]]
        other = parent[other]
    root = min(one, other)
    parent[max(one, other)] = root
    return root


@kernel
def _join_rows(height: Heights, labels: Labels, step: int, row: int, parent: Labels) -> None:
    """Join what touches across the border above a row."""
    for c in range(labels.shape[1]):
        if labels[row - 1, c] > 0 and labels[row, c] > 0 and abs(height[row - 1, c] - height[row, c]) <= step:
            _unite(parent, labels[row - 1, c], labels[row, c])


@kernel
def _renumber(parent: Labels, bands: Integers, columns: int) -> int:
    """Replace parents by labels, in place; return how many there are."""
    count = 0
    for b in range(len(bands)):
        for number in range(bands[b, 0] * columns + 1, bands[b, 1] + 1):
            # A parent is smaller than its child, so it has its label already.
            if parent[number] == number:
                count += 1
                parent[number] = count
            else:
                parent[number] = parent[parent[number]]
    return count


@kernel
def _relabel(labels: Labels, parent: Labels, first: int, last: int) -> None:
    """Replace the numbers of some rows by labels, in place."""
    for r in range(first, last):
        for c in range(labels.shape[1]):
            if labels[r, c] > 0:
                labels[r, c] = parent[labels[r, c]]


def patch_sizes(labels: Labels, count: int, *, threads: Threads = ONE_THREAD) -> Integers:
    """Return how many cells have each label, shape (count + 1,), 0 for label 0."""
    tallies = threads.bands(lambda first, last: _tally(labels, count, first, last), len(labels))
    return np.asarray(np.sum(tallies, axis=0))


@kernel
def longer_patches(labels: Labels, count: int, longest: int) -> Mask:
    """Return which patches are longer, along rows or columns, than so many cells, shape (count + 1,)."""
    rows, columns = labels.shape
    top, bottom = np.full(count + 1, rows, dtype=np.int64), np.full(count + 1, -1, dtype=np.int64)
    left, right = np.full(count + 1, columns, dtype=np.int64), np.full(count + 1, -1, dtype=np.int64)
    for r in range(rows):
        for c in range(columns):
            label = labels[r, c]
            if label > 0:
                top[label], bottom[label] = min(top[label], r), r
                left[label], right[label] = min(left[label], c), max(right[label], c)
    found: Mask = np.maximum(bottom - top, right - left) >= longest
    return found


def cells_of_patches(labels: Labels, count: int, *, threads: Threads = ONE_THREAD) -> tuple[Labels, Integers]:
    """Return row and column of all cells of patches, patch by patch, and where each patch begins, shape (count + 1,).

    The cells of the patch with label k are those from ``starts[k - 1]`` to ``starts[k]``, in the order of the rows.
    """
    tallies = threads.bands(lambda first, last: (first, last, _tally(labels, count, first, last)), len(labels))
    ends = np.cumsum(np.sum([tally for _, _, tally in tallies], axis=0))
    places = np.cumsum([np.concatenate([[0], ends[:-1]]), *(tally for _, _, tally in tallies)], axis=0)
    cells = np.empty((ends[-1], 2), dtype=np.int32)
    jobs = [(first, last, place) for (first, last, _), place in zip(tallies, places, strict=False)]
    threads.map(lambda job: _sort_cells(labels, *job, cells), jobs)
    return cells, ends


@kernel
def _tally(labels: Labels, count: int, first: int, last: int) -> Integers:
    """Return how many cells of some rows have each label; none are counted for 0."""
    tally = np.zeros(count + 1, dtype=np.int64)
    for r in range(first, last):
        for c in range(labels.shape[1]):
            if labels[r, c] > 0:
                tally[labels[r, c]] += 1
    return tally


@kernel
def _sort_cells(labels: Labels, first: int, last: int, place: Integers, cells: Labels) -> None:
    """Write the cells of some rows to the places of their labels, which are moved on."""
    for r in range(first, last):
        for c in range(labels.shape[1]):
            label = labels[r, c]
            if label > 0:
                cells[place[label], 0], cells[place[label], 1] = r, c
                place[label] += 1


@dataclass(frozen=True, eq=False)
class Rims:
    """How large patches are and what they touch; all of shape (count + 1,), entry 0 is that of no patch.

    Attributes
    ----------
    cells : ndarray of int64
    length : ndarray of int64
        Of the rim.
    roof : ndarray of int64
        How much of the rim is roof that lies low enough.
    """

    cells: Integers
    length: Integers
    roof: Integers

    def carried(self, share: float) -> Mask:
        """Return which patches have such roof on at least a share of their rim."""
        return np.asarray((self.roof > 0) & (self.roof >= share * self.length))


def count_rims(
    patches: Labels,
    count: int,
    height: Heights,
    state: States,
    roof: Labels,
    *,
    fall: int,
    threads: Threads = ONE_THREAD,
) -> Rims:
    """Measure the rims of all patches.

    Parameters
    ----------
    patches : ndarray of int32, shape (rows, columns)
        Labels from 1 to `count`.
    count : int
    height : ndarray of int32, shape (rows, columns)
        Centimetres.
    state : ndarray of uint8, shape (rows, columns)
        See `cells`.
    roof : ndarray of int32, shape (rows, columns)
        More than 0 where a neighbour is roof.
    fall : int
        Centimetres that roof must lie below the cell that touches it, at least, to count.
    threads : Threads
    """

    def work(first: int, last: int) -> Integers:
        return _measure_rims(patches, count, height, state, roof, fall, first, last)  # type: ignore[no-any-return]

    return Rims(*np.sum(threads.bands(work, len(patches)), axis=0))


@kernel
def _measure_rims(
    patches: Labels, count: int, height: Heights, state: States, roof: Labels, fall: int, first: int, last: int
) -> Integers:
    """Return cells, length of the rim and roof on it, shape (3, count + 1), of the cells of some rows."""
    rows, columns = patches.shape
    found = np.zeros((3, count + 1), dtype=np.int64)
    for r in range(first, last):
        for c in range(columns):
            label = patches[r, c]
            if label == 0:
                continue
            found[0, label] += 1
            for side in range(4):
                i = r + (1 if side == 0 else (-1 if side == 1 else 0))
                j = c + (1 if side == 2 else (-1 if side == 3 else 0))
                if i < 0 or j < 0 or i >= rows or j >= columns:
                    found[1, label] += 1
                elif patches[i, j] != label and state[i, j] != VOID:
                    found[1, label] += 1
                    found[2, label] += roof[i, j] > 0 and height[r, c] - height[i, j] >= fall
    return found
