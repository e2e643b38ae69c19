"""Changes of rectangles: an edge moved, a part cut off, two joined. See `rectangles` for their frame."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel

__all__ = ["cut", "hull", "join_along", "move_edge"]

_Floats = NDArray[np.float64]


@kernel
def move_edge(rectangle: _Floats, edge: int, by: float, new: _Floats) -> None:
    """Fill `new` with a rectangle of which one edge lies further out.

    Parameters
    ----------
    rectangle, new : ndarray, shape (5,) or more
        Columns beyond the fifth are copied.
    edge : int
        0, 1: the ends along u; 2, 3: those along v; the even ones on the positive side.
    by : float
        Cells; negative moves it in.
    """
    new[:] = rectangle
    axis, end = edge // 2, 1.0 if edge % 2 == 0 else -1.0
    cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
    new[2 + axis] += by
    shift = 0.5 * end * by
    new[0] += shift * (cos if axis == 0 else -sin)
    new[1] += shift * (sin if axis == 0 else cos)


@kernel
def cut(rectangle: _Floats, axis: int, low: float, high: float, part: _Floats) -> None:
    """Fill the part of a rectangle between two positions along an axis, measured from its centre."""
    part[:] = rectangle
    cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
    middle = 0.5 * (low + high)
    part[0] += middle * (cos if axis == 0 else -sin)
    part[1] += middle * (sin if axis == 0 else cos)
    part[2 + axis] = high - low


@kernel
def _extents(first: _Floats, second: _Floats) -> tuple[float, float, float, float]:
    """Return the centre u, v of the second in the frame of the first, and half its extent along u and v."""
    cos, sin = math.cos(first[4]), math.sin(first[4])
    dx, dy = second[0] - first[0], second[1] - first[1]
    u, v = dx * cos + dy * sin, dy * cos - dx * sin
    turn = second[4] - first[4]
    cos_t, sin_t = abs(math.cos(turn)), abs(math.sin(turn))
    return u, v, 0.5 * (second[2] * cos_t + second[3] * sin_t), 0.5 * (second[2] * sin_t + second[3] * cos_t)


@kernel
def hull(first: _Floats, second: _Floats, merged: _Floats) -> None:
    """Fill the rectangle at the angle of the first that holds both."""
    u, v, half_u, half_v = _extents(first, second)
    cos, sin = math.cos(first[4]), math.sin(first[4])
    low_u, high_u = min(-0.5 * first[2], u - half_u), max(0.5 * first[2], u + half_u)
    low_v, high_v = min(-0.5 * first[3], v - half_v), max(0.5 * first[3], v + half_v)
    middle_u, middle_v = 0.5 * (low_u + high_u), 0.5 * (low_v + high_v)
    merged[0] = first[0] + middle_u * cos - middle_v * sin
    merged[1] = first[1] + middle_u * sin + middle_v * cos
    merged[2], merged[3], merged[4] = high_u - low_u, high_v - low_v, first[4]


@kernel
def join_along(first: _Floats, second: _Floats, axis: int, joined: _Floats) -> None:
    """Fill the rectangle at the angle of the first that reaches over both along an axis, and is as wide as both are.

    The edges across the axis are means of those of the two, weighted with their lengths: where parts of one roof are a
    cell out of line, their hull would contain a row of cells that belongs to neither.
    """
    hull(first, second, joined)
    u, v, half_u, half_v = _extents(first, second)
    across, half_length, half_width = (v, half_u, half_v) if axis == 0 else (u, half_v, half_u)
    share = 2.0 * half_length / (2.0 * half_length + first[2 + axis])
    low = (1.0 - share) * -0.5 * first[3 - axis] + share * (across - half_width)
    high = (1.0 - share) * 0.5 * first[3 - axis] + share * (across + half_width)
    cos, sin = math.cos(first[4]), math.sin(first[4])
    dx, dy = joined[0] - first[0], joined[1] - first[1]
    u, v = dx * cos + dy * sin, dy * cos - dx * sin
    middle = 0.5 * (low + high)
    u, v = (u, middle) if axis == 0 else (middle, v)
    joined[0], joined[1] = first[0] + u * cos - v * sin, first[1] + u * sin + v * cos
    joined[3 - axis] = high - low
