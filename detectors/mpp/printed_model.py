"""The model of Yu, Li, Guan & Wang (2013) as printed: likelihoods, priors and acceptance ratios of equations 1 to 16.

Nouns
-----
sums
    n, sum of z and sum of z2 of a set of points: all that a Gaussian likelihood needs.
sum table
    Running sums from the west over the rows of a grid, shape (rows, columns + 1, 3), from which the sums of a rectangle
    follow in one scan over its rows. A cell, with its points, belongs to a rectangle when its centre does.
building
    x, y, length, width (cells), angle (radians), nu and tau (metres): a rectangle, and mean and standard deviation of
    the elevations of its roof.
class
    Ground or tree; its Gaussian is ``(mean, standard deviation)`` in metres.

All ratios are logarithms, without the bound at 1 (min(1, r) >= p_f and r >= p_f are the same for p_f <= 1).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .arrays import Floats
from .rectangles import row_span

__all__ = [
    "ANGLE",
    "GROUND",
    "LENGTH",
    "NU",
    "TAU",
    "TREE",
    "WIDTH",
    "PrintedModel",
    "PrintedPoints",
    "X",
    "Y",
    "birth_log_ratio",
    "building_sums",
    "centre_log_ratios",
    "common_sums",
    "death_log_ratio",
    "log_likelihood",
    "log_posterior_gain",
    "log_prior",
    "matching_share",
    "sorted_points",
    "update_log_ratio",
]

#: Rows of `PrintedModel.classes`.
GROUND, TREE = 0, 1
#: Columns of a building.
X, Y, LENGTH, WIDTH, ANGLE, NU, TAU = range(7)


class PrintedModel(NamedTuple):
    """Constants of the model.

    Attributes
    ----------
    classes : ndarray, shape (2, 2)
        Mean and standard deviation of the elevation of ground and trees (mu and sigma of equation 1), metres.
    prior : ndarray, shape (4, 2)
        Mean and standard deviation of the Gaussian priors of length and width (cells), nu and tau (metres).
    match : float
        A point matches the prior model of its building within this many tau of nu.
    log_birth : float
        log(lambda b_k / d_{k+1}): what equation 12 adds to the ratio of likelihoods; 0 for equation 13.
    union : bool
        Whether equation 6 compares both states over the union of both windows, as equations 8 to 11 do.
    """

    classes: Floats
    prior: Floats
    match: float
    log_birth: float
    union: bool


class PrintedPoints(NamedTuple):
    """Points by the cells of a grid.

    Attributes
    ----------
    table : ndarray, shape (rows, columns + 1, 3)
        Sum table.
    z : ndarray, shape (n,)
        Elevations, cell by cell from the west, row by row from the north.
    starts : ndarray of int64, shape (rows,)
        Where each row begins in `z`.
    """

    table: Floats
    z: Floats
    starts: NDArray[np.int64]


def sorted_points(index: NDArray[np.intp], z: Floats, shape: tuple[int, int]) -> PrintedPoints:
    """Return points sorted into the cells of a grid.

    Parameters
    ----------
    index : ndarray of int, shape (n,)
        Flat cell of each point.
    z : ndarray, shape (n,)
        Metres; near 0, so that sums of squares keep their digits.
    shape : tuple of int
        Rows and columns.
    """
    sums = [np.bincount(index, weights=z**power, minlength=shape[0] * shape[1]) for power in range(3)]
    table = np.zeros((shape[0], shape[1] + 1, 3))
    table[:, 1:] = np.stack(sums, axis=-1).reshape(*shape, 3).cumsum(axis=1)
    ends = np.cumsum(table[:, -1, 0]).astype(np.int64)
    return PrintedPoints(table, z[np.argsort(index, kind="stable")], np.concatenate([[0], ends[:-1]]))


@kernel
def _span(building: Floats, row: int, columns: int) -> tuple[int, int]:
    """Return the cells first..last of a row whose centre lies in a building."""
    cos, sin = math.cos(building[ANGLE]), math.sin(building[ANGLE])
    low, high = row_span(row + 0.5 - building[Y], 0.5 * building[LENGTH], 0.5 * building[WIDTH], cos, sin)
    if low > high:
        return 0, 0
    first = min(max(math.ceil(building[X] + low - 0.5), 0), columns)
    return first, max(min(math.floor(building[X] + high + 0.5), columns), first)


@kernel
def _rows(building: Floats, rows: int) -> tuple[int, int]:
    """Return the rows that a building reaches."""
    tall = 0.5 * (building[LENGTH] * abs(math.sin(building[ANGLE])) + building[WIDTH] * abs(math.cos(building[ANGLE])))
    return max(math.floor(building[Y] - tall), 0), min(math.ceil(building[Y] + tall), rows)


@kernel
def building_sums(building: Floats, table: Floats, sums: Floats) -> None:
    """Fill the sums of the points in a building."""
    sums[:] = 0.0
    top, bottom = _rows(building, table.shape[0])
    for row in range(top, bottom):
        first, last = _span(building, row, table.shape[1] - 1)
        for k in range(3):
            sums[k] += table[row, last, k] - table[row, first, k]


@kernel
def common_sums(one: Floats, other: Floats, table: Floats, sums: Floats) -> None:
    """Fill the sums of the points in both of two buildings."""
    sums[:] = 0.0
    top, bottom = _rows(one, table.shape[0])
    for row in range(top, bottom):
        first, last = _span(one, row, table.shape[1] - 1)
        begin, end = _span(other, row, table.shape[1] - 1)
        first, last = max(first, begin), min(last, end)
        if last > first:
            for k in range(3):
                sums[k] += table[row, last, k] - table[row, first, k]


@kernel
def log_likelihood(sums: Floats, mean: float, spread: float) -> float:
    """Return the log-likelihood of points under one Gaussian (equation 2)."""
    squares = sums[2] - 2.0 * mean * sums[1] + mean * mean * sums[0]
    return float(-sums[0] * math.log(math.sqrt(2.0 * math.pi) * spread) - 0.5 * squares / (spread * spread))


@kernel
def matching_share(building: Floats, points: PrintedPoints, match: float) -> float:
    """Return n / N of equation 6: the share of the points in a building within `match` tau of nu; 0 without points."""
    rows, columns = points.table.shape[0], points.table.shape[1] - 1
    low, high = building[NU] - match * building[TAU], building[NU] + match * building[TAU]
    matching, number = 0, 0
    top, bottom = _rows(building, rows)
    for row in range(top, bottom):
        first, last = _span(building, row, columns)
        begin = points.starts[row] + int(points.table[row, first, 0])
        end = points.starts[row] + int(points.table[row, last, 0])
        number += end - begin
        for i in range(begin, end):
            matching += low <= points.z[i] <= high
    return matching / number if number > 0 else 0.0


@kernel
def log_prior(building: Floats, prior: Floats) -> float:
    """Return the logarithm of equation 5 for one building; place and angle are uniform, and constants left out."""
    total = 0.0
    for k, column in enumerate((LENGTH, WIDTH, NU, TAU)):
        total -= 0.5 * ((building[column] - prior[k, 0]) / prior[k, 1]) ** 2
    return float(total)


@kernel
def _marks_log_ratio(
    new: Floats, old: Floats, points: PrintedPoints, model: PrintedModel, rest: float, limit: float
) -> float:
    """Return the logarithm of P(B*) exp(n*/N*) / (P(B) exp(n/N)), which equations 6 and 8 to 11 share.

    Minus infinity where it and the rest of the ratio do not reach a limit whatever the shares n/N are, which then need
    not be counted.
    """
    ratio = log_prior(new, model.prior) - log_prior(old, model.prior)
    if rest + ratio + 1.0 < limit:
        return -np.inf
    return float(ratio + matching_share(new, points, model.match) - matching_share(old, points, model.match))


@kernel
def update_log_ratio(new: Floats, old: Floats, points: PrintedPoints, model: PrintedModel, limit: float) -> float:
    """Return the logarithm of equation 6; minus infinity where the new window holds no point.

    It may be minus infinity, too, where it is below a limit.

    As printed it compares the likelihoods of two different point sets. With `PrintedModel.union` points that only one
    of the windows holds count in the other state as the class that explains them better.
    """
    before, after, common = np.empty(3), np.empty(3), np.empty(3)
    building_sums(old, points.table, before)
    building_sums(new, points.table, after)
    if after[0] < 0.5:
        return -np.inf
    ratio = log_likelihood(after, new[NU], new[TAU]) - log_likelihood(before, old[NU], old[TAU])
    if model.union:
        common_sums(new, old, points.table, common)
        ratio += _best_class(before - common, model.classes) - _best_class(after - common, model.classes)
    return float(ratio + _marks_log_ratio(new, old, points, model, ratio, limit))


@kernel
def _best_class(sums: Floats, classes: Floats) -> float:
    """Return the log-likelihood of points under the class that explains them better."""
    ground = log_likelihood(sums, classes[GROUND, 0], classes[GROUND, 1])
    return float(max(ground, log_likelihood(sums, classes[TREE, 0], classes[TREE, 1])))


@kernel
def centre_log_ratios(new: Floats, old: Floats, points: PrintedPoints, model: PrintedModel, limit: float) -> Floats:
    """Return the logarithms of equations 8 to 11, shape (2, 2); minus infinity where the new window holds no point.

    Rows are the class of the points that the building leaves, columns that of those that it takes in: equation 8 is
    (ground, ground), 9 (tree, ground), 10 (ground, tree), 11 (tree, tree).

    Parameters
    ----------
    new, old : ndarray, shape (7,)
        Building after and before.
    points : PrintedPoints
    model : PrintedModel
    limit : float
        Where all are below it they may be minus infinity, too.
    """
    ratios = np.full((2, 2), -np.inf)
    before, after, common = np.empty(3), np.empty(3), np.empty(3)
    building_sums(new, points.table, after)
    if after[0] < 0.5:
        return ratios
    building_sums(old, points.table, before)
    common_sums(new, old, points.table, common)
    gained, left = after - common, before - common
    own = log_likelihood(gained, new[NU], new[TAU]) - log_likelihood(left, old[NU], old[TAU])
    for released in (GROUND, TREE):
        lost = own + log_likelihood(left, model.classes[released, 0], model.classes[released, 1])
        for taken in (GROUND, TREE):
            won = log_likelihood(gained, model.classes[taken, 0], model.classes[taken, 1])
            ratios[released, taken] = lost - won
    ratios += _marks_log_ratio(new, old, points, model, ratios.max(), limit)
    return ratios


@kernel
def birth_log_ratio(building: Floats, other: int, points: PrintedPoints, model: PrintedModel) -> float:
    """Return the logarithm of equation 14 (`other` ground) or 15 (tree), times the factor that equation 12 adds.

    Minus infinity where the window holds no point.
    """
    sums = np.empty(3)
    building_sums(building, points.table, sums)
    if sums[0] < 0.5:
        return -np.inf
    ratio = log_likelihood(sums, building[NU], building[TAU])
    return float(ratio - log_likelihood(sums, model.classes[other, 0], model.classes[other, 1]) + model.log_birth)


@kernel
def death_log_ratio(building: Floats, points: PrintedPoints, model: PrintedModel) -> float:
    """Return the logarithm of equation 16: the points of the building count as the class that explains them better."""
    sums = np.empty(3)
    building_sums(building, points.table, sums)
    return float(_best_class(sums, model.classes) - log_likelihood(sums, building[NU], building[TAU]) - model.log_birth)


@kernel
def log_posterior_gain(building: Floats, points: PrintedPoints, model: PrintedModel) -> float:
    """Return what a building adds to the log-posterior of equation 3, without the Poisson term of their number."""
    sums = np.empty(3)
    building_sums(building, points.table, sums)
    gain = log_likelihood(sums, building[NU], building[TAU]) - _best_class(sums, model.classes)
    return float(gain + log_prior(building, model.prior))
