"""The energy of a configuration of rectangles.

U(B) = sum_j [ price - weight * (L_j + S_j) ] + overlap * sum_{j<k} area(W_j and W_k)

L_j is the log-likelihood of the heights under roof j (`roofs`), S_j the sum of the scores of its cells (`background`),
both per cell; the weight turns cells into square metres, so that the energy of a building does not depend on the size
of a cell. `Model` holds all constants in units of cells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.kernels import kernel
from .rectangles import overlap_area
from .roofs import choose_roof, log_likelihood, scan

__all__ = [
    "Model",
    "configuration_energy",
    "energy_below",
    "ground_variance",
    "least_energy",
    "overlaps",
    "own_energies",
    "own_energy",
]


class Model(NamedTuple):
    """Constants of the energy.

    Attributes
    ----------
    weight : float
        Energy per nat of a cell: nats per square metre times the cell's area.
    price : float
        Of a rectangle.
    overlap : float
        Per square cell of common area.
    roof_price : float
        Per number that a roof has more than a flat one; infinite: flat roofs alone.
    least_tau, least_height, cell : float
        Metres.
    void_price : float
        Nats per cell off the grid.
    least_side, largest_side : float
        Cells.
    """

    weight: float
    price: float
    overlap: float
    roof_price: float
    least_tau: float
    least_height: float
    cell: float
    void_price: float
    least_side: float
    largest_side: float
    fit_weight: float
    ground_error: float


@kernel
def ground_variance(rectangle, model):  # type: ignore[no-untyped-def]
    """Return the variance of heights, m2, that the unknown ground under a rectangle explains."""
    return (max(rectangle[2], rectangle[3]) * model.cell * model.ground_error) ** 2


@kernel
def own_energy(small, large, rectangle, model):  # type: ignore[no-untyped-def]
    """Return the energy of a rectangle by itself."""
    return energy_below(small, large, rectangle, model, np.inf)


@kernel
def own_energies(small, large, rectangles, model):  # type: ignore[no-untyped-def]
    """Return the energy of each rectangle by itself, shape (n,)."""
    energies = np.empty(len(rectangles))
    for i in range(len(rectangles)):
        energies[i] = own_energy(small, large, rectangles[i], model)
    return energies


@kernel
def energy_below(small, large, rectangle, model, limit):  # type: ignore[no-untyped-def]
    """Return the energy of a rectangle by itself if it is less than a limit, else some number that is not.

    Most proposals are refused. What no roof could make good enough is given up without looking for its roof.
    """
    if model.weight == 0.0:
        return model.price
    moments = scan(small, large, rectangle)
    base = model.price - model.weight * (moments[0] - model.void_price * moments[1])
    share = model.weight * model.fit_weight
    if share == 0.0:
        return base
    needed = (base - limit) / share
    if max(log_likelihood(moments[2], 0.0, model.least_tau), 0.0) <= needed:
        return np.inf
    roof_price = model.roof_price / share
    likelihood, _, _, _ = choose_roof(
        small,
        large,
        rectangle,
        moments,
        roof_price,
        model.least_tau,
        ground_variance(rectangle, model),
        model.least_height,
        model.cell,
        needed,
    )
    return base - share * likelihood


@kernel
def least_energy(small, large, rectangle, model):  # type: ignore[no-untyped-def]
    """Return a bound that the energy of a rectangle by itself is not less than, from its scan alone."""
    if model.weight == 0.0:
        return model.price
    moments = scan(small, large, rectangle)
    most = max(log_likelihood(moments[2], 0.0, model.least_tau), 0.0)
    return model.price - model.weight * (moments[0] - model.void_price * moments[1] + model.fit_weight * most)


@kernel
def overlaps(rectangles, count, rectangle, skip, other):  # type: ignore[no-untyped-def]
    """Return the area, cells squared, that a rectangle shares with the first `count`, two of them passed over."""
    area = 0.0
    reach = 0.5 * math.hypot(rectangle[2], rectangle[3])
    for i in range(count):
        dx, dy = rectangles[i, 0] - rectangle[0], rectangles[i, 1] - rectangle[1]
        far = reach + 0.5 * (rectangles[i, 2] + rectangles[i, 3])
        if i != skip and i != other and dx * dx + dy * dy < far * far:
            area += overlap_area(rectangle, rectangles[i])
    return area


@kernel
def configuration_energy(small, large, rectangles, count, fixed, model):  # type: ignore[no-untyped-def]
    """Return U of the first `count` rectangles, their overlap with fixed ones included, from scratch."""
    total = 0.0
    for i in range(count):
        total += own_energy(small, large, rectangles[i], model)
        total += model.overlap * overlaps(rectangles, i, rectangles[i], -1, -1)
        total += model.overlap * overlaps(fixed, len(fixed), rectangles[i], -1, -1)
    return total
