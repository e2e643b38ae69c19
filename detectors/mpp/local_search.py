"""Local search: greedy descent of the energy of a window; moves that lower it are made until none does.

Per building, in order: edges in and out, whole shifts and turns with halving steps, removal, the best split over a
lattice of wall positions along both axes, the best merge with a neighbour; then the births of boxes that the data
suggest, and large buildings that absorb their neighbours (`absorption`). The energy never rises, so the result is never
worse than the start.
"""

from __future__ import annotations

import numpy as np

from ...core.kernels import kernel
from .absorption import absorb
from .arrays import Floats, Rectangles
from .candidates import Boxes
from .energy import rectangle_energy
from .search_moves import LEAST_GAIN, Buildings, descend, merge_best, remove, replace_by_boxes, split_best
from .windows import Window, allowed, shared_area

__all__ = ["local_search", "room_of", "search"]

#: Buildings that a window may hold besides its boxes and its present buildings.
_ROOM = 64
#: Boxes for which there is room, at most.
_MOST_BOXES = 4000


def room_of(boxes: Boxes, own: Rectangles) -> int:
    """Return how many buildings a window may hold."""
    return _ROOM + 2 * len(own) + min(len(boxes), _MOST_BOXES)


def search(window: Window, start: Rectangles, boxes: Boxes, *, capacity: int, sweeps: int) -> Rectangles:
    """Return what a local search makes of a state."""
    best: Rectangles
    best, _ = local_search(window, start, boxes.rectangles, boxes.energies, capacity, sweeps)
    return best


@kernel
def local_search(
    window: Window, start: Rectangles, boxes: Rectangles, energies: Floats, capacity: int, sweeps: int
) -> tuple[Rectangles, float]:
    """Lower the energy of a state until a sweep changes nothing or `sweeps` are done.

    Parameters
    ----------
    window : Window
    start : ndarray, shape (n, 5)
    boxes : ndarray, shape (l, 5)
        Births to try.
    energies : ndarray, shape (l,)
        Of the boxes by themselves.
    capacity, sweeps : int
        No more buildings than the capacity are kept.

    Returns
    -------
    rectangles : ndarray, shape (k, 5)
    gained : float
        By how much the energy fell.
    """
    buildings = Buildings(np.empty((capacity + 1, 5)), np.empty(capacity + 1), np.ones(capacity + 1, dtype=np.bool_))
    trial = Buildings(np.empty((capacity + 1, 5)), np.empty(capacity + 1), np.empty(capacity + 1, dtype=np.bool_))
    count = min(len(start), capacity)
    for i in range(count):
        buildings.rectangles[i] = start[i]
        buildings.energies[i] = rectangle_energy(window.tables, start[i], window.model)
    alones = np.full(len(boxes), np.inf)
    for j in range(len(boxes)):
        if allowed(window, boxes[j]):
            alones[j] = energies[j]
    gained = 0.0
    for sweep in range(sweeps):
        before = gained
        gain, count = _add_boxes(window, buildings, count, boxes, alones)
        gained += gain
        gain, count = replace_by_boxes(window, buildings, count, boxes, alones)
        gained += gain
        i = 0
        while i < count:
            if buildings.fresh[i]:
                gain, count, i = _improve(window, buildings, count, i, sweep > 0)
                gained += gain
            else:
                i += 1
        if gained - before <= LEAST_GAIN and not buildings.fresh[:count].any():
            i = 0
            while i < count:
                gain, left = absorb(window, buildings, count, i, trial)
                gained += gain
                i += left == count and gain == 0.0
                count = left
            if not buildings.fresh[:count].any():
                break
    return buildings.rectangles[:count].copy(), gained


@kernel
def _add_boxes(
    window: Window, buildings: Buildings, count: int, boxes: Rectangles, alones: Floats
) -> tuple[float, int]:
    """Append the boxes that lower the energy; return the gain and the number of buildings."""
    gained = 0.0
    for j in range(len(boxes)):
        if count >= len(buildings.energies) - 1 or alones[j] >= -LEAST_GAIN:
            continue
        shared = shared_area(window, buildings.rectangles, count, boxes[j], -1, -1)
        delta = alones[j] + window.model.overlap * shared
        if delta < -LEAST_GAIN:
            buildings.rectangles[count], buildings.energies[count] = boxes[j], alones[j]
            buildings.fresh[count] = True
            count += 1
            gained -= delta
    return gained, count


@kernel
def _improve(window: Window, buildings: Buildings, count: int, i: int, wake: bool) -> tuple[float, int, int]:
    """Descend, remove, split and merge building i.

    Returns the gain, the number of buildings and the number of the building to examine next. With `wake` its
    neighbours count as fresh after a gain: they may now move, too.
    """
    rectangles, energies, fresh = buildings.rectangles, buildings.energies, buildings.fresh
    fresh[i] = False
    gain = descend(window, buildings, count, i)
    energy = energies[i] + window.model.overlap * shared_area(window, rectangles, count, rectangles[i], i, -1)
    if energy > LEAST_GAIN:
        remove(buildings, count, i)
        return gain + energy, count - 1, i
    if count < len(energies) - 1:
        more = split_best(window, buildings, count, i)
        if more > 0.0:
            fresh[i], fresh[count] = True, True
            count += 1
            gain += more
    more, j = merge_best(window, buildings, count, i)
    if j >= 0:
        gain += more
        fresh[i] = True
        remove(buildings, count, j)
        count -= 1
        if i == count:
            i = j
    if gain > 0.0 and wake:
        for j in range(count):
            dx, dy = rectangles[j, 0] - rectangles[i, 0], rectangles[j, 1] - rectangles[i, 1]
            reach = rectangles[j, 2] + rectangles[j, 3] + rectangles[i, 2] + rectangles[i, 3]
            if abs(dx) + abs(dy) < 0.5 * reach:
                fresh[j] = True
    return gain, count, i + 1
