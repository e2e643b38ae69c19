"""The reversible jump Markov chain over the buildings of one window, with annealing.

Nouns
-----
temperature
    Falls geometrically from the first to the last proposal; at temperature 1 with a constant schedule the chain samples
    exp(-U) relative to the Poisson process, which is what the tests verify.
trace
    One row per stride of proposals; its columns are those of `Trace`.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from ...core.kernels import kernel
from .arrays import Floats, RandomState, Rectangles
from .births import Births, birth_density, propose_birth
from .energy import energy_below, rectangle_energy
from .moves import Move, birth_log_ratio, propose_change
from .random_stream import integer, uniform
from .windows import Window, allowed, shared_area, window_energy

__all__ = ["ChainSchedule", "Trace", "run_chain"]

#: Shares of shifts, edges, sides and turns among themselves, summed up; the rest are turns.
_SHIFTS, _EDGES, _SIDES = 0.25, 0.70, 0.80
#: The best state is kept as soon as the temperature is below this many times the last one.
_COLD_ENOUGH = 2.0
#: Gain of energy that makes a state a better one.
_BETTER = 1e-9


class Trace(IntEnum):
    """Columns of a trace; from `TRIED` and from `ACCEPTED` on one column for each `Move`."""

    PROPOSALS = 0
    TEMPERATURE = 1
    ENERGY = 2
    BUILDINGS = 3
    TRIED = 4
    ACCEPTED = 10
    COLUMNS = 16


class ChainSchedule(NamedTuple):
    """How a chain is run.

    Attributes
    ----------
    proposals : int
    hot, cold : float
        First and last temperature.
    intensity : float
        Expected number of buildings per square cell under the prior.
    jump_share : float
        Share of births and deaths, in equal parts, among the moves.
    stride : int
        Proposals per row of the trace.
    """

    proposals: int
    hot: float
    cold: float
    intensity: float
    jump_share: float
    stride: int


class _Chain(NamedTuple):
    """The state of a chain and its scratch space.

    Attributes
    ----------
    rectangles : ndarray, shape (capacity, 5)
    energies : ndarray, shape (capacity,)
        Of each rectangle by itself.
    new : ndarray, shape (5,)
        What is proposed.
    state : ndarray of uint64
        Random stream.
    """

    rectangles: Rectangles
    energies: Floats
    new: Rectangles
    state: RandomState


class _Odds(NamedTuple):
    """What a proposal is accepted by.

    Attributes
    ----------
    temperature : float
    density : float
        Of the prior, per unit of (x, y, a, b, angle).
    log_jump : float
        Logarithm of the probability of trying a birth, which is that of trying a death.
    limit : float
        The proposal is accepted when the energy rises by less, for a log acceptance ratio of -delta / temperature.
    """

    temperature: float
    density: float
    log_jump: float
    limit: float


@kernel
def _try_birth(window: Window, births: Births, chain: _Chain, count: int, odds: _Odds) -> tuple[int, float]:
    """Propose a birth, appended if accepted; return the number of buildings afterwards and the change of energy."""
    new = chain.new
    propose_birth(births, chain.state, new)
    if not allowed(window, new) or count >= len(chain.energies):
        return count, 0.0
    q = birth_density(births, new)
    ratio = birth_log_ratio(0.0, odds.temperature, odds.density, count, q, odds.log_jump, odds.log_jump)
    limit = odds.limit + odds.temperature * ratio
    shared = window.model.overlap * shared_area(window, chain.rectangles, count, new, -1, -1)
    alone = energy_below(window.tables, new, window.model, limit - shared)
    if alone + shared >= limit:
        return count, 0.0
    chain.rectangles[count] = new
    chain.energies[count] = alone
    return count + 1, alone + shared


@kernel
def _try_death(window: Window, births: Births, chain: _Chain, count: int, odds: _Odds) -> tuple[int, float]:
    """Propose a death; returns what `_try_birth` does."""
    if count == 0:
        return count, 0.0
    rectangles, energies = chain.rectangles, chain.energies
    i = integer(chain.state, count)
    q = birth_density(births, rectangles[i])
    ratio = birth_log_ratio(0.0, odds.temperature, odds.density, count - 1, q, odds.log_jump, odds.log_jump)
    limit = odds.limit - odds.temperature * ratio
    delta = -energies[i] - window.model.overlap * shared_area(window, rectangles, count, rectangles[i], i, -1)
    if delta >= limit:
        return count, 0.0
    rectangles[i] = rectangles[count - 1]
    energies[i] = energies[count - 1]
    return count - 1, delta


@kernel
def _try_change(window: Window, chain: _Chain, count: int, odds: _Odds, kind: int) -> tuple[bool, float]:
    """Propose a shift or a change of an edge, side or angle; return whether it was accepted and the energy's change."""
    if count == 0:
        return False, 0.0
    model, rectangles, energies, new = window.model, chain.rectangles, chain.energies, chain.new
    i = integer(chain.state, count)
    propose_change(kind, rectangles[i], new, chain.state)
    if not allowed(window, new):
        return False, 0.0
    rest = -energies[i] - model.overlap * shared_area(window, rectangles, count, rectangles[i], i, -1)
    alone = energy_below(window.tables, new, model, odds.limit - rest)
    # Overlap is never negative: a change that the data refuse needs no comparison with the neighbours.
    if alone + rest >= odds.limit:
        return False, 0.0
    rest += model.overlap * shared_area(window, rectangles, count, new, i, -1)
    if alone + rest >= odds.limit:
        return False, 0.0
    rectangles[i], energies[i] = new, alone
    return True, alone + rest


