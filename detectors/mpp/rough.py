"""Rough cells between roofs: walls and furniture eaten up by the roofs beside them.

A *rough* cell is high and belongs to no patch (`patches`). It is taken when five of its eight neighbours belong to one,
so that walls and furniture are eaten up from their corners while the straight edge of a roof beside a crown stays.
Each round goes by what the one before left, so the order in which cells are looked at does not matter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .cells import HIGH
from .threads import ONE_THREAD, Threads

__all__ = ["smooth_walls"]

#: Rounds, and so the cells that walls are eaten up by.
_ROUNDS = 8
#: Label of rough cells that wait for a closer look.
_WAITING = np.int32(-1)


def smooth_walls(
    height: NDArray[np.int32], state: NDArray[np.uint8], labels: NDArray[np.int32], *, threads: Threads = ONE_THREAD
) -> None:
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
    taken = threads.bands(lambda first, last: _first_round(height, state, labels, first, last), len(labels))
    if taken:
        _further_rounds(height, state, labels, np.concatenate(taken))


@kernel(inline="always")
def _look(height, labels, r, c, taken, found):  # type: ignore[no-untyped-def]
    """Append a rough cell with the label and height that it takes, if it takes any; return how many are taken."""
    known, nearest, label, carrier = 0, np.int64(1) << 40, 0, 0
    for i in range(r - 1, r + 2):
        for j in range(c - 1, c + 2):
            if labels[i, j] > 0:
                known += 1
                gap = abs(np.int64(height[i, j]) - height[r, c])
                if gap < nearest:
                    nearest, label, carrier = gap, labels[i, j], height[i, j]
    if known < 5:
        return found
    taken[found, 0], taken[found, 1], taken[found, 2], taken[found, 3] = r, c, label, carrier
    return found + 1


@kernel
def _first_round(height, state, labels, first, last):  # type: ignore[no-untyped-def]
    """Return row, column, label and height of the cells of some rows that are taken first."""
    rows, columns = labels.shape
    # Laid out for the worst case; only what is written takes memory.
    taken = np.empty(((last - first) * columns, 4), dtype=np.int32)
    found = 0
    for r in range(max(first, 1), min(last, rows - 1)):
        for c in range(1, columns - 1):
            if labels[r, c] == 0 and state[r, c] == HIGH:
                found = _look(height, labels, r, c, taken, found)
    return taken[:found].copy()


@kernel
def _further_rounds(height, state, labels, taken):  # type: ignore[no-untyped-def]
    """Take the cells of the first round, then those of all others: only beside what was taken anything has changed."""
    rows, columns = labels.shape
    for turn in range(_ROUNDS):
        for k in range(len(taken)):
            labels[taken[k, 0], taken[k, 1]], height[taken[k, 0], taken[k, 1]] = taken[k, 2], taken[k, 3]
        if turn == _ROUNDS - 1 or len(taken) == 0:
            break
        waiting, size = np.empty((8 * len(taken), 2), dtype=np.int32), 0
        for k in range(len(taken)):
            for r in range(max(taken[k, 0] - 1, 1), min(taken[k, 0] + 2, rows - 1)):
                for c in range(max(taken[k, 1] - 1, 1), min(taken[k, 1] + 2, columns - 1)):
                    if labels[r, c] == 0 and state[r, c] == HIGH:
                        labels[r, c] = _WAITING
                        waiting[size, 0], waiting[size, 1] = r, c
                        size += 1
        taken, found = np.empty((size, 4), dtype=np.int32), 0
        for k in range(size):
            found = _look(height, labels, waiting[k, 0], waiting[k, 1], taken, found)
        for k in range(size):
            labels[waiting[k, 0], waiting[k, 1]] = 0
        taken = taken[:found]
