"""Moves of the local search: each changes one building of a window, or a few, where that lowers the energy."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .arrays import Floats, Mask, Rectangles
from .energy import energy_below, least_energy, overlaps, rectangle_energy
from .reshaping import cut, hull, move_edge
from .windows import Window, allowed, shared_area

__all__ = ["LEAST_GAIN", "Buildings", "descend", "merge_best", "near", "remove", "replace_by_boxes", "split_best"]

#: Least gain of energy that counts, so that rounding cannot make the search run in circles.
LEAST_GAIN = 1e-6
#: Small changes of a building by number: below the first an edge is moved, below the second it is shifted, else turned.
_EDGES, _SHIFTS, _CHANGES = 8, 12, 14
#: Cells: first and last step of small changes.
_FIRST_STEP, _LAST_STEP = 4.0, 0.25
#: Positions of a wall that a split tries along one axis, at most.
_WALLS = 32
#: A merge is tried where the hull of two buildings is at most this many times as large as both, and where their
#: circumscribed circles come within so many cells.
_LOOSE, _NEAR = 1.6, 2.0
#: Share of the smaller one that a box and a building have in common where the box replaces the building.
_REPLACED = 0.25


class Buildings(NamedTuple):
    """The state of a search: arrays with room for more buildings than there are.

    Attributes
    ----------
    rectangles : ndarray, shape (capacity, 5)
    energies : ndarray, shape (capacity,)
        Of each rectangle by itself.
    fresh : ndarray of bool, shape (capacity,)
        Whether a building, or one near it, has changed since it was last looked at.
    """

    rectangles: Rectangles
    energies: Floats
    fresh: Mask


@kernel
def remove(buildings: Buildings, count: int, i: int) -> None:
    """Remove building i of the first `count`, in place: it is replaced by the last one."""
    last = count - 1
    buildings.rectangles[i], buildings.energies[i] = buildings.rectangles[last], buildings.energies[last]
    buildings.fresh[i] = buildings.fresh[last]


@kernel
def _shared(window: Window, buildings: Buildings, count: int, i: int) -> float:
    """Return the area that building i shares with all others."""
    return float(shared_area(window, buildings.rectangles, count, buildings.rectangles[i], i, -1))


@kernel
def _change(rectangle: Rectangles, kind: int, step: float, new: Rectangles) -> None:
    """Fill one of 14 small changes: 0 to 7 an edge out or in, 8 to 11 a shift along u or v, 12 and 13 a turn."""
    by = step if kind % 2 == 0 else -step
    if kind < _EDGES:
        move_edge(rectangle, 2 * (kind // 4) + (0 if kind % 4 < 2 else 1), by, new)
        return
    new[:] = rectangle
    if kind < _SHIFTS:
        cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
        du, dv = (by, 0.0) if kind < _SHIFTS - 2 else (0.0, by)
        new[0] += du * cos - dv * sin
        new[1] += du * sin + dv * cos
    else:
        turn = step / (0.5 * math.hypot(rectangle[2], rectangle[3]))
        new[4] = (new[4] + (turn if kind % 2 == 0 else -turn)) % math.pi


@kernel
def descend(window: Window, buildings: Buildings, count: int, i: int) -> float:
    """Change building i as long as that lowers the energy, with halving steps; return the gain."""
    model, rectangles, energies = window.model, buildings.rectangles, buildings.energies
    gained, step = 0.0, _FIRST_STEP
    new = np.empty(5)
    shared = _shared(window, buildings, count, i)
    while step >= _LAST_STEP:
        moved = False
        for kind in range(_CHANGES):
            _change(rectangles[i], kind, step, new)
            if not allowed(window, new):
                continue
            # Overlap is never negative: a change that the data refuse needs no comparison with the neighbours.
            limit = energies[i] + model.overlap * shared - LEAST_GAIN
            alone = energy_below(window.tables, new, model, limit)
            if alone >= limit:
                continue
            common = shared_area(window, rectangles, count, new, i, -1)
            delta = alone - energies[i] + model.overlap * (common - shared)
            if delta < -LEAST_GAIN:
                rectangles[i], energies[i], shared = new, alone, common
                gained -= delta
                moved = True
        if not moved:
            step *= 0.5
    return gained


@kernel
def split_best(window: Window, buildings: Buildings, count: int, i: int) -> float:
    """Put the best wall into building i where it lowers the energy; return the gain.

    The second part becomes building `count`.
    """
    tables, model, rectangles, energies = window.tables, window.model, buildings.rectangles, buildings.energies
    parent = rectangles[i].copy()
    best, best_axis, best_at = energies[i] - LEAST_GAIN, -1, 0.0
    # Two parts hold the cells of the whole, so no wall gains more than this.
    if least_energy(tables, parent, model) + model.price >= best:
        return 0.0
    first, second = np.empty(5), np.empty(5)
    for axis in range(2):
        side = parent[2 + axis]
        room = side - 2.0 * model.least_side
        if room < 0.0:
            continue
        walls = min(int(room) + 1, _WALLS)
        for k in range(walls):
            at = -0.5 * side + model.least_side + room * (k + 0.5) / walls
            cut(parent, axis, -0.5 * side, at, first)
            cut(parent, axis, at, 0.5 * side, second)
            if not (allowed(window, first) and allowed(window, second)):
                continue
            energy = energy_below(tables, first, model, best - least_energy(tables, second, model))
            if energy < np.inf:
                energy += energy_below(tables, second, model, best - energy)
            if energy < best:
                best, best_axis, best_at = energy, axis, at
    if best_axis < 0:
        return 0.0
    side = parent[2 + best_axis]
    cut(parent, best_axis, -0.5 * side, best_at, first)
    cut(parent, best_axis, best_at, 0.5 * side, second)
    before = energies[i] + model.overlap * _shared(window, buildings, count, i)
    one, two = rectangle_energy(tables, first, model), rectangle_energy(tables, second, model)
    shared = shared_area(window, rectangles, count, first, i, -1)
    shared += shared_area(window, rectangles, count, second, i, -1)
    after = one + two + model.overlap * shared
    pair = np.empty((1, 5))
    pair[0] = first
    after += model.overlap * overlaps(pair, 1, second, -1, -1)
    if after >= before - LEAST_GAIN:
        return 0.0
    rectangles[i], energies[i] = first, one
    rectangles[count], energies[count] = second, two
    return float(before - after)


@kernel
def near(first: Rectangles, second: Rectangles) -> bool:
    """Return whether the circumscribed circles of two rectangles come near each other."""
    dx, dy = second[0] - first[0], second[1] - first[1]
    reach = 0.5 * (math.hypot(first[2], first[3]) + math.hypot(second[2], second[3]))
    return bool(dx * dx + dy * dy <= (reach + _NEAR) ** 2)


@kernel
def merge_best(window: Window, buildings: Buildings, count: int, i: int) -> tuple[float, int]:
    """Merge building i with the neighbour with which that gains most; return the gain and the neighbour or -1."""
    model, rectangles, energies = window.model, buildings.rectangles, buildings.energies
    best_gain, best_j = LEAST_GAIN, -1
    merged, best_merged, best_energy = np.empty(5), np.empty(5), 0.0
    for j in range(count):
        if j == i or not near(rectangles[i], rectangles[j]):
            continue
        hull(rectangles[i], rectangles[j], merged)
        filled = rectangles[i, 2] * rectangles[i, 3] + rectangles[j, 2] * rectangles[j, 3]
        # A hull much larger than its parts covers cells that belong to neither.
        if merged[2] * merged[3] > _LOOSE * filled or not allowed(window, merged):
            continue
        limit = energies[i] + energies[j] + model.overlap * filled - LEAST_GAIN
        alone = energy_below(window.tables, merged, model, limit)
        if alone >= limit:
            continue
        shared = _shared(window, buildings, count, i)
        shared += shared_area(window, rectangles, count, rectangles[j], i, j)
        before = energies[i] + energies[j] + model.overlap * shared
        gain = before - alone - model.overlap * shared_area(window, rectangles, count, merged, i, j)
        if gain > best_gain:
            best_gain, best_j, best_energy = gain, j, alone
            best_merged[:] = merged
    if best_j < 0:
        return 0.0, -1
    rectangles[i], energies[i] = best_merged, best_energy
    return best_gain, best_j


@kernel
def replace_by_boxes(
    window: Window, buildings: Buildings, count: int, boxes: Rectangles, alones: Floats
) -> tuple[float, int]:
    """Replace buildings, in place, by boxes that overlap them where that lowers the energy; return gain and count.

    `alones` holds the energy of each box by itself.
    """
    model, rectangles, energies = window.model, buildings.rectangles, buildings.energies
    gained = 0.0
    replaced: NDArray[np.int64] = np.empty(len(rectangles), dtype=np.int64)
    for k in range(len(boxes)):
        box, alone = boxes[k], alones[k]
        if alone >= -LEAST_GAIN:
            continue
        many = 0
        delta = alone + model.overlap * overlaps(window.fixed, len(window.fixed), box, -1, -1)
        for i in range(count):
            shared = overlaps(rectangles[i : i + 1], 1, box, -1, -1)
            if shared <= 0.0:
                continue
            if shared < _REPLACED * min(rectangles[i, 2] * rectangles[i, 3], box[2] * box[3]):
                delta += model.overlap * shared
                continue
            replaced[many] = i
            many += 1
        if many == 0:
            continue
        for v in range(many):
            i = replaced[v]
            delta -= energies[i] + model.overlap * _shared(window, buildings, count, i)
            # The overlap of two buildings that are both removed was subtracted with each: add it once.
            for w in range(many):
                if w != v:
                    j = replaced[w]
                    delta += 0.5 * model.overlap * overlaps(rectangles[j : j + 1], 1, rectangles[i], -1, -1)
        if delta < -LEAST_GAIN:
            gained -= delta
            rectangles[replaced[0]], energies[replaced[0]], buildings.fresh[replaced[0]] = box, alone, True
            for v in range(many - 1, 0, -1):
                remove(buildings, count, replaced[v])
                count -= 1
    return gained, count
