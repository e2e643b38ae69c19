"""Rough cells between roofs: walls and roof structures are assigned to the roofs beside them.

A *rough* cell is high and belongs to no patch (`patches`). It is assigned to a patch when five of its eight neighbours
belong to one, so that walls and small structures shrink from their corners while the straight edge of a roof beside a
crown stays. Each round reads what the one before left, so the order in which cells are visited does not matter.
"""

from __future__ import annotations

import numpy as np

from ...core.kernels import kernel
from .arrays import Heights, Labels, States
from .cells import HIGH
from .threads import ONE_THREAD, Threads

__all__ = ["assign_rough_cells"]

#: Rounds, and so the largest number of cells by which walls shrink.
_ROUNDS = 8
#: Neighbours in patches from which on a rough cell is assigned.
_FEWEST = 5
#: Label of rough cells that the next round examines.
_WAITING = np.int32(-1)


def assign_rough_cells(height: Heights, state: States, labels: Labels, *, threads: Threads = ONE_THREAD) -> None:
    """Give rough cells between labelled ones the label and height of the neighbour nearest in height, in place.

    Parameters
    ----------
    height : ndarray of int32, shape (rows, columns)
        Centimetres.
    state : ndarray of uint8, shape (rows, columns)
    labels : ndarray of int32, shape (rows, columns)
        Patches from 1.
    threads : Threads
    """
    assigned = threads.bands(lambda first, last: _first_round(height, state, labels, first, last), len(labels))
    if assigned:
        _further_rounds(height, state, labels, np.concatenate(assigned))


@kernel(inline="always")
def _examine(height: Heights, labels: Labels, r: int, c: int, assigned: Labels, found: int) -> int:
    """Append a rough cell with the label and height that it is assigned, if any; return how many are assigned."""
    known, nearest, label, carrier = 0, np.int64(1) << 40, 0, 0
    for i in range(r - 1, r + 2):
        for j in range(c - 1, c + 2):
            if labels[i, j] > 0:
                known += 1
                gap = abs(np.int64(height[i, j]) - height[r, c])
                if gap < nearest:
                    nearest, label, carrier = gap, labels[i, j], height[i, j]
    if known < _FEWEST:
        return found
    assigned[found, 0], assigned[found, 1], assigned[found, 2], assigned[found, 3] = r, c, label, carrier
    return found + 1


@kernel
def _first_round(height: Heights, state: States, labels: Labels, first: int, last: int) -> Labels:
    """Return row, column, label and height of the cells of some rows that the first round assigns."""
    rows, columns = labels.shape
    # Sized for the worst case; pages that are not written take no memory.
    assigned = np.empty(((last - first) * columns, 4), dtype=np.int32)
    found = 0
    for r in range(max(first, 1), min(last, rows - 1)):
        for c in range(1, columns - 1):
            if labels[r, c] == 0 and state[r, c] == HIGH:
                found = _examine(height, labels, r, c, assigned, found)
    return assigned[:found].copy()


@kernel
def _further_rounds(height: Heights, state: States, labels: Labels, assigned: Labels) -> None:
    """Assign cells round by round, in place: after the first round changes happen only beside assigned cells."""
    rows, columns = labels.shape
    for turn in range(_ROUNDS):
        for k in range(len(assigned)):
            labels[assigned[k, 0], assigned[k, 1]], height[assigned[k, 0], assigned[k, 1]] = (
                assigned[k, 2],
                assigned[k, 3],
            )
        if turn == _ROUNDS - 1 or len(assigned) == 0:
            break
        waiting, size = np.empty((8 * len(assigned), 2), dtype=np.int32), 0
        for k in range(len(assigned)):
            for r in range(max(assigned[k, 0] - 1, 1), min(assigned[k, 0] + 2, rows - 1)):
                for c in range(max(assigned[k, 1] - 1, 1), min(assigned[k, 1] + 2, columns - 1)):
                    if labels[r, c] == 0 and state[r, c] == HIGH:
                        labels[r, c] = _WAITING
                        waiting[size, 0], waiting[size, 1] = r, c
                        size += 1
        assigned, found = np.empty((size, 4), dtype=np.int32), 0
        for k in range(size):
            found = _examine(height, labels, waiting[k, 0], waiting[k, 1], assigned, found)
        for k in range(size):
            labels[waiting[k, 0], waiting[k, 1]] = 0
        assigned = assigned[:found]
