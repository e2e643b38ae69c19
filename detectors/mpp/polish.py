"""Zero temperature: only what lowers the energy is done, until nothing does.

Per building, in order: edges in and out, whole shifts and turns with halving steps, removal, the best split over a
lattice of wall positions along both axes, the best merge with a neighbour, moving the wall between two neighbours;
then the births of boxes that the data suggest. The energy never rises, so the polished state is never worse.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.kernels import kernel
from .energy import energy_below, least_energy, overlaps, own_energy

__all__ = ["hull", "polish"]

#: Least gain of energy that counts, so that rounding cannot make the search run in circles.
_GAIN = 1e-6
#: Share of a joined rectangle that its two parts fill, share of their energy that it has by itself before it descends,
#: and share of a third building that lies in it and goes with them.
_FILLED, _HOPEFUL, _INSIDE = 0.7, 0.8, 0.7
#: Square metres: a house in a row is not larger than the first, and does not stand against one larger than the second.
_HOUSE, _HALL = 200.0, 500.0
#: Positions of a wall that a split tries along one axis, at most.
_WALLS = 32


@kernel
def _shared(rectangles, count, fixed, rectangle, skip, other):  # type: ignore[no-untyped-def]
    return overlaps(rectangles, count, rectangle, skip, other) + overlaps(fixed, len(fixed), rectangle, -1, -1)


@kernel
def _allowed(rectangle, window, model):  # type: ignore[no-untyped-def]
    return (
        window[0] <= rectangle[0] < window[2]
        and window[1] <= rectangle[1] < window[3]
        and model.least_side <= rectangle[2] <= model.largest_side
        and model.least_side <= rectangle[3] <= model.largest_side
    )


@kernel
def _change(rectangle, kind, step, new):  # type: ignore[no-untyped-def]
    """Fill one of 14 small changes: 0..7 an edge out or in, 8..11 a shift along u or v, 12, 13 a turn."""
    new[:] = rectangle
    cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
    if kind < 8:
        axis, sign = kind // 4, 1.0 if kind % 2 == 0 else -1.0
        end = 1.0 if kind % 4 < 2 else -1.0
        new[2 + axis] += sign * step
        shift = 0.5 * sign * end * step
        du, dv = (shift, 0.0) if axis == 0 else (0.0, shift)
    elif kind < 12:
        shift = step if kind % 2 == 0 else -step
        du, dv = (shift, 0.0) if kind < 10 else (0.0, shift)
    else:
        reach = 0.5 * math.hypot(rectangle[2], rectangle[3])
        turn = step / reach
        new[4] = (new[4] + (turn if kind == 12 else -turn)) % math.pi
        du, dv = 0.0, 0.0
    new[0] += du * cos - dv * sin
    new[1] += du * sin + dv * cos


@kernel
def _descend(small, large, model, window, rectangles, own, count, fixed, i):  # type: ignore[no-untyped-def]
    """Change building i as long as it helps, with steps of 4 cells down to a quarter; return the gain."""
    gained, step = 0.0, 4.0
    new = np.empty(5)
    shared = _shared(rectangles, count, fixed, rectangles[i], i, -1)
    while step >= 0.25:
        moved = False
        for kind in range(14):
            _change(rectangles[i], kind, step, new)
            if not _allowed(new, window, model):
                continue
            # Overlap is never negative, so what the data refuse need not be compared with the neighbours.
            limit = own[i] + model.overlap * shared - _GAIN
            alone = energy_below(small, large, new, model, limit)
            if alone >= limit:
                continue
            common = _shared(rectangles, count, fixed, new, i, -1)
            delta = alone - own[i] + model.overlap * (common - shared)
            if delta < -_GAIN:
                rectangles[i], own[i], shared = new, alone, common
                gained -= delta
                moved = True
        if not moved:
            step *= 0.5
    return gained


@kernel
def _part(parent, axis, low, high, child):  # type: ignore[no-untyped-def]
    """Fill the part of a rectangle between two positions along an axis, measured from its centre."""
    child[:] = parent
    cos, sin = math.cos(parent[4]), math.sin(parent[4])
    middle = 0.5 * (low + high)
    child[0] += middle * (cos if axis == 0 else -sin)
    child[1] += middle * (sin if axis == 0 else cos)
    child[2 + axis] = high - low


@kernel
def _split(small, large, model, window, rectangles, own, count, fixed, i):  # type: ignore[no-untyped-def]
    """Put the best wall into building i where it lowers the energy; return the gain."""
    parent = rectangles[i].copy()
    best, best_axis, best_at = own[i] - _GAIN, -1, 0.0
    # Two parts hold the cells of the whole, so no wall gains more than this.
    if least_energy(small, large, parent, model) + model.price >= best:
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
            _part(parent, axis, -0.5 * side, at, first)
            _part(parent, axis, at, 0.5 * side, second)
            if not (_allowed(first, window, model) and _allowed(second, window, model)):
                continue
            energy = energy_below(small, large, first, model, best - least_energy(small, large, second, model))
            if energy < np.inf:
                energy += energy_below(small, large, second, model, best - energy)
            if energy < best:
                best, best_axis, best_at = energy, axis, at
    if best_axis < 0:
        return 0.0
    side = parent[2 + best_axis]
    _part(parent, best_axis, -0.5 * side, best_at, first)
    _part(parent, best_axis, best_at, 0.5 * side, second)
    before = own[i] + model.overlap * _shared(rectangles, count, fixed, parent, i, -1)
    one, two = own_energy(small, large, first, model), own_energy(small, large, second, model)
    after = (
        one
        + two
        + model.overlap
        * (_shared(rectangles, count, fixed, first, i, -1) + _shared(rectangles, count, fixed, second, i, -1))
    )
    pair = np.empty((1, 5))
    pair[0] = first
    after += model.overlap * overlaps(pair, 1, second, -1, -1)
    if after >= before - _GAIN:
        return 0.0
    rectangles[i], own[i] = first, one
    rectangles[count], own[count] = second, two
    return before - after


@kernel
def hull(first, second, merged):  # type: ignore[no-untyped-def]
    """Fill the rectangle at the angle of the first that holds both."""
    cos, sin = math.cos(first[4]), math.sin(first[4])
    dx, dy = second[0] - first[0], second[1] - first[1]
    u, v = dx * cos + dy * sin, dy * cos - dx * sin
    turn = second[4] - first[4]
    cos_t, sin_t = abs(math.cos(turn)), abs(math.sin(turn))
    half_u = 0.5 * (second[2] * cos_t + second[3] * sin_t)
    half_v = 0.5 * (second[2] * sin_t + second[3] * cos_t)
    low_u, high_u = min(-0.5 * first[2], u - half_u), max(0.5 * first[2], u + half_u)
    low_v, high_v = min(-0.5 * first[3], v - half_v), max(0.5 * first[3], v + half_v)
    middle_u, middle_v = 0.5 * (low_u + high_u), 0.5 * (low_v + high_v)
    merged[0] = first[0] + middle_u * cos - middle_v * sin
    merged[1] = first[1] + middle_u * sin + middle_v * cos
    merged[2], merged[3], merged[4] = high_u - low_u, high_v - low_v, first[4]


@kernel
def _merge(small, large, model, window, rectangles, own, count, fixed, i):  # type: ignore[no-untyped-def]
    """Merge building i with the neighbour with which that gains most; return the gain and the neighbour or -1."""
    best_gain, best_j = _GAIN, -1
    merged, best_merged, best_own = np.empty(5), np.empty(5), 0.0
    for j in range(count):
        if j == i:
            continue
        dx, dy = rectangles[j, 0] - rectangles[i, 0], rectangles[j, 1] - rectangles[i, 1]
        touch = 0.5 * (math.hypot(rectangles[i, 2], rectangles[i, 3]) + math.hypot(rectangles[j, 2], rectangles[j, 3]))
        if dx * dx + dy * dy > (touch + 2.0) ** 2:
            continue
        hull(rectangles[i], rectangles[j], merged)
        filled = rectangles[i, 2] * rectangles[i, 3] + rectangles[j, 2] * rectangles[j, 3]
        # A hull much larger than its parts covers what neither wanted.
        if merged[2] * merged[3] > 1.6 * filled or not _allowed(merged, window, model):
            continue
        limit = own[i] + own[j] + model.overlap * filled - _GAIN
        alone = energy_below(small, large, merged, model, limit)
        if alone >= limit:
            continue
        before = (
            own[i]
            + own[j]
            + model.overlap
            * (
                _shared(rectangles, count, fixed, rectangles[i], i, -1)
                + _shared(rectangles, count, fixed, rectangles[j], i, j)
            )
        )
        gain = before - alone - model.overlap * _shared(rectangles, count, fixed, merged, i, j)
        if gain > best_gain:
            best_gain, best_j, best_own = gain, j, alone
            best_merged[:] = merged
    if best_j < 0:
        return 0.0, -1
    rectangles[i], own[i] = best_merged, best_own
    return best_gain, best_j


@kernel
def _replace(model, rectangles, own, fresh, count, fixed, boxes, alones):  # type: ignore[no-untyped-def]
    """Put boxes in the place of the buildings that they overlap where that lowers the energy; return gain and count."""
    gained = 0.0
    victims = np.empty(len(rectangles), dtype=np.int64)
    for k in range(len(boxes)):
        box, alone = boxes[k], alones[k]
        if alone >= -_GAIN:
            continue
        many = 0
        delta = alone + model.overlap * overlaps(fixed, len(fixed), box, -1, -1)
        for i in range(count):
            shared = overlaps(rectangles[i : i + 1], 1, box, -1, -1)
            if shared <= 0.0:
                continue
            if shared * 4.0 < min(rectangles[i, 2] * rectangles[i, 3], box[2] * box[3]):
                delta += model.overlap * shared
                continue
            victims[many] = i
            many += 1
        if many == 0:
            continue
        for v in range(many):
            i = victims[v]
            delta -= own[i] + model.overlap * _shared(rectangles, count, fixed, rectangles[i], i, -1)
            # Overlap between two that go is counted with each: give one half back.
            for w in range(many):
                if w != v:
                    j = victims[w]
                    delta += 0.5 * model.overlap * overlaps(rectangles[j : j + 1], 1, rectangles[i], -1, -1)
        if delta < -_GAIN:
            gained -= delta
            rectangles[victims[0]], own[victims[0]], fresh[victims[0]] = box, alone, True
            for v in range(many - 1, 0, -1):
                i = victims[v]
                _remove(rectangles, own, count, i)
                fresh[i] = fresh[count - 1]
                count -= 1
    return gained, count


@kernel
def _remove(rectangles, own, count, j):  # type: ignore[no-untyped-def]
    rectangles[j], own[j] = rectangles[count - 1], own[count - 1]


@kernel
def _joined(first, second, axis, joined):  # type: ignore[no-untyped-def]
    """Fill the rectangle at the angle of the first that reaches over both along an axis, and is as wide as both are.

    The edges across the axis are means of those of the two, weighted with their lengths: where parts of one roof are a
    cell out of line, their hull would take in a row of cells that neither wanted.
    """
    hull(first, second, joined)
    cos, sin = math.cos(first[4]), math.sin(first[4])
    dx, dy = second[0] - first[0], second[1] - first[1]
    across = dx * cos + dy * sin if axis == 1 else dy * cos - dx * sin
    turn = second[4] - first[4]
    cos_t, sin_t = abs(math.cos(turn)), abs(math.sin(turn))
    along_u, along_v = second[2] * cos_t + second[3] * sin_t, second[2] * sin_t + second[3] * cos_t
    length, width = (along_u, along_v) if axis == 0 else (along_v, along_u)
    share = length / (length + first[2 + axis])
    low = (1.0 - share) * -0.5 * first[3 - axis] + share * (across - 0.5 * width)
    high = (1.0 - share) * 0.5 * first[3 - axis] + share * (across + 0.5 * width)
    dx, dy = joined[0] - first[0], joined[1] - first[1]
    u, v = dx * cos + dy * sin, dy * cos - dx * sin
    middle = 0.5 * (low + high)
    u, v = (u, middle) if axis == 0 else (middle, v)
    joined[0], joined[1] = first[0] + u * cos - v * sin, first[1] + u * sin + v * cos
    joined[3 - axis] = high - low


@kernel
def _absorb(small, large, model, window, rectangles, own, fresh, count, fixed, i, spare):  # type: ignore[no-untyped-def]
    """Let building i take in a smaller neighbour, and all that lies mostly in both, where that lowers the energy.

    What is taken in is removed, the new rectangle and those around it descend, and the result is kept if it is better
    than the state before. Returns the gain and the number of buildings.
    """
    trial, trial_own, trial_fresh = spare
    joined = np.empty(5)
    size = rectangles[i, 2] * rectangles[i, 3]
    for j in range(count):
        other = rectangles[j, 2] * rectangles[j, 3]
        if j == i or other > size or not (other * model.cell**2 > _HOUSE or size * model.cell**2 > _HALL):
            continue
        dx, dy = rectangles[j, 0] - rectangles[i, 0], rectangles[j, 1] - rectangles[i, 1]
        far = 0.5 * (math.hypot(rectangles[i, 2], rectangles[i, 3]) + math.hypot(rectangles[j, 2], rectangles[j, 3]))
        if dx * dx + dy * dy > (far + 2.0) ** 2:
            continue
        for axis in range(2):
            _joined(rectangles[i], rectangles[j], axis, joined)
            if size + other < _FILLED * joined[2] * joined[3] or not _allowed(joined, window, model):
                continue
            alone = own_energy(small, large, joined, model)
            if alone > _HOPEFUL * (own[i] + own[j]):
                continue
            trial[:count], trial_own[:count], trial_fresh[:count] = rectangles[:count], own[:count], fresh[:count]
            many, gain = count, 0.0
            # From the last to the first, so that numbers still to come stay what they are.
            for k in range(count - 1, -1, -1):
                inside = k in (i, j)
                if not inside:
                    shared = overlaps(rectangles[k : k + 1], 1, joined, -1, -1)
                    inside = shared > _INSIDE * rectangles[k, 2] * rectangles[k, 3]
                if inside:
                    gain += trial_own[k] + model.overlap * _shared(trial, many, fixed, trial[k], k, -1)
                    many -= 1
                    trial[k], trial_own[k], trial_fresh[k] = trial[many], trial_own[many], trial_fresh[many]
            gain -= alone + model.overlap * _shared(trial, many, fixed, joined, -1, -1)
            trial[many], trial_own[many], trial_fresh[many] = joined, alone, True
            many += 1
            gain += _descend(small, large, model, window, trial, trial_own, many, fixed, many - 1)
            for k in range(many - 1):
                if overlaps(trial[k : k + 1], 1, trial[many - 1], -1, -1) > 0.0:
                    gain += _descend(small, large, model, window, trial, trial_own, many, fixed, k)
                    trial_fresh[k] = True
            if gain > _GAIN:
                rectangles[:many], own[:many], fresh[:many] = trial[:many], trial_own[:many], trial_fresh[:many]
                return gain, many
    return 0.0, count


@kernel
def polish(small, large, model, window, start, fixed, boxes, energies, capacity, sweeps):  # type: ignore[no-untyped-def]
    """Lower the energy of a state until a sweep changes nothing or `sweeps` are done.

    Parameters
    ----------
    small, large : tables
    model : Model
    window : ndarray, shape (4,)
        Where centres may lie, cells.
    start, fixed : ndarray, shape (n, 5), (m, 5)
    boxes : ndarray, shape (l, 5)
        Births to try.
    energies : ndarray, shape (l,)
        Of the boxes by themselves.
    capacity, sweeps : int

    Returns
    -------
    rectangles : ndarray, shape (k, 5)
    gained : float
        By how much the energy fell.
    """
    rectangles, own = np.empty((capacity + 1, 5)), np.empty(capacity + 1)
    fresh = np.ones(capacity + 1, dtype=np.bool_)
    count = min(len(start), capacity)
    for i in range(count):
        rectangles[i], own[i] = start[i], own_energy(small, large, start[i], model)
    alones = np.full(len(boxes), np.inf)
    for j in range(len(boxes)):
        if _allowed(boxes[j], window, model):
            alones[j] = energies[j]
    spare = np.empty_like(rectangles), np.empty_like(own), np.empty_like(fresh)
    gained = 0.0
    for sweep in range(sweeps):
        before = gained
        for j in range(len(boxes)):
            alone = alones[j]
            if count >= capacity or alone >= -_GAIN:
                continue
            delta = alone + model.overlap * _shared(rectangles, count, fixed, boxes[j], -1, -1)
            if delta < -_GAIN:
                rectangles[count], own[count] = boxes[j], alone
                fresh[count] = True
                count += 1
                gained -= delta
        more, count = _replace(model, rectangles, own, fresh, count, fixed, boxes, alones)
        gained += more
        i = 0
        while i < count:
            if fresh[i]:
                fresh[i] = False
                gain = _descend(small, large, model, window, rectangles, own, count, fixed, i)
                shared = _shared(rectangles, count, fixed, rectangles[i], i, -1)
                if own[i] + model.overlap * shared > _GAIN:
                    gained += gain + own[i] + model.overlap * shared
                    _remove(rectangles, own, count, i)
                    fresh[i] = fresh[count - 1]
                    count -= 1
                    continue
                if count < capacity:
                    more = _split(small, large, model, window, rectangles, own, count, fixed, i)
                    if more > 0.0:
                        fresh[i], fresh[count] = True, True
                        count += 1
                        gain += more
                more, j = _merge(small, large, model, window, rectangles, own, count, fixed, i)
                if j >= 0:
                    gain += more
                    fresh[i] = True
                    _remove(rectangles, own, count, j)
                    fresh[j] = fresh[count - 1]
                    count -= 1
                    if i == count:
                        i = j
                gained += gain
                if gain > 0.0:
                    # Who stands near may now want to move too.
                    for j in range(count):
                        dx, dy = rectangles[j, 0] - rectangles[i, 0], rectangles[j, 1] - rectangles[i, 1]
                        far = rectangles[j, 2] + rectangles[j, 3] + rectangles[i, 2] + rectangles[i, 3]
                        if abs(dx) + abs(dy) < 0.5 * far:
                            fresh[j] = fresh[j] or sweep > 0
            i += 1
        if gained - before <= _GAIN and not fresh[:count].any():
            i = 0
            while i < count:
                more, left = _absorb(small, large, model, window, rectangles, own, fresh, count, fixed, i, spare)
                gained += more
                i += left == count and more == 0.0
                count = left
            if not fresh[:count].any():
                break
    return rectangles[:count].copy(), gained
