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

__all__ = ["Annealed", "Boxes", "Schedule", "anneal", "search"]

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
        Whether the chain starts from boxes.
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


def search(window: Window, start: Rectangles, boxes: Boxes, *, capacity: int, sweeps: int) -> Rectangles:
    """Return what a local search makes of a state."""
    best: Rectangles
    best, _ = local_search(window, start, boxes.rectangles, boxes.energies, capacity, sweeps)
    return best


def anneal(window: Window, boxes: Boxes, own: Rectangles, schedule: Schedule, state: RandomState) -> Annealed:
    """Process one window.

    Parameters
    ----------
    window : Window
    boxes : Boxes
        Centred in the window.
    own : ndarray, shape (k, 5)
        Buildings to start from.
    schedule : Schedule
    state : ndarray of uint64
        Random stream.
    """
    capacity = _ROOM + 2 * len(own) + min(len(boxes), _MOST_BOXES)

    def searched(rectangles: Rectangles) -> Rectangles:
        return search(window, rectangles, boxes, capacity=capacity, sweeps=schedule.sweeps)

    first = searched(own) if schedule.greedy else own
    births = make_births(window, boxes.rectangles, boxes.weights, schedule.data_share)
    chain, _, trace, chain_energy = run_chain(window, births, first, schedule.chain, capacity, state)
    start = float(window_energy(window, first))
    ends = [searched(chain)]
    if chain_energy >= start - 1e-9 and schedule.greedy:
        ends.append(first)
    finals = [float(window_energy(window, end)) for end in ends]
    best = int(np.argmin(finals))
    return Annealed(ends[best], trace, start, float(chain_energy), finals[best])
