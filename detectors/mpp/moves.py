"""The moves of the sampler: what is proposed, and the probability with which it is accepted.

All ratios are those of Green (1995) for the target exp(-U/T) relative to a Poisson process of rectangles with intensity
`density` per unit of (x, y, a, b, angle). Shift, edge, side and turn are symmetric walks. Split and merge are each
other's reverse; five auxiliary numbers make the map from one rectangle to two one to one:

    m   where the wall stands along the split direction      g   gap between the parts
    p, q  half the offset of the two lower, two upper edges   phi half the turn between them

Edges of the parts in the frame of the parent: (e1, m - g/2, f1 + p, f2 + q) and (m + g/2, e2, f1 - p, f2 - q), angles
theta + phi and theta - phi. The Jacobian is 1 (m, g) x 2 (f1, p) x 2 (f2, q) x 2 (theta, phi) = 8; turning and shifting
the frame has determinant 1.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

from ...core.kernels import kernel
from .arrays import RandomState, Rectangles
from .random_stream import gaussian, integer, uniform
from .reshaping import move_edge

__all__ = [
    "GAP",
    "OFFSET",
    "SKEW",
    "Auxiliary",
    "Move",
    "birth_log_ratio",
    "draw_auxiliary",
    "merge_rectangles",
    "propose_change",
    "split_log_ratio",
    "split_rectangle",
]


class Move(IntEnum):
    """Kinds of moves."""

    BIRTH = 0
    DEATH = 1
    SHIFT = 2
    EDGE = 3
    SIDE = 4
    TURN = 5
    SPLIT = 6
    MERGE = 7


#: Half widths of the auxiliary numbers: gap and offsets in cells, turn in radians.
GAP, OFFSET, SKEW = 2.0, 4.0, 0.08
#: Cells: the two scales of a walk. Small steps find the edge of a cell, large ones leave a wrong roof.
_SMALL_STEP, _LARGE_STEP = 0.7, 4.0
#: Radians that a turn has per cell of a walk.
_TURN_STEP = 0.03


class Auxiliary(NamedTuple):
    """The five numbers that turn one rectangle into two; see the module."""

    m: float
    g: float
    p: float
    q: float
    phi: float


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


@kernel
def draw_auxiliary(side: float, state: RandomState) -> Auxiliary:
    """Draw the numbers of a split of a parent with this side along the split axis."""
    m = side * (uniform(state) - 0.5)
    g = GAP * (2.0 * uniform(state) - 1.0)
    p = OFFSET * (2.0 * uniform(state) - 1.0)
    q = OFFSET * (2.0 * uniform(state) - 1.0)
    phi = SKEW * (2.0 * uniform(state) - 1.0)
    return Auxiliary(m, g, p, q, phi)


@kernel
def split_rectangle(parent: Rectangles, axis: int, auxiliary: Auxiliary, first: Rectangles, second: Rectangles) -> None:
    """Fill the two parts of a parent split along `axis` (0: along u, 1: along v); m is measured from its centre."""
    m, g, p, q, phi = auxiliary
    e, f = 0.5 * parent[2 + axis], 0.5 * parent[3 - axis]
    cos, sin = math.cos(parent[4]), math.sin(parent[4])
    for part in range(2):
        child = first if part == 0 else second
        sign = 1.0 if part == 0 else -1.0
        low = -e if part == 0 else m + 0.5 * g
        high = m - 0.5 * g if part == 0 else e
        left, right = -f + sign * p, f + sign * q
        along, across = 0.5 * (low + high), 0.5 * (left + right)
        du = along if axis == 0 else across
        dv = across if axis == 0 else along
        child[0] = parent[0] + du * cos - dv * sin
        child[1] = parent[1] + du * sin + dv * cos
        child[2 + axis], child[3 - axis] = high - low, right - left
        child[4] = (parent[4] + sign * phi) % math.pi


@kernel
def merge_rectangles(first: Rectangles, second: Rectangles, axis: int, parent: Rectangles) -> tuple[bool, Auxiliary]:
    """Fill the parent whose split along `axis` gives the two; return whether there is one, and the split's numbers."""
    none = Auxiliary(0.0, 0.0, 0.0, 0.0, 0.0)
    turn = (first[4] - second[4] + 0.5 * math.pi) % math.pi - 0.5 * math.pi
    if abs(turn) > 2.0 * SKEW:
        return False, none
    theta = second[4] + 0.5 * turn
    cos, sin = math.cos(theta), math.sin(theta)
    dx, dy = second[0] - first[0], second[1] - first[1]
    along, across = dx * cos + dy * sin, dy * cos - dx * sin
    if axis == 1:
        along, across = across, along
    lower, upper, phi = first, second, 0.5 * turn
    if along < 0.0:
        lower, upper, phi, along, across = second, first, -phi, -along, -across
    # Edges with the lower part's centre as origin.
    e1, middle = -0.5 * lower[2 + axis], 0.5 * lower[2 + axis]
    begin, e2 = along - 0.5 * upper[2 + axis], along + 0.5 * upper[2 + axis]
    low, high = 0.5 * lower[3 - axis], 0.5 * upper[3 - axis]
    g = begin - middle
    p = 0.5 * (-low - (across - high))
    q = 0.5 * (low - (across + high))
    if abs(g) > GAP or abs(p) > OFFSET or abs(q) > OFFSET:
        return False, none
    f1, f2 = -low - p, low - q
    centre_e, centre_f = 0.5 * (e1 + e2), 0.5 * (f1 + f2)
    du = centre_e if axis == 0 else centre_f
    dv = centre_f if axis == 0 else centre_e
    parent[0] = lower[0] + du * cos - dv * sin
    parent[1] = lower[1] + du * sin + dv * cos
    parent[2 + axis], parent[3 - axis] = e2 - e1, f2 - f1
    parent[4] = theta % math.pi
    auxiliary = Auxiliary(0.5 * (middle + begin) - centre_e, g, p, q, phi)
    return bool(parent[2] > 0.0 and parent[3] > 0.0), auxiliary


@kernel
def split_log_ratio(
    delta: float, temperature: float, density: float, count: int, side: float, near_first: int, near_second: int
) -> float:
    """Return the log acceptance ratio of a split, both moves tried equally often; of the merge back its negative.

    Parameters
    ----------
    delta : float
        Energy after less before the split.
    temperature, density : float
    count : int
        Number of buildings before the split.
    side : float
        Range of m: the parent's side along the split axis.
    near_first, near_second : int
        How many buildings each part may choose to merge with, after the split.
    """
    pick_split = 1.0 / (count * side * 2.0 * GAP * 4.0 * OFFSET * OFFSET * 2.0 * SKEW)
    pick_merge = (1.0 / near_first + 1.0 / near_second) / (count + 1)
    return -delta / temperature + math.log(8.0 * density * pick_merge / pick_split)
