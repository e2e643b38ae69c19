"""Superstructures: lift houses, plant rooms and towers that stand on a roof belong to the building below them.

Nouns
-----
patch
    Cells with the texture of a roof connected through steps no higher than a limit, and the rough cells between them
    (walls, which have any height between two roofs, and furniture), which take the height of the roof beside them that
    is nearer in height. Crowns belong to none.
rim
    The neighbours of a patch outside it, each counted as often as it touches: lower patch, higher patch, or none. Cells
    without points (the shadow of a tower) do not count.
superstructure
    A patch whose rim is lower roof nearly all round. A house in a row is none: its front and back stand free.

furniture
    A small rough place with roof nearly all round.

Storeys of frames are lowered first (`frames`), then furniture and superstructures, towers on towers from the top down:
each cell to the level of the roof beside it, before roofs are fitted, so that it neither spoils the fit nor is cut out
as a building of its own.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .candidates import label_patches, propose_boxes
from .cells import HIGH, LOW, VOID
from .frames import lower_storeys
from .workers import ALONE, Workers

__all__ = ["lower_superstructures"]

#: Centimetres by which cells of a ledge differ at most.
_LEDGE = 30
#: Longest run of void cells that a tower's shadow leaves on a roof.
_SHADOW = 12
#: Cells that walls are eaten up by.
_ROUNDS = 8


def lower_superstructures(
    height: NDArray[np.int32],
    state: NDArray[np.uint8],
    roof: NDArray[np.bool_],
    *,
    step: float,
    share: float,
    most: int,
    rounds: int = 5,
    workers: Workers = ALONE,
) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Return heights and states with superstructures lowered to the roofs that carry them, and their shadows filled.

    Parameters
    ----------
    height : ndarray of int32, shape (rows, columns)
        Centimetres.
    state : ndarray of uint8, shape (rows, columns)
    roof : ndarray of bool, shape (rows, columns)
        Cells whose texture is that of a roof.
    step : float
        Metres by which neighbouring cells of a patch differ at most.
    share : float
        Share of the rim that must be lower roof; more than 1 changes nothing.
    most : int
        Cells that a rough place may have to count as furniture of the roof around it.
    rounds : int
        Towers on towers that are lowered.
    workers : Workers
    """
    if share > 1:
        return height, state
    lowered, state = _lower_storeys(height, state, roof, round(100 * step), workers)
    for turn in range(rounds):
        labels, count = label_patches(lowered, roof, round(100 * step))
        if turn == 0:
            _smooth_walls(lowered, state, labels, _ROUNDS)
        if turn == 0 and _fill_rough(lowered, state, labels, share, most):
            labels, count = label_patches(lowered, labels > 0, round(100 * step))
        roof = labels > 0
        if not _lower(lowered, state, labels, count, share, round(100 * step)):
            break
    return lowered, state


