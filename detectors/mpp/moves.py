"""The moves of the sampler: what is proposed, and the probability with which it is accepted.

The ratios are those of Green (1995) for the target exp(-U/T) relative to a Poisson process of rectangles with intensity
`density` per unit of (x, y, a, b, angle). Shift, edge, side and turn are symmetric walks. Splits and merges belong to
the local search alone: proposed by the chain they were practically never accepted (docs/results/mpp.md).
"""

from __future__ import annotations

import math
from enum import IntEnum

from ...core.kernels import kernel
from .arrays import RandomState, Rectangles
from .random_stream import gaussian, integer, uniform
from .reshaping import move_edge

__all__ = ["Move", "birth_log_ratio", "propose_change"]


class Move(IntEnum):
    """Kinds of moves."""

    BIRTH = 0
    DEATH = 1
    SHIFT = 2
    EDGE = 3
    SIDE = 4
    TURN = 5


#: Cells: the two scales of a walk. Small steps find the edge of a cell, large ones leave a wrong roof.
_SMALL_STEP, _LARGE_STEP = 0.7, 4.0
#: Radians that a turn has per cell of a walk.
_TURN_STEP = 0.03


@kernel
def birth_log_ratio(
    delta: float, temperature: float, density: float, count: int, q: float, log_birth: float, log_death: float
) -> float:
    """Return the log acceptance ratio of a birth into `count` buildings; that of the death back is its negative.

    Parameters
    ----------
    delta : float
        Energy after less before the birth.
    temperature, density : float
    count : int
        Number of buildings before the birth.
    q : float
        Density with which the birth proposes this rectangle.
    log_birth, log_death : float
        Logarithms of the probabilities of trying a birth and a death; a death picks one of count + 1.
    """
    return -delta / temperature + math.log(density / ((count + 1) * q)) + log_death - log_birth


@kernel
def propose_change(kind: int, old: Rectangles, new: Rectangles, state: RandomState) -> None:
    """Fill `new` by a symmetric walk from `old`; the kind is a shift, or a change of an edge, a side or the angle."""
    new[:] = old
    scale = _SMALL_STEP if uniform(state) < 0.5 else _LARGE_STEP
    if kind == Move.SHIFT:
        new[0] += scale * gaussian(state)
        new[1] += scale * gaussian(state)
    elif kind == Move.EDGE:
        step = scale * gaussian(state)
        move_edge(old, integer(state, 4), step, new)
    elif kind == Move.SIDE:
        new[2 + integer(state, 2)] += scale * gaussian(state)
    else:
        new[4] = (new[4] + _TURN_STEP * scale * gaussian(state)) % math.pi
