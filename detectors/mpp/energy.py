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
from numba import njit

from .rectangles import overlap_area
from .roofs import fit_roof

__all__ = ["Model", "configuration_energy", "overlaps", "own_energy"]


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


@njit(cache=True, nogil=True)
def own_energy(small, large, rectangle, model):  # type: ignore[no-untyped-def]
    """Return the energy of a rectangle by itself."""
    if model.weight == 0.0:
        return model.price
    fit = np.empty(5)
    likelihood, score, outside = fit_roof(
        small,
        large,
        rectangle,
        model.roof_price / (model.weight * model.fit_weight),
        model.least_tau,
        model.least_height,
        model.cell,
        fit,
    )
    return model.price - model.weight * (model.fit_weight * likelihood + score - model.void_price * outside)


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def configuration_energy(small, large, rectangles, count, fixed, model):  # type: ignore[no-untyped-def]
    """Return U of the first `count` rectangles, their overlap with fixed ones included, from scratch."""
    total = 0.0
    for i in range(count):
        total += own_energy(small, large, rectangles[i], model)
        total += model.overlap * overlaps(rectangles, i, rectangles[i], -1, -1)
        total += model.overlap * overlaps(fixed, len(fixed), rectangles[i], -1, -1)
    return total
