"""The algorithm as printed: Yu, Li, Guan & Wang (2013), sections 2.1 to 2.4, with its shortcuts.

Elevations of all points, not heights; one Gaussian each for ground and trees over the whole scene (equation 1); a
proposal is accepted when its ratio reaches the constant false alarm ratio p_f, without a random number (equation 7);
equation 6 compares the likelihoods of two different point sets; overlap is free. What the paper leaves open is read as
follows: the five transformations are drawn equally often; "match the prior model" is |z - nu| <= 2 tau; a death is
accepted by equation 16 with the same p_f. Points are held per cell (n, sum z, sum z2), and a cell belongs to a
rectangle when its centre does; the share of matching points is that of a Gaussian with the cell sums' mean and spread.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.points import PointCloud
from .cells import HIGH
from .preparation import Prepared
from .random_stream import gaussian, integer, stream, uniform
from .rectangles import row_span

if TYPE_CHECKING:
    from .mpp_detector import MPP

__all__ = ["run_printed", "sample_printed"]

_TRACE = ("proposals", "temperature", "energy", "buildings")


def sample_printed(
    parameters: MPP, prepared: Prepared, points: PointCloud, seed: int
) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Run the printed algorithm on elevations; the Gaussians of ground and trees come from low and rough cells.

    Returns
    -------
    rectangles : ndarray, shape (n, 5)
    trace : dict
        Columns of `run_printed`; p_f stands where the temperature does.
    """
    grid, cell = prepared.grid, prepared.grid.gsd
    index, inside = grid.cells(points.x, points.y)
    inside &= np.isfinite(points.z)
    index, z = index[inside], points.z[inside]
    base = float(np.median(z)) if len(z) else 0.0
    z = z - base
    sums = [np.bincount(index, weights=z**k, minlength=grid.rows * grid.columns) for k in range(3)]
    table = np.stack(sums, axis=-1).reshape(*grid.shape, 3)
    high = (prepared.state == HIGH).ravel()[index]
    rough = (prepared.score < 0).ravel()[index] & high
    roof = high & ~rough
    classes = np.array([_normal(z[~high]), _normal(z[rough] if rough.any() else z)])
    height = _normal(z[roof] if roof.any() else z)
    found, trace = run_printed(
        table,
        classes,
        np.array([(15 / cell, 6 / cell), (10 / cell, 4 / cell), height, (0.5, 0.25)]),
        np.array([1.0 / cell, 1.0 / cell, 0.1, 0.5, 0.1]),
        np.array([parameters.least_side / cell, parameters.largest_side / cell]),
        stream([seed]),
        parameters.iterations,
        parameters.false_alarm_ratio,
        5000,
        max(parameters.iterations // 100, 1),
    )
    return np.ascontiguousarray(found[:, :5]), {name: trace[:, k].tolist() for k, name in enumerate(_TRACE)}


def _normal(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return mean and standard deviation, the latter at least 10 cm."""
    return float(values.mean()), max(float(values.std()), 0.1)


@kernel
def _cells(rectangle, rows, columns, mask, value):  # type: ignore[no-untyped-def]
    """Write a value into the mask for all cells of a rectangle; return rows and columns that were touched."""
    half_a, half_b = 0.5 * rectangle[2], 0.5 * rectangle[3]
    cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
    tall = half_a * abs(sin) + half_b * abs(cos)
    wide = half_a * abs(cos) + half_b * abs(sin)
    top, bottom = max(int(rectangle[1] - tall), 0), min(int(rectangle[1] + tall) + 2, rows)
    left, right = max(int(rectangle[0] - wide), 0), min(int(rectangle[0] + wide) + 2, columns)
    for r in range(top, bottom):
        lo, hi = row_span(r + 0.5 - rectangle[1], half_a, half_b, cos, sin)
        for c in range(left, right):
            if lo <= c + 0.5 - rectangle[0] <= hi:
                mask[r, c] += value
    return top, bottom, left, right


@kernel
def _sums(rectangle, points, mask, out):  # type: ignore[no-untyped-def]
    """Fill n, sum z, sum z2 of a rectangle."""
    rows, columns = points.shape[0], points.shape[1]
    top, bottom, left, right = _cells(rectangle, rows, columns, mask, 1)
    out[:] = 0.0
    for r in range(top, bottom):
        for c in range(left, right):
            if mask[r, c]:
                for k in range(3):
                    out[k] += points[r, c, k]
                mask[r, c] = 0


@kernel
def _difference(first, second, points, mask, out):  # type: ignore[no-untyped-def]
    """Fill n, sum z, sum z2 of the cells of the first rectangle that are not in the second."""
    rows, columns = points.shape[0], points.shape[1]
    top, bottom, left, right = _cells(first, rows, columns, mask, 1)
    _cells(second, rows, columns, mask, -2)
    out[:] = 0.0
    for r in range(top, bottom):
        for c in range(left, right):
            if mask[r, c] == 1:
                for k in range(3):
                    out[k] += points[r, c, k]
    _cells(second, rows, columns, mask, 2)
    _cells(first, rows, columns, mask, -1)


@kernel
def _log_likelihood(sums, mean, spread):  # type: ignore[no-untyped-def]
    """Log-likelihood of n points with these sums under one Gaussian (equation 2)."""
    squares = sums[2] - 2.0 * mean * sums[1] + mean * mean * sums[0]
    return -sums[0] * math.log(math.sqrt(2.0 * math.pi) * spread) - 0.5 * squares / (spread * spread)


@kernel
def _matching(sums, mean, spread):  # type: ignore[no-untyped-def]
    """Share of points within two standard deviations of a building's height."""
    if sums[0] == 0.0:
        return 0.0
    centre = sums[1] / sums[0]
    width = math.sqrt(max(sums[2] / sums[0] - centre * centre, 1e-6)) * math.sqrt(2.0)
    upper, lower = mean + 2.0 * spread - centre, mean - 2.0 * spread - centre
    return 0.5 * (math.erf(upper / width) - math.erf(lower / width))


@kernel
def _log_prior(building, prior):  # type: ignore[no-untyped-def]
    """Gaussian log-priors of length, width, height mean and height spread; place and angle are uniform."""
    total = 0.0
    for k in range(4):
        value = building[2 + k] if k < 2 else building[3 + k]
        total -= 0.5 * ((value - prior[k, 0]) / prior[k, 1]) ** 2
    return total


@kernel
def run_printed(points, classes, prior, steps, sides, state, iterations, ratio, capacity, stride):  # type: ignore[no-untyped-def]
    """Run the printed algorithm.

    Parameters
    ----------
    points : ndarray, shape (rows, columns, 3)
        n, sum z, sum z2 of each cell, metres.
    classes : ndarray, shape (2, 2)
        Mean and spread of the elevation of ground and of trees, metres.
    prior : ndarray, shape (4, 2)
        Mean and spread of length and width (cells), height mean and height spread (metres).
    steps : ndarray, shape (5,)
        Spread of the proposals of length, width (cells), angle (radians), height mean and height spread (metres).
    sides : ndarray, shape (2,)
        Least and largest side, cells.
    state : ndarray of uint64
        Random stream.
    iterations : int
    ratio : float
        Constant false alarm ratio p_f.
    capacity, stride : int

    Returns
    -------
    best, trace : ndarray, shape (n, 7), (rows, 4)
        Buildings x, y, a, b, angle, nu, tau of the state with the highest posterior among those looked at once per
        stride (equation 17); per stride: iterations, p_f, minus log-posterior, number of buildings.
    """
    rows, columns = points.shape[0], points.shape[1]
    mask = np.zeros((rows, columns), dtype=np.int16)
    buildings = np.empty((capacity, 7))
    limit = math.log(ratio)
    count, before, after, gone, come = 0, np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    new = np.empty(7)
    best, best_value = buildings[:0].copy(), -np.inf
    trace = np.zeros(((iterations + stride - 1) // stride, 4))
    for t in range(-1, iterations):
        jump = t < 0 or uniform(state) < 1.0 / 3.0
        if jump and (t < 0 or uniform(state) < 0.5):
            new[0], new[1] = uniform(state) * columns, uniform(state) * rows
            new[4] = uniform(state) * math.pi
            for k in range(4):
                new[2 + k if k < 2 else 3 + k] = prior[k, 0] + prior[k, 1] * gaussian(state)
            new[2], new[3] = min(max(new[2], sides[0]), sides[1]), min(max(new[3], sides[0]), sides[1])
            new[6] = max(new[6], 0.05)
            free = count < capacity
            for i in range(count):
                # The centre is drawn outside the buildings that are there (step 4).
                dx, dy = new[0] - buildings[i, 0], new[1] - buildings[i, 1]
                cos, sin = math.cos(buildings[i, 4]), math.sin(buildings[i, 4])
                inside = abs(dx * cos + dy * sin) < 0.5 * buildings[i, 2]
                if inside and abs(dy * cos - dx * sin) < 0.5 * buildings[i, 3]:
                    free = False
            if free:
                _sums(new, points, mask, after)
                own = _log_likelihood(after, new[5], new[6])
                ground = own - _log_likelihood(after, classes[0, 0], classes[0, 1])
                tree = own - _log_likelihood(after, classes[1, 0], classes[1, 1])
                if after[0] > 0.0 and min(ground, tree) >= limit:
                    buildings[count] = new
                    count += 1
        elif jump and count > 0:
            i = integer(state, count)
            _sums(buildings[i], points, mask, before)
            own = _log_likelihood(before, buildings[i, 5], buildings[i, 6])
            other = max(
                _log_likelihood(before, classes[0, 0], classes[0, 1]),
                _log_likelihood(before, classes[1, 0], classes[1, 1]),
            )
            if other - own >= limit:
                count -= 1
                buildings[i] = buildings[count]
        elif count > 0:
            i = integer(state, count)
            new[:] = buildings[i]
            new[5] += steps[3] * gaussian(state)
            new[6] = max(new[6] + steps[4] * gaussian(state), 0.05)
            if uniform(state) < 0.5:
                kind = integer(state, 5)
                axis = integer(state, 2)
                if kind == 4:
                    new[4] = (new[4] + steps[2] * gaussian(state)) % math.pi
                else:
                    grow = abs(steps[axis] * gaussian(state)) * (1.0 if kind % 2 == 0 else -1.0)
                    new[2 + axis] = min(max(new[2 + axis] + grow, sides[0]), sides[1])
                    if kind >= 2:
                        shift = 0.5 * (new[2 + axis] - buildings[i, 2 + axis]) * (1.0 if uniform(state) < 0.5 else -1.0)
                        cos, sin = math.cos(new[4]), math.sin(new[4])
                        new[0] += shift * (cos if axis == 0 else -sin)
                        new[1] += shift * (sin if axis == 0 else cos)
                # Equation 6: likelihoods of two different point sets.
                _sums(buildings[i], points, mask, before)
                _sums(new, points, mask, after)
                log_ratio = _log_likelihood(after, new[5], new[6])
                log_ratio -= _log_likelihood(before, buildings[i, 5], buildings[i, 6])
                log_ratio += _log_prior(new, prior) - _log_prior(buildings[i], prior)
                log_ratio += _matching(after, new[5], new[6]) - _matching(before, buildings[i, 5], buildings[i, 6])
                accepted = log_ratio >= limit
            else:
                along, across = (uniform(state) - 0.5) * new[2], (uniform(state) - 0.5) * new[3]
                cos, sin = math.cos(new[4]), math.sin(new[4])
                new[0] += along * cos - across * sin
                new[1] += along * sin + across * cos
                _sums(buildings[i], points, mask, before)
                _sums(new, points, mask, after)
                _difference(new, buildings[i], points, mask, come)
                _difference(buildings[i], new, points, mask, gone)
                base = _log_likelihood(come, new[5], new[6]) - _log_likelihood(gone, buildings[i, 5], buildings[i, 6])
                base += _log_prior(new, prior) - _log_prior(buildings[i], prior)
                base += _matching(after, new[5], new[6]) - _matching(before, buildings[i, 5], buildings[i, 6])
                accepted = False
                for left in range(2):
                    # Equations 8 and 10 (left as ground), 9 and 11 (left as tree).
                    released = base + _log_likelihood(gone, classes[left, 0], classes[left, 1])
                    ground = released - _log_likelihood(come, classes[0, 0], classes[0, 1])
                    tree = released - _log_likelihood(come, classes[1, 0], classes[1, 1])
                    accepted = accepted or min(ground, tree) >= limit
            if accepted and after[0] > 0.0 and 0.0 <= new[0] < columns and 0.0 <= new[1] < rows:
                buildings[i] = new
        if t >= 0 and (t % stride == stride - 1 or t == iterations - 1):
            value = 0.0
            for i in range(count):
                _sums(buildings[i], points, mask, after)
                value += _log_likelihood(after, buildings[i, 5], buildings[i, 6])
                value += _log_prior(buildings[i], prior)
                value -= max(
                    _log_likelihood(after, classes[0, 0], classes[0, 1]),
                    _log_likelihood(after, classes[1, 0], classes[1, 1]),
                )
            row = t // stride
            trace[row, 0], trace[row, 1], trace[row, 2], trace[row, 3] = t + 1, ratio, -value, count
            if value > best_value:
                best, best_value = buildings[:count].copy(), value
    return best, trace
