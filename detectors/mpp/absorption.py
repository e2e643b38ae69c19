"""Absorption: a large building absorbs smaller neighbours that are parts of its roof."""

from __future__ import annotations

import numpy as np

from ...core.kernels import kernel
from .arrays import Rectangles
from .energy import overlaps, rectangle_energy
from .reshaping import join_along
from .search_moves import LEAST_GAIN, Buildings, descend, near
from .windows import Window, allowed, shared_area

__all__ = ["absorb"]

#: Share of a joined rectangle that its two parts fill, share of their energy that it has by itself before it descends,
#: and share of a third building inside it from which on that one is absorbed as well.
_FILLED, _HOPEFUL, _INSIDE = 0.7, 0.8, 0.7
#: Square metres: a house in a row is at most as large as the first, and adjoins no building larger than the second.
_HOUSE, _HALL = 200.0, 500.0


@kernel
def absorb(window: Window, buildings: Buildings, count: int, i: int, trial: Buildings) -> tuple[float, int]:
    """Let building i absorb a smaller neighbour, and all that lies mostly in both, where that lowers the energy.

    What is absorbed is removed, the new rectangle and those that overlap it descend, and the result is kept if its
    energy is lower than before. Returns the gain and the number of buildings; `trial` is overwritten.
    """
    model, rectangles, energies = window.model, buildings.rectangles, buildings.energies
    joined = np.empty(5)
    size = rectangles[i, 2] * rectangles[i, 3]
    for j in range(count):
        other = rectangles[j, 2] * rectangles[j, 3]
        if j == i or other > size or not (other * model.cell**2 > _HOUSE or size * model.cell**2 > _HALL):
            continue
        if not near(rectangles[i], rectangles[j]):
            continue
        for axis in range(2):
            join_along(rectangles[i], rectangles[j], axis, joined)
            if size + other < _FILLED * joined[2] * joined[3] or not allowed(window, joined):
                continue
            alone = rectangle_energy(window.tables, joined, model)
            if alone > _HOPEFUL * (energies[i] + energies[j]):
                continue
            gain, many = _try(window, buildings, count, (i, j), joined, alone, trial)
            if gain > LEAST_GAIN:
                rectangles[:many], energies[:many] = trial.rectangles[:many], trial.energies[:many]
                buildings.fresh[:many] = trial.fresh[:many]
                return gain, many
    return 0.0, count


@kernel
def _try(
    window: Window,
    buildings: Buildings,
    count: int,
    pair: tuple[int, int],
    joined: Rectangles,
    alone: float,
    trial: Buildings,
) -> tuple[float, int]:
    """Fill the state after a pair was replaced by the joined rectangle; return the gain and the number of buildings."""
    model = window.model
    trial.rectangles[:count], trial.energies[:count] = buildings.rectangles[:count], buildings.energies[:count]
    trial.fresh[:count] = buildings.fresh[:count]
    many, gain = count, 0.0
    # From the last to the first, so that the numbers of those still to come stay valid.
    for k in range(count - 1, -1, -1):
        rectangle = buildings.rectangles[k]
        inside = k in pair
        if not inside:
            shared = overlaps(buildings.rectangles[k : k + 1], 1, joined, -1, -1)
            inside = shared > _INSIDE * rectangle[2] * rectangle[3]
        if inside:
            shared = shared_area(window, trial.rectangles, many, trial.rectangles[k], k, -1)
            gain += trial.energies[k] + model.overlap * shared
            many -= 1
            trial.rectangles[k], trial.energies[k] = trial.rectangles[many], trial.energies[many]
            trial.fresh[k] = trial.fresh[many]
    gain -= alone + model.overlap * shared_area(window, trial.rectangles, many, joined, -1, -1)
    trial.rectangles[many], trial.energies[many], trial.fresh[many] = joined, alone, True
    many += 1
    gain += descend(window, trial, many, many - 1)
    for k in range(many - 1):
        if overlaps(trial.rectangles[k : k + 1], 1, trial.rectangles[many - 1], -1, -1) > 0.0:
            gain += descend(window, trial, many, k)
            trial.fresh[k] = True
    return gain, many
