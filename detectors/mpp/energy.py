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
from .arrays import Floats, Rectangles
from .rectangle_sums import scan
from .rectangles import overlap_area
from .roofs import RoofRules, choose_roof, log_likelihood
from .tables import Tables

__all__ = [
    "Model",
    "configuration_energy",
    "energy_below",
    "ground_variance",
    "least_energy",
    "overlaps",
    "rectangle_energies",
    "rectangle_energy",
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
    fit_weight : float
        Share of the likelihood of heights that counts.
    ground_error : float
        Error of the ground height, metres per metre of the longest side.
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

    @property
    def roof_rules(self) -> RoofRules:
        """How roofs are chosen (kernels make the same from the fields)."""
        share = self.weight * self.fit_weight
        price = self.roof_price / share if share > 0 else math.inf
        return RoofRules(price, self.least_tau, self.least_height, self.cell)


@kernel
def ground_variance(rectangle: Rectangles, model: Model) -> float:
    """Return the variance of heights, m2, that the unknown ground under a rectangle explains."""
    return float((max(rectangle[2], rectangle[3]) * model.cell * model.ground_error) ** 2)


@kernel
def rectangle_energy(tables: Tables, rectangle: Rectangles, model: Model) -> float:
    """Return the energy of a rectangle by itself."""
    return float(energy_below(tables, rectangle, model, np.inf))


@kernel
def rectangle_energies(tables: Tables, rectangles: Rectangles, model: Model) -> Floats:
    """Return the energy of each rectangle by itself, shape (n,)."""
    energies = np.empty(len(rectangles))
    for i in range(len(rectangles)):
        energies[i] = rectangle_energy(tables, rectangles[i], model)
    return energies


@kernel
def energy_below(tables: Tables, rectangle: Rectangles, model: Model, limit: float) -> float:
    """Return the energy of a rectangle by itself if it is less than a limit, else any number not less than the limit.

    Most proposals are refused: where even the best roof would not reach the limit, no roof is fitted.
    """
    if model.weight == 0.0:
        return model.price
    sums = scan(tables, rectangle)
    base = model.price - model.weight * (sums.score - model.void_price * sums.outside)
    share = model.weight * model.fit_weight
    if share == 0.0:
        return float(base)
    needed = (base - limit) / share
    if max(log_likelihood(sums.n, 0.0, model.least_tau), 0.0) <= needed:
        return np.inf
    rules = RoofRules(model.roof_price / share, model.least_tau, model.least_height, model.cell)
    likelihood, _, _, _ = choose_roof(tables, rectangle, sums, rules, ground_variance(rectangle, model), needed)
    return float(base - share * likelihood)


@kernel
def least_energy(tables: Tables, rectangle: Rectangles, model: Model) -> float:
    """Return a bound that the energy of a rectangle by itself is not less than, from its scan alone."""
    if model.weight == 0.0:
        return model.price
    sums = scan(tables, rectangle)
    most = max(log_likelihood(sums.n, 0.0, model.least_tau), 0.0)
    base = model.price - model.weight * (sums.score - model.void_price * sums.outside + model.fit_weight * most)
    return float(base)


@kernel
def overlaps(rectangles: Rectangles, count: int, rectangle: Rectangles, skip: int, other: int) -> float:
    """Return the area, cells squared, that a rectangle shares with the first `count`, two of them skipped."""
    area = 0.0
    reach = 0.5 * math.hypot(rectangle[2], rectangle[3])
    for i in range(count):
        dx, dy = rectangles[i, 0] - rectangle[0], rectangles[i, 1] - rectangle[1]
        far = reach + 0.5 * (rectangles[i, 2] + rectangles[i, 3])
        if i != skip and i != other and dx * dx + dy * dy < far * far:
            area += overlap_area(rectangle, rectangles[i])
    return area


@kernel
def configuration_energy(tables: Tables, rectangles: Rectangles, count: int, fixed: Rectangles, model: Model) -> float:
    """Return U of the first `count` rectangles, their overlap with fixed ones included, from scratch."""
    total = 0.0
    for i in range(count):
        total += rectangle_energy(tables, rectangles[i], model)
        total += model.overlap * overlaps(rectangles, i, rectangles[i], -1, -1)
        total += model.overlap * overlaps(fixed, len(fixed), rectangles[i], -1, -1)
    return total
