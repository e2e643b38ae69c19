"""The sampler of one window: an annealed reversible jump chain and the local search of its best state.

Runs with ``optimiser=rjmcmc`` alone. The chain starts from what the greedy search left (or from nothing), is heated and
cooled, and its best state is improved by the local search; where that does not lower the energy of the start, the start
is kept. The result is therefore never worse than the start.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .arrays import Floats, RandomState, Rectangles
from .births import make_births
from .candidates import Boxes
from .local_search import room_of, search
from .moves import Move
from .parameters import MPPParameters
from .sampler import ChainSchedule, Trace, run_chain
from .windows import Window, window_energy

__all__ = ["Annealed", "anneal", "join_traces", "schedule_of"]

#: First and last temperature of the chain.
_HOT, _COLD = 3.0, 0.1
#: Expected buildings per km2 before the data are seen (lambda).
_INTENSITY = 200.0
#: Share of births and deaths among the moves; share of births that the data propose.
_JUMP_SHARE, _DATA_BIRTHS = 0.3, 0.9
#: Proposals at effort 1, per square metre and per box.
_PER_AREA, _PER_BOX = 0.2, 60
#: Rows of a trace.
_ROWS = 100


@dataclass(frozen=True, eq=False)
class Annealed:
    """The result of one window.

    Attributes
    ----------
    rectangles : ndarray, shape (n, 5)
    trace : ndarray, shape (rows, columns)
        See `sampler.Trace`.
    """

    rectangles: Rectangles
    trace: Floats


def schedule_of(parameters: MPPParameters, window: Window, boxes: Boxes) -> ChainSchedule:
    """Return how a window is sampled: proposals by its area, and for each box."""
    x0, y0, x1, y1 = window.edges.tolist()
    cell = window.model.cell
    area = (x1 - x0) * (y1 - y0) * cell * cell
    proposals = max(int(parameters.effort * (_PER_AREA * area + _PER_BOX * len(boxes))), 1)
    return ChainSchedule(
        proposals=proposals,
        hot=_HOT,
        cold=_COLD,
        intensity=_INTENSITY * 1e-6 * cell * cell,
        jump_share=_JUMP_SHARE,
        stride=max(proposals // _ROWS, 1),
    )


def anneal(parameters: MPPParameters, window: Window, boxes: Boxes, first: Rectangles, state: RandomState) -> Annealed:
    """Sample one window.

    Parameters
    ----------
    parameters : MPPParameters
    window : Window
    boxes : Boxes
        Centred in the window.
    first : ndarray, shape (k, 5)
        Buildings to start from: what the greedy search made of the boxes, or none.
    state : ndarray of uint64
        Random stream.
    """
    capacity = room_of(boxes, first)
    weights = np.sqrt(np.maximum(-boxes.energies, 1.0))
    births = make_births(window, boxes.rectangles, weights, _DATA_BIRTHS)
    schedule = schedule_of(parameters, window, boxes)
    chain, _, trace, _ = run_chain(window, births, first, schedule, capacity, state)
    best = search(window, chain, boxes, capacity=capacity, sweeps=parameters.sweeps)
    worse = window_energy(window, best) >= window_energy(window, first)
    return Annealed(first if worse and parameters.start == "greedy" else best, trace)


def join_traces(results: Sequence[Annealed], rows: int = _ROWS) -> dict[str, Any]:
    """Add up the traces of all squares at equal shares of their schedules.

    Every square runs the same schedule on its own number of proposals, so that the temperature at a share is the same.
    """
    results = [result for result in results if len(result.trace)]
    if not results:
        return {}
    rows = min(rows, max(len(result.trace) for result in results))
    total = np.zeros((rows, Trace.COLUMNS))
    for result in results:
        trace = result.trace.copy()
        trace[:, Trace.TRIED :] = np.cumsum(trace[:, Trace.TRIED :], axis=0)
        total += trace[-(-np.arange(1, rows + 1) * len(trace) // rows) - 1]
    total[1:, Trace.TRIED :] -= total[:-1, Trace.TRIED :].copy()
    return {
        "proposals": total[:, Trace.PROPOSALS].tolist(),
        "temperature": (total[:, Trace.TEMPERATURE] / len(results)).tolist(),
        "energy": total[:, Trace.ENERGY].tolist(),
        "buildings": total[:, Trace.BUILDINGS].tolist(),
        "tried": {move.name.lower(): total[:, Trace.TRIED + move].tolist() for move in Move},
        "accepted": {move.name.lower(): total[:, Trace.ACCEPTED + move].tolist() for move in Move},
    }
