"""One window from the data to its best configuration: greedy start, annealed chain, local search.

The chain starts from boxes that are placed greedily (or from nothing), is heated and cooled, and is followed by a local
search; so is the start itself, and the better of the two is kept. The result is therefore never worse than the start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .arrays import Floats, Mask, RandomState, Rectangles
from .births import make_births
from .local_search import local_search
from .sampler import ChainSchedule, run_chain
from .windows import Window, window_energy

__all__ = ["Annealed", "Boxes", "Schedule", "anneal", "room_of", "search"]

#: Buildings that a window may hold besides its boxes and its present buildings.
_ROOM = 64
#: Boxes for which there is room, at most.
_MOST_BOXES = 4000


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes that the data suggest (`candidates`), best first.

    Attributes
    ----------
    rectangles : ndarray, shape (n, 5)
    weights : ndarray, shape (n,)
        Of the birth kernel of each box.
    energies : ndarray, shape (n,)
        Of each box by itself.
    """

    rectangles: Rectangles
    weights: Floats
    energies: Floats

    def __len__(self) -> int:
        return len(self.rectangles)

    def take(self, chosen: Mask) -> Boxes:
        """Return some of the boxes."""
        return Boxes(self.rectangles[chosen], self.weights[chosen], self.energies[chosen])


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """How a window is processed.

    Attributes
    ----------
    chain : ChainSchedule
    data_share : float
        Share of births from boxes.
    greedy : bool
        Whether the chain starts from boxes, and the start is the result where the chain does not improve it.
    sweeps : int
        Maximum number of local-search sweeps.
    """

    chain: ChainSchedule
    data_share: float
    greedy: bool
    sweeps: int


@dataclass(frozen=True, eq=False)
class Annealed:
    """The result of one window.

    Attributes
    ----------
    rectangles : ndarray, shape (n, 5)
    trace : ndarray, shape (rows, columns)
        See `sampler.Trace`.
    start, chain, final : float
        Energy of the start, of the chain's best state, and of the result.
    """

    rectangles: Rectangles
    trace: Floats
    start: float
    chain: float
    final: float


def room_of(boxes: Boxes, own: Rectangles) -> int:
    """Return how many buildings a window may hold."""
    return _ROOM + 2 * len(own) + min(len(boxes), _MOST_BOXES)


def search(window: Window, start: Rectangles, boxes: Boxes, *, capacity: int, sweeps: int) -> Rectangles:
    """Return what a local search makes of a state."""
    best: Rectangles
    best, _ = local_search(window, start, boxes.rectangles, boxes.energies, capacity, sweeps)
    return best


def anneal(window: Window, boxes: Boxes, first: Rectangles, schedule: Schedule, state: RandomState) -> Annealed:
    """Process one window.

    Parameters
    ----------
    window : Window
    boxes : Boxes
        Centred in the window.
    first : ndarray, shape (k, 5)
        Buildings to start from: what `search` made of the boxes, or none.
    schedule : Schedule
    state : ndarray of uint64
        Random stream.
    """
    capacity = room_of(boxes, first)
    births = make_births(window, boxes.rectangles, boxes.weights, schedule.data_share)
    chain, _, trace, chain_energy = run_chain(window, births, first, schedule.chain, capacity, state)
    start = float(window_energy(window, first))
    ends = [search(window, chain, boxes, capacity=capacity, sweeps=schedule.sweeps)]
    if chain_energy >= start - 1e-9 and schedule.greedy:
        ends.append(first)
    finals = [float(window_energy(window, end)) for end in ends]
    best = int(np.argmin(finals))
    return Annealed(ends[best], trace, start, float(chain_energy), finals[best])
