"""The simulation of Yu, Li, Guan & Wang (2013), section 2.4, in the order of their flow chart.

Each iteration updates the marks of one building (step 2), moves the centre of one (step 3), and tries a birth or a
death (step 4). A proposal is accepted when its ratio reaches the constant false alarm ratio p_f, without a random
number (equation 7). The state with the highest posterior is the result (equation 17).

What the paper leaves open is read as follows: the five transformations of figure 2 are drawn equally often, nu and tau
are drawn with each of them; an edge-based change moves one of the two ends, drawn equally often. A least nu, truncated
priors and a largest overlap are no part of the print: they are off unless they are set.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from ...core.kernels import kernel
from .arrays import Floats, RandomState
from .printed_model import (
    ANGLE,
    GROUND,
    LENGTH,
    NU,
    TAU,
    TREE,
    WIDTH,
    PrintedModel,
    PrintedPoints,
    X,
    Y,
    birth_log_ratio,
    centre_log_ratios,
    death_log_ratio,
    log_posterior_gain,
    update_log_ratio,
)
from .random_stream import gaussian, integer, uniform
from .rectangles import overlap_area
from .reshaping import move_edge

__all__ = ["Operation", "PrintedSchedule", "PrintedTrace", "run_printed"]

#: Metres: least standard deviation of a roof that is proposed.
_LEAST_TAU = 0.05
#: How often a centre outside all buildings is drawn, at most.
_TRIES = 100


class Operation(IntEnum):
    """What an iteration tries."""

    UPDATE = 0
    CENTRE = 1
    BIRTH = 2
    DEATH = 3


class PrintedTrace(IntEnum):
    """Columns of a trace; from `TRIED` and from `ACCEPTED` on one column for each `Operation`."""

    ITERATIONS = 0
    ENERGY = 1
    BUILDINGS = 2
    TRIED = 3
    ACCEPTED = 7
    COLUMNS = 11


class Transformation(IntEnum):
    """The five transformations of figure 2."""

    CENTRE_DILATION = 0
    CENTRE_SHRINKAGE = 1
    EDGE_DILATION = 2
    EDGE_SHRINKAGE = 3
    ROTATION = 4


class PrintedSchedule(NamedTuple):
    """How the simulation is run.

    Attributes
    ----------
    steps : ndarray, shape (5,)
        Standard deviations of the proposals (epsilon): length, width (cells), angle (radians), nu and tau (metres).
    sides : ndarray, shape (2,)
        Least and largest side, cells.
    iterations : int
        T_m.
    false_alarm_ratio : float
        p_f of equation 7.
    birth_share : float
        b_k: share of births among births and deaths.
    least_nu : float
        Metres: a lower nu is not accepted.
    prior_limit : float
        Marks further than this many standard deviations from the mean of their prior are not accepted.
    overlap_share : float
        Share of its area that a building may have in common with another; 1 allows everything.
    buildings : float
        Mean of the Poisson distribution of the number of buildings (lambda).
    capacity : int
        No more buildings than this are kept.
    stride : int
        Iterations per row of the trace.
    """

    steps: Floats
    sides: Floats
    iterations: int
    false_alarm_ratio: float
    birth_share: float
    least_nu: float
    prior_limit: float
    overlap_share: float
    buildings: float
    capacity: int
    stride: int


@kernel
def _draw_building(
    new: Floats,
    buildings: Floats,
    shape: tuple[int, int],
    model: PrintedModel,
    schedule: PrintedSchedule,
    state: RandomState,
) -> bool:
    """Fill a new building, its centre uniform outside all others, its marks from the priors; return whether it fits."""
    new[ANGLE] = uniform(state) * math.pi
    for k, column in enumerate((LENGTH, WIDTH, NU, TAU)):
        new[column] = model.prior[k, 0] + model.prior[k, 1] * gaussian(state)
    for column in (LENGTH, WIDTH):
        new[column] = min(max(new[column], schedule.sides[0]), schedule.sides[1])
    new[TAU] = max(new[TAU], _LEAST_TAU)
    for _ in range(_TRIES):
        new[X], new[Y] = uniform(state) * shape[1], uniform(state) * shape[0]
        free = True
        for other in buildings:
            dx, dy = new[X] - other[X], new[Y] - other[Y]
            cos, sin = math.cos(other[ANGLE]), math.sin(other[ANGLE])
            if abs(dx * cos + dy * sin) < 0.5 * other[LENGTH] and abs(dy * cos - dx * sin) < 0.5 * other[WIDTH]:
                free = False
        if free:
            return True
    return False


@kernel
def _draw_marks(new: Floats, schedule: PrintedSchedule, state: RandomState) -> None:
    """Change the marks of a building, in place: one of the five transformations, and nu and tau."""
    steps, sides = schedule.steps, schedule.sides
    new[NU] += steps[3] * gaussian(state)
    new[TAU] = max(new[TAU] + steps[4] * gaussian(state), _LEAST_TAU)
    kind = integer(state, 5)
    if kind == Transformation.ROTATION:
        new[ANGLE] = (new[ANGLE] + steps[2] * gaussian(state)) % math.pi
        return
    axis = integer(state, 2)
    by = abs(steps[axis] * gaussian(state))
    if kind == Transformation.CENTRE_SHRINKAGE or kind == Transformation.EDGE_SHRINKAGE:
        by = -by
    by = min(max(new[LENGTH + axis] + by, sides[0]), sides[1]) - new[LENGTH + axis]
    if kind == Transformation.CENTRE_DILATION or kind == Transformation.CENTRE_SHRINKAGE:
        new[LENGTH + axis] += by
    else:
        move_edge(new.copy(), 2 * axis + integer(state, 2), by, new)


@kernel
def _centre_accepted(new: Floats, old: Floats, points: PrintedPoints, model: PrintedModel, limit: float) -> bool:
    """Return whether equations 8 and 10, or 9 and 11, reach the limit."""
    ratios = centre_log_ratios(new, old, points, model, limit)
    left_as_ground = min(ratios[GROUND, GROUND], ratios[GROUND, TREE])
    left_as_trees = min(ratios[TREE, GROUND], ratios[TREE, TREE])
    return bool(max(left_as_ground, left_as_trees) >= limit)


@kernel
def _permitted(
    new: Floats,
    buildings: Floats,
    skip: int,
    shape: tuple[int, int],
    model: PrintedModel,
    schedule: PrintedSchedule,
) -> bool:
    """Return whether a building lies on the grid, its marks are in their ranges and it overlaps none too much."""
    if not (0.0 <= new[X] < shape[1] and 0.0 <= new[Y] < shape[0] and new[NU] >= schedule.least_nu):
        return False
    for k, column in enumerate((LENGTH, WIDTH, NU, TAU)):
        if abs(new[column] - model.prior[k, 0]) > schedule.prior_limit * model.prior[k, 1]:
            return False
    if schedule.overlap_share >= 1.0:
        return True
    for i in range(len(buildings)):
        if i != skip:
            smaller = min(new[LENGTH] * new[WIDTH], buildings[i, LENGTH] * buildings[i, WIDTH])
            if overlap_area(new, buildings[i]) > schedule.overlap_share * smaller:
                return False
    return True


@kernel
def run_printed(
    points: PrintedPoints, model: PrintedModel, schedule: PrintedSchedule, state: RandomState
) -> tuple[Floats, Floats]:
    """Run the printed simulation.

    Parameters
    ----------
    points : PrintedPoints
    model : PrintedModel
    schedule : PrintedSchedule
    state : ndarray of uint64
        Random stream; advanced.

    Returns
    -------
    best : ndarray, shape (n, 7)
        Buildings of the state with the highest posterior.
    trace : ndarray, shape (rows, 11)
        See `PrintedTrace`; the energy is minus the log-posterior without the terms that no building changes.
    """
    shape = (points.table.shape[0], points.table.shape[1] - 1)
    buildings, gains = np.empty((schedule.capacity, 7)), np.empty(schedule.capacity)
    new = np.empty(7)
    limit = math.log(schedule.false_alarm_ratio)
    log_lambda = math.log(schedule.buildings)
    count, total = 0, 0.0
    best, best_value = buildings[:0].copy(), -np.inf
    rows = (schedule.iterations + schedule.stride - 1) // schedule.stride
    trace = np.zeros((rows, PrintedTrace.COLUMNS))
    # Step 1: one building, drawn from the priors.
    if _draw_building(new, buildings[:0], shape, model, schedule, state):
        buildings[0], gains[0] = new, log_posterior_gain(new, points, model)
        count, total = 1, gains[0]
    for t in range(schedule.iterations):
        row = t // schedule.stride
        for operation in (Operation.UPDATE, Operation.CENTRE):
            if count == 0:
                continue
            i = integer(state, count)
            new[:] = buildings[i]
            if operation == Operation.UPDATE:
                _draw_marks(new, schedule, state)
                accepted = update_log_ratio(new, buildings[i], points, model, limit) >= limit
            else:
                along, across = (uniform(state) - 0.5) * new[LENGTH], (uniform(state) - 0.5) * new[WIDTH]
                cos, sin = math.cos(new[ANGLE]), math.sin(new[ANGLE])
                new[X] += along * cos - across * sin
                new[Y] += along * sin + across * cos
                accepted = _centre_accepted(new, buildings[i], points, model, limit)
            trace[row, PrintedTrace.TRIED + operation] += 1
            if accepted and _permitted(new, buildings[:count], i, shape, model, schedule):
                trace[row, PrintedTrace.ACCEPTED + operation] += 1
                gain = log_posterior_gain(new, points, model)
                total += gain - gains[i]
                buildings[i], gains[i] = new, gain
        if uniform(state) < schedule.birth_share:
            trace[row, PrintedTrace.TRIED + Operation.BIRTH] += 1
            if count < schedule.capacity and _draw_building(new, buildings[:count], shape, model, schedule, state):
                ratio = min(birth_log_ratio(new, GROUND, points, model), birth_log_ratio(new, TREE, points, model))
                if ratio >= limit and _permitted(new, buildings[:count], -1, shape, model, schedule):
                    trace[row, PrintedTrace.ACCEPTED + Operation.BIRTH] += 1
                    buildings[count], gains[count] = new, log_posterior_gain(new, points, model)
                    total += gains[count]
                    count += 1
        else:
            trace[row, PrintedTrace.TRIED + Operation.DEATH] += 1
            if count > 0:
                i = integer(state, count)
                if death_log_ratio(buildings[i], points, model) >= limit:
                    trace[row, PrintedTrace.ACCEPTED + Operation.DEATH] += 1
                    total -= gains[i]
                    count -= 1
                    buildings[i], gains[i] = buildings[count], gains[count]
        value = total + count * log_lambda - math.lgamma(count + 1.0)
        if value > best_value:
            best, best_value = buildings[:count].copy(), value
        trace[row, PrintedTrace.ITERATIONS.value] = t + 1
        trace[row, PrintedTrace.ENERGY.value], trace[row, PrintedTrace.BUILDINGS.value] = -value, count
    return best, trace
