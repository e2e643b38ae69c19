"""One window from the data to its best configuration: greedy start, annealed chain, polish.

The chain starts from boxes put down greedily (or from nothing), is heated and cooled, and is polished; so is the start
itself, and the better of the two is kept. The result is therefore never worse than the polished start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .births import make_births
from .energy import Model, configuration_energy
from .polish import polish
from .sampler import TRACE_COLUMNS, run_chain
from .tables import Tables

__all__ = ["Annealed", "Schedule", "anneal", "capacity_of"]

_Rectangles = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """How the chain is run.

    Attributes
    ----------
    proposals : int
        Of one window.
    hot, cold : float
        First and last temperature.
    intensity : float
        Expected buildings per square cell under the prior.
    jump_share, split_share : float
        Shares of births with deaths, and of splits with merges, among the moves.
    data_share : float
        Share of births from boxes.
    merge_reach : float
        Distance of centres within which two buildings may merge, cells.
    greedy : bool
        Whether it starts from boxes.
    rows : int
        Rows of the trace.
    sweeps : int
        Sweeps of a polish, at most.
    """

    proposals: int
    hot: float
    cold: float
    intensity: float
    jump_share: float
    split_share: float
    data_share: float
    merge_reach: float
    greedy: bool
    rows: int = 100
    sweeps: int = 6


@dataclass(frozen=True, eq=False)
class Annealed:
    """What came of one window.

    Attributes
    ----------
    rectangles : ndarray, shape (n, 5)
    trace : ndarray, shape (rows, TRACE_COLUMNS)
    start, chain, final : float
        Energy of the start, of the chain's best state, and of the result.
    """

    rectangles: _Rectangles
    trace: NDArray[np.float64]
    start: float
    chain: float
    final: float


def capacity_of(boxes: int, own: int) -> int:
    """Return how many buildings a window may hold: room for all boxes and for those that are there."""
    return 64 + 2 * own + min(boxes, 4000)


def anneal(
    tables: Tables,
    model: Model,
    window: tuple[float, float, float, float],
    boxes: _Rectangles,
    weights: NDArray[np.float64],
    energies: NDArray[np.float64],
    own: _Rectangles,
    fixed: _Rectangles,
    state: NDArray[np.uint64],
    schedule: Schedule,
) -> Annealed:
    """Run one window.

    Parameters
    ----------
    tables : Tables
    model : Model
    window : tuple of float
        Where centres may lie, cells.
    boxes : ndarray, shape (n, 5)
        Centred in the window, best first.
    weights, energies : ndarray, shape (n,)
        Of their birth kernels, and of the boxes by themselves.
    own, fixed : ndarray, shape (k, 5), (m, 5)
        Start, and buildings of other windows.
    state : ndarray of uint64
        Random stream.
    schedule : Schedule
    """
    small, large = tables.small, tables.large
    edges = np.array(window, dtype=np.float64)
    capacity = capacity_of(len(boxes), len(own))

    def energy(rectangles: _Rectangles) -> float:
        return float(configuration_energy(small, large, rectangles, len(rectangles), fixed, model))

    def polished(rectangles: _Rectangles) -> _Rectangles:
        best, _ = polish(small, large, model, edges, rectangles, fixed, boxes, energies, capacity, schedule.sweeps)
        return best  # type: ignore[no-any-return]

    first = polished(own) if schedule.greedy else own
    births = make_births(window, (model.least_side, model.largest_side), boxes, weights, schedule.data_share)
    stride = max(schedule.proposals // schedule.rows, 1)
    chain, _, trace, chain_energy = run_chain(
        small,
        large,
        model,
        births,
        first,
        fixed,
        state,
        schedule.proposals,
        schedule.hot,
        schedule.cold,
        schedule.intensity,
        schedule.jump_share,
        schedule.split_share,
        schedule.merge_reach,
        capacity,
        stride,
    )
    assert trace.shape[1] == TRACE_COLUMNS
    start = energy(first)
    ends = [polished(chain)]
    if chain_energy >= start - 1e-9 and schedule.greedy:
        ends.append(first)
    finals = [energy(end) for end in ends]
    best = int(np.argmin(finals))
    return Annealed(ends[best], trace, start, float(chain_energy), finals[best])