def _lower_storeys(
    height: NDArray[np.int32], state: NDArray[np.uint8], roof: NDArray[np.bool_], step: int, workers: Workers
) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Return heights and states with the storeys of frames lowered."""
    smooth, lowered, filled = height.copy(), height.copy(), state.copy()
    labels, count = label_patches(smooth, _with_ledges(height, state, roof), step)
    _smooth_walls(smooth, state, labels, _ROUNDS)
    jobs = ((_with_shadows(state), 1e6), (labels > 0, 0.01 * step))
    boxes = np.concatenate(
        workers.map(lambda job: propose_boxes(smooth, job[0], steps=(job[1],), least_cells=24), jobs)
    )
    boxes = boxes[np.argsort(-boxes[:, 2] * boxes[:, 3], kind="stable")]
    lower_storeys(lowered, filled, labels, count, boxes, step)
    return lowered, filled


@njit(cache=True, nogil=True)
def _with_shadows(state):  # type: ignore[no-untyped-def]
    """Return the high cells, and the runs of void ones between two of them in a row or a column: shadows of towers."""
    rows, columns = state.shape
    solid = state == HIGH
    for r in range(rows):
        last = -_SHADOW
        for c in range(columns):
            if state[r, c] == HIGH:
                if 1 < c - last <= _SHADOW:
                    solid[r, last + 1 : c] = True
                last = c
            elif state[r, c] == LOW:
                last = -_SHADOW
    for c in range(columns):
        last = -_SHADOW
        for r in range(rows):
            if state[r, c] == HIGH:
                if 1 < r - last <= _SHADOW:
                    solid[last + 1 : r, c] = True
                last = r
            elif state[r, c] == LOW:
                last = -_SHADOW
    return solid


@njit(cache=True, nogil=True)
def _with_ledges(height, state, roof):  # type: ignore[no-untyped-def]
    """Return the roof cells and the high cells that share their height with four of their eight neighbours.

    A ledge around a tower is too narrow for a window of texture, and level nevertheless.
    """
    rows, columns = state.shape
    solid = roof.copy()
    for r in range(1, rows - 1):
        for c in range(1, columns - 1):
            if roof[r, c] or state[r, c] != HIGH:
                continue
            level = 0
            for i in range(r - 1, r + 2):
                for j in range(c - 1, c + 2):
                    if state[i, j] == HIGH and abs(height[i, j] - height[r, c]) <= _LEDGE:
                        level += 1
            solid[r, c] = level > 4
    return solid


@njit(cache=True, nogil=True)
def _smooth_walls(height, state, labels, rounds):  # type: ignore[no-untyped-def]
    """Give rough high cells between labelled ones the label and height of the neighbour nearest in height, in place.

    A cell is taken when five of its eight neighbours are labelled, so that walls and furniture are eaten up from their
    corners while the straight edge of a roof beside a crown stays. Each round goes by what the one before left.
    """
    rows, columns = state.shape
    free = 0
    for r in range(1, rows - 1):
        for c in range(1, columns - 1):
            free += labels[r, c] == 0 and state[r, c] == HIGH
    rough, taken = np.empty((free, 2), dtype=np.int32), np.empty((free, 4), dtype=np.int32)
    free = 0
    for r in range(1, rows - 1):
        for c in range(1, columns - 1):
            if labels[r, c] == 0 and state[r, c] == HIGH:
                rough[free, 0], rough[free, 1] = r, c
                free += 1
    for _ in range(rounds):
        left, found = 0, 0
        for k in range(free):
            r, c = rough[k, 0], rough[k, 1]
            known, nearest, label, carrier = 0, np.int64(1) << 40, 0, 0
            for i in range(r - 1, r + 2):
                for j in range(c - 1, c + 2):
                    if labels[i, j] > 0:
                        known += 1
                        gap = abs(np.int64(height[i, j]) - height[r, c])
                        if gap < nearest:
                            nearest, label, carrier = gap, labels[i, j], height[i, j]
            if known >= 5:
                taken[found, 0], taken[found, 1], taken[found, 2], taken[found, 3] = r, c, label, carrier
                found += 1
            else:
                rough[left] = rough[k]
                left += 1
        for k in range(found):
            r, c = taken[k, 0], taken[k, 1]
            labels[r, c], height[r, c] = taken[k, 2], taken[k, 3]
        free = left
        if found == 0:
            break


@njit(cache=True, nogil=True)
def _fill_rough(height, state, labels, share, most):  # type: ignore[no-untyped-def]
    """Level rough places that roof surrounds, in place; return whether there was any."""
    rows, columns = state.shape
    rough, count = label_patches(height, (state == HIGH) & (labels == 0), 1 << 30)
    size = np.zeros(count + 1, dtype=np.int64)
    rim = np.zeros(count + 1, dtype=np.int64)
    roof = np.zeros(count + 1, dtype=np.int64)
    for r in range(rows):
        for c in range(columns):
            place = rough[r, c]
            if place == 0:
                continue
            size[place] += 1
            for side in range(4):
                i = r + (1 if side == 0 else (-1 if side == 1 else 0))
                j = c + (1 if side == 2 else (-1 if side == 3 else 0))
                if i < 0 or j < 0 or i >= rows or j >= columns:
                    rim[place] += 1
                elif rough[i, j] == 0 and state[i, j] != VOID:
                    rim[place] += 1
                    roof[place] += labels[i, j] > 0
    chosen = np.zeros((rows, columns), dtype=np.bool_)
    found = False
    for r in range(rows):
        for c in range(columns):
            place = rough[r, c]
            if place > 0 and roof[place] > 0 and size[place] <= most and roof[place] >= share * rim[place]:
                chosen[r, c] = True
                found = True
    if found:
        _sink(height, labels, chosen, 1 << 20)
    return found


@njit(cache=True, nogil=True)
def _lower(height, state, labels, count, share, step):  # type: ignore[no-untyped-def]
    """Lower the superstructures in place; return whether there was any."""
    rows, columns = state.shape
    rim = np.zeros(count + 1, dtype=np.int64)
    below = np.zeros(count + 1, dtype=np.int64)
    for r in range(rows):
        for c in range(columns):
            label = labels[r, c]
            if label == 0:
                continue
            for side in range(4):
                i = r + (1 if side == 0 else (-1 if side == 1 else 0))
                j = c + (1 if side == 2 else (-1 if side == 3 else 0))
                if i < 0 or j < 0 or i >= rows or j >= columns:
                    rim[label] += 1
                elif labels[i, j] != label and state[i, j] != VOID:
                    rim[label] += 1
                    below[label] += labels[i, j] > 0 and height[i, j] < height[r, c]
    chosen = np.zeros((rows, columns), dtype=np.bool_)
    found = False
    for r in range(rows):
        for c in range(columns):
            label = labels[r, c]
            if label > 0 and below[label] > 0 and below[label] >= share * rim[label]:
                chosen[r, c] = True
                found = True
    if found:
        _sink(height, labels, chosen, -step // 2)
    return found


@njit(cache=True, nogil=True)
def _sink(height, labels, chosen, above):  # type: ignore[no-untyped-def]
    """Give chosen cells the height of the roof beside them, in place, from the rim inwards.

    Roof counts that is at most `above` centimetres higher than the cell; a step of the roof below goes on under what
    stands on it.
    """
    rows, columns = height.shape
    queue = np.empty((np.count_nonzero(chosen), 2), dtype=np.int32)
    waiting = chosen.copy()
    size, done, end = 0, 0, 0
    for r in range(rows):
        for c in range(columns):
            if chosen[r, c] and _beside(height, labels, chosen, waiting, r, c, above) >= 0:
                queue[size, 0], queue[size, 1] = r, c
                size += 1
    for k in range(size):
        chosen[queue[k, 0], queue[k, 1]] = False
    while done < size:
        # One ring at a time, so that no direction is favoured.
        end = size
        for k in range(done, end):
            r, c = queue[k, 0], queue[k, 1]
            beside = _beside(height, labels, chosen, waiting, r, c, above)
            height[r, c] = -1 - (beside if beside >= 0 else height[r, c])
        for k in range(done, end):
            r, c = queue[k, 0], queue[k, 1]
            height[r, c] = -1 - height[r, c]
            waiting[r, c] = False
            labels[r, c] = max(labels[r, c], 1)
        for k in range(done, end):
            r, c = queue[k, 0], queue[k, 1]
            for i in range(max(r - 1, 0), min(r + 2, rows)):
                for j in range(max(c - 1, 0), min(c + 2, columns)):
                    if chosen[i, j]:
                        chosen[i, j] = False
                        queue[size, 0], queue[size, 1] = i, j
                        size += 1
        done = end


@njit(cache=True, nogil=True)
def _beside(height, labels, chosen, waiting, r, c, above):  # type: ignore[no-untyped-def]
    """Mean height of the roof among a cell's eight neighbours, of the level that most of them share; -1 without one."""
    rows, columns = height.shape
    levels = np.empty(8, dtype=np.int64)
    n = 0
    for i in range(max(r - 1, 0), min(r + 2, rows)):
        for j in range(max(c - 1, 0), min(c + 2, columns)):
            roof = labels[i, j] > 0 and not waiting[i, j] and not chosen[i, j]
            if roof and 0 <= height[i, j] <= height[r, c] + above:
                levels[n] = height[i, j]
                n += 1
    best, most = -1, 0
    for k in range(n):
        total, many = 0, 0
        for other in range(n):
            if abs(levels[other] - levels[k]) <= _LEDGE:
                total += levels[other]
                many += 1
        if many > most or (many == most and total < best * many):
            best, most = total // many, many
    return best