@kernel
def _drawn_move(draw: float, schedule: ChainSchedule) -> Move:
    """Return the move that a uniform number selects."""
    if draw < schedule.jump_share:
        return Move.BIRTH if draw < 0.5 * schedule.jump_share else Move.DEATH
    draw = (draw - schedule.jump_share) / (1.0 - schedule.jump_share)
    if draw < _SHIFTS:
        return Move.SHIFT
    if draw < _EDGES:
        return Move.EDGE
    return Move.SIDE if draw < _SIDES else Move.TURN


@kernel
def run_chain(
    window: Window, births: Births, start: Rectangles, schedule: ChainSchedule, capacity: int, state: RandomState
) -> tuple[Rectangles, Rectangles, Floats, float]:
    """Run the chain and return the best state, the last state, the trace and the best energy.

    Parameters
    ----------
    window : Window
    births : Births
    start : ndarray, shape (n, 5)
        First state; its centres lie in the window.
    schedule : ChainSchedule
    capacity : int
        No more buildings than this are kept; births beyond it are refused.
    state : ndarray of uint64, shape (4,)
        Random stream; advanced.
    """
    model = window.model
    span = model.largest_side - model.least_side
    density = schedule.intensity / (span * span * math.pi)
    chain = _Chain(np.empty((capacity, 5)), np.empty(capacity), np.empty(5), state)
    count = min(len(start), capacity)
    for i in range(count):
        chain.rectangles[i] = start[i]
        chain.energies[i] = rectangle_energy(window.tables, start[i], model)
    energy = window_energy(window, chain.rectangles[:count])
    best, best_energy = chain.rectangles[:count].copy(), energy
    rows = (schedule.proposals + schedule.stride - 1) // schedule.stride
    trace = np.zeros((rows, Trace.COLUMNS))
    log_jump = math.log(0.5 * schedule.jump_share) if schedule.jump_share > 0.0 else 0.0
    cooling = math.log(schedule.cold / schedule.hot) / max(schedule.proposals - 1, 1)
    for t in range(schedule.proposals):
        temperature = schedule.hot * math.exp(cooling * t)
        row = t // schedule.stride
        kind = _drawn_move(uniform(state), schedule)
        # A move is accepted when its log ratio C - delta / T exceeds the logarithm of a uniform number, that is, when
        # delta < limit + T C. The number is drawn first, so that energies above it need not be known exactly.
        odds = _Odds(temperature, density, log_jump, -temperature * math.log(1.0 - uniform(state)))
        before = count
        accepted = False
        if kind == Move.BIRTH:
            count, delta = _try_birth(window, births, chain, count, odds)
        elif kind == Move.DEATH:
            count, delta = _try_death(window, births, chain, count, odds)
        else:
            accepted, delta = _try_change(window, chain, count, odds, kind)
        trace[row, Trace.TRIED + kind] += 1
        if accepted or count != before:
            energy += delta
            trace[row, Trace.ACCEPTED + kind] += 1
            if energy < best_energy - _BETTER and temperature < _COLD_ENOUGH * schedule.cold:
                best, best_energy = chain.rectangles[:count].copy(), energy
        if t % schedule.stride == schedule.stride - 1 or t == schedule.proposals - 1:
            trace[row, Trace.PROPOSALS.value], trace[row, Trace.TEMPERATURE.value] = t + 1, temperature
            trace[row, Trace.ENERGY.value], trace[row, Trace.BUILDINGS.value] = energy, count
            if energy < best_energy - _BETTER:
                best, best_energy = chain.rectangles[:count].copy(), energy
    return best, chain.rectangles[:count].copy(), trace, best_energy
