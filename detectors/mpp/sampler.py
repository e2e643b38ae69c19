"""The reversible jump Markov chain over the buildings of one window, with annealing.

Nouns
-----
window
    Rectangle of the grid in which centres may lie; buildings centred outside are *fixed*: they are seen, not changed.
temperature
    Falls geometrically from the first to the last proposal; at temperature 1 with a constant schedule the chain samples
    exp(-U) relative to the Poisson process, which is what the tests hold it to.
trace
    One row per stride of proposals: proposals made, temperature, energy, number of buildings, then per move how often
    it was tried and accepted.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.kernels import kernel
from .births import birth_density, propose_birth
from .energy import configuration_energy, energy_below, least_energy, overlaps, own_energy
from .moves import (
    GAP,
    OFFSET,
    SKEW,
    birth_log_ratio,
    merge_rectangles,
    propose_change,
    split_log_ratio,
    split_rectangle,
)
from .random_stream import integer, uniform

__all__ = ["TRACE_COLUMNS", "run_chain"]

#: Columns of a trace: 4 numbers, then tried and accepted of 8 moves.
TRACE_COLUMNS = 20

_BIRTH, _DEATH, _SHIFT, _EDGE, _SIDE, _TURN, _SPLIT, _MERGE = 0, 1, 2, 3, 4, 5, 6, 7


@kernel
def _inside(rectangle, births):  # type: ignore[no-untyped-def]
    """Whether the target is positive: centre in the window, sides in their range."""
    w, s = births.window, births.sides
    return (
        w[0] <= rectangle[0] < w[2]
        and w[1] <= rectangle[1] < w[3]
        and s[0] <= rectangle[2] <= s[1]
        and s[0] <= rectangle[3] <= s[1]
    )


@kernel
def _neighbours(rectangles, count, i, reach):  # type: ignore[no-untyped-def]
    """How many others lie with their centre within reach of building i."""
    near = 0
    for j in range(count):
        dx, dy = rectangles[j, 0] - rectangles[i, 0], rectangles[j, 1] - rectangles[i, 1]
        if j != i and dx * dx + dy * dy < reach * reach:
            near += 1
    return near


@kernel
def _pick_neighbour(rectangles, count, i, reach, number):  # type: ignore[no-untyped-def]
    """Index of the neighbour of building i with this number, in order of index."""
    for j in range(count):
        dx, dy = rectangles[j, 0] - rectangles[i, 0], rectangles[j, 1] - rectangles[i, 1]
        if j != i and dx * dx + dy * dy < reach * reach:
            if number == 0:
                return j
            number -= 1
    return -1


@kernel
def _common(rectangles, count, fixed, rectangle, skip, other):  # type: ignore[no-untyped-def]
    return overlaps(rectangles, count, rectangle, skip, other) + overlaps(fixed, len(fixed), rectangle, -1, -1)


@kernel
def run_chain(  # type: ignore[no-untyped-def]
    small,
    large,
    model,
    births,
    start,
    fixed,
    state,
    proposals,
    hot,
    cold,
    intensity,
    jump_share,
    split_share,
    reach,
    capacity,
    stride,
):
    """Run the chain and return the best state, the last state, the trace and the best energy.

    Parameters
    ----------
    small, large : tables
    model : Model
    births : Births
    start : ndarray, shape (n, 5)
        First state; its centres lie in the window.
    fixed : ndarray, shape (m, 5)
    state : ndarray of uint64, shape (4,)
        Random stream; advanced.
    proposals : int
    hot, cold : float
        First and last temperature.
    intensity : float
        Expected number of buildings per square cell under the prior.
    jump_share, split_share : float
        Share of births and deaths, and of splits and merges, each in equal parts, among the moves.
    reach : float
        Distance of centres, cells, within which two buildings may merge.
    capacity : int
        More buildings than this are not held; births beyond it are refused.
    stride : int
        Proposals per row of the trace.
    """
    span = births.sides[1] - births.sides[0]
    density = intensity / (span * span * math.pi)
    rectangles = np.empty((capacity, 5))
    own = np.empty(capacity)
    count = min(len(start), capacity)
    for i in range(count):
        rectangles[i] = start[i]
        own[i] = own_energy(small, large, start[i], model)
    energy = configuration_energy(small, large, rectangles, count, fixed, model)
    best, best_energy = rectangles[:count].copy(), energy
    rows = (proposals + stride - 1) // stride
    trace = np.zeros((rows, TRACE_COLUMNS))
    new, other, parent, auxiliary, pair = np.empty(5), np.empty(5), np.empty(5), np.empty(5), np.empty((1, 5))
    log_jump = math.log(0.5 * jump_share) if jump_share > 0.0 else 0.0
    cooling = math.log(cold / hot) / max(proposals - 1, 1)
    for t in range(proposals):
        temperature = hot * math.exp(cooling * t)
        row = t // stride
        draw = uniform(state)
        # A move is accepted when its log ratio C - delta / T exceeds the logarithm of a uniform number, that is, when
        # delta < limit + T C. The number is drawn first, so that energies above it need not be known.
        limit = -temperature * math.log(1.0 - uniform(state))
        accepted = False
        if draw < jump_share:
            if draw < 0.5 * jump_share:
                kind = _BIRTH
                propose_birth(births, state, new)
                if _inside(new, births) and count < capacity:
                    q = birth_density(births, new)
                    limit += temperature * birth_log_ratio(0.0, temperature, density, count, q, log_jump, log_jump)
                    shared = model.overlap * _common(rectangles, count, fixed, new, -1, -1)
                    alone = energy_below(small, large, new, model, limit - shared)
                    if alone + shared < limit:
                        rectangles[count] = new
                        own[count] = alone
                        count += 1
                        energy += alone + shared
                        accepted = True
            else:
                kind = _DEATH
                if count > 0:
                    i = integer(state, count)
                    q = birth_density(births, rectangles[i])
                    limit -= temperature * birth_log_ratio(0.0, temperature, density, count - 1, q, log_jump, log_jump)
                    delta = -own[i] - model.overlap * _common(rectangles, count, fixed, rectangles[i], i, -1)
                    if delta < limit:
                        count -= 1
                        rectangles[i] = rectangles[count]
                        own[i] = own[count]
                        energy += delta
                        accepted = True
        elif draw < jump_share + split_share:
            axis = integer(state, 2)
            if draw < jump_share + 0.5 * split_share:
                kind = _SPLIT
                if 0 < count < capacity:
                    i = integer(state, count)
                    side = rectangles[i, 2 + axis]
                    m = side * (uniform(state) - 0.5)
                    g, p = GAP * (2.0 * uniform(state) - 1.0), OFFSET * (2.0 * uniform(state) - 1.0)
                    q, phi = OFFSET * (2.0 * uniform(state) - 1.0), SKEW * (2.0 * uniform(state) - 1.0)
                    split_rectangle(rectangles[i], axis, m, g, p, q, phi, new, other)
                    apart = math.hypot(new[0] - other[0], new[1] - other[1])
                    if _inside(new, births) and _inside(other, births) and apart < reach:
                        parent[:] = rectangles[i]
                        rectangles[i], rectangles[count] = new, other
                        near_first = _neighbours(rectangles, count + 1, i, reach)
                        near_second = _neighbours(rectangles, count + 1, count, reach)
                        rectangles[i] = parent
                        ratio = split_log_ratio(0.0, temperature, density, count, side, near_first, near_second)
                        limit += temperature * ratio
                        pair[0] = new
                        shared = overlaps(pair, 1, other, -1, -1)
                        shared += _common(rectangles, count, fixed, new, i, -1)
                        shared += _common(rectangles, count, fixed, other, i, -1)
                        shared -= _common(rectangles, count, fixed, parent, i, -1)
                        rest = model.overlap * shared - own[i]
                        least = least_energy(small, large, other, model)
                        first = energy_below(small, large, new, model, limit - rest - least)
                        second = energy_below(small, large, other, model, limit - rest - first)
                        if first + second + rest < limit:
                            rectangles[i], own[i] = new, first
                            rectangles[count], own[count] = other, second
                            count += 1
                            energy += first + second + rest
                            accepted = True
            else:
                kind = _MERGE
                if count > 1:
                    i = integer(state, count)
                    near_first = _neighbours(rectangles, count, i, reach)
                    if near_first > 0:
                        j = _pick_neighbour(rectangles, count, i, reach, integer(state, near_first))
                        found = merge_rectangles(rectangles[i], rectangles[j], axis, new, auxiliary)
                        if found and _inside(new, births):
                            near_second = _neighbours(rectangles, count, j, reach)
                            side = new[2 + axis]
                            ratio = split_log_ratio(0.0, temperature, density, count - 1, side, near_first, near_second)
                            limit -= temperature * ratio
                            shared = _common(rectangles, count, fixed, new, i, j)
                            shared -= _common(rectangles, count, fixed, rectangles[i], i, -1)
                            shared -= _common(rectangles, count, fixed, rectangles[j], i, j)
                            rest = model.overlap * shared - own[i] - own[j]
                            alone = energy_below(small, large, new, model, limit - rest)
                            if alone + rest < limit:
                                rectangles[i], own[i] = new, alone
                                count -= 1
                                rectangles[j], own[j] = rectangles[count], own[count]
                                energy += alone + rest
                                accepted = True
        else:
            kind = _SHIFT
            draw = (draw - jump_share - split_share) / (1.0 - jump_share - split_share)
            if draw >= 0.25:
                kind = _EDGE
            if draw >= 0.70:
                kind = _SIDE
            if draw >= 0.80:
                kind = _TURN
            if count > 0:
                i = integer(state, count)
                propose_change(kind, rectangles[i], new, state)
                if _inside(new, births):
                    rest = -own[i] - model.overlap * _common(rectangles, count, fixed, rectangles[i], i, -1)
                    alone = energy_below(small, large, new, model, limit - rest)
                    # Overlap is never negative, so what the data refuse need not be compared with the neighbours.
                    if alone + rest < limit:
                        rest += model.overlap * _common(rectangles, count, fixed, new, i, -1)
                    if alone + rest < limit:
                        rectangles[i], own[i] = new, alone
                        energy += alone + rest
                        accepted = True
        trace[row, 4 + kind] += 1
        if accepted:
            trace[row, 12 + kind] += 1
            if energy < best_energy - 1e-9 and temperature < 2.0 * cold:
                best, best_energy = rectangles[:count].copy(), energy
        if t % stride == stride - 1 or t == proposals - 1:
            trace[row, 0], trace[row, 1], trace[row, 2], trace[row, 3] = t + 1, temperature, energy, count
            if energy < best_energy - 1e-9:
                best, best_energy = rectangles[:count].copy(), energy
    return best, rectangles[:count].copy(), trace, best_energy
