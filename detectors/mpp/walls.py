"""Party walls: neighbours that the cells leave a sliver apart, or a sliver over each other, are made to touch.

The energy is the same wherever an edge lies between two rows of cell centres, so neighbours end up to a cell apart.
Each edge is moved, by at most a little more than a cell, to where it meets the neighbour: out until contact, or back
until there is no common area. Edges that meet nobody stay. The move must not raise the building's own energy by more
than a tolerance.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.kernels import kernel
from .energy import energy_below, overlaps, own_energy

__all__ = ["close_walls"]

#: An edge moves by at most this many cells, in steps of an eighth, then by bisection.
_REACH, _STEPS, _HALVINGS = 1.25, 10, 8
#: Common area, cells squared, that counts as contact.
_CONTACT = 1e-3


@kernel
def _moved(rectangle, edge, by, new):  # type: ignore[no-untyped-def]
    """Fill the rectangle with one edge (0, 1: ends of u; 2, 3: ends of v) moved outwards by some cells."""
    new[:] = rectangle
    axis, end = edge // 2, 1.0 if edge % 2 == 0 else -1.0
    cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
    new[2 + axis] += by
    shift = 0.5 * end * by
    new[0] += shift * (cos if axis == 0 else -sin)
    new[1] += shift * (sin if axis == 0 else cos)


@kernel
def close_walls(small, large, model, rectangles, tolerance):  # type: ignore[no-untyped-def]
    """Move the edges of rectangles, shape (n, 5), in place, one building after the other.

    Parameters
    ----------
    small, large : tables
    model : Model
    rectangles : ndarray, shape (n, 5)
    tolerance : float
        How much the energy of a building by itself may rise with one edge.
    """
    new = np.empty(5)
    others = np.empty_like(rectangles)
    for i in range(len(rectangles)):
        count = _neighbours(rectangles, i, others)
        for edge in range(4):
            if overlaps(others, count, rectangles[i], -1, -1) > _CONTACT:
                _back(small, large, model, rectangles, i, others[:count], edge, tolerance, new)
        for edge in range(4):
            _out(small, large, model, rectangles, i, others[:count], edge, tolerance, new)


@kernel
def _neighbours(rectangles, i, others):  # type: ignore[no-untyped-def]
    """Fill `others` with the buildings that building i can meet when its edges move; return their number."""
    count = 0
    reach = 0.5 * math.hypot(rectangles[i, 2], rectangles[i, 3]) + 4.0 * _REACH
    for j in range(len(rectangles)):
        dx, dy = rectangles[j, 0] - rectangles[i, 0], rectangles[j, 1] - rectangles[i, 1]
        far = reach + 0.5 * (rectangles[j, 2] + rectangles[j, 3])
        if j != i and dx * dx + dy * dy < far * far:
            others[count] = rectangles[j]
            count += 1
    return count


@kernel
def _back(small, large, model, rectangles, i, others, edge, tolerance, new):  # type: ignore[no-untyped-def]
    """Move an edge back where that takes away most of the common area within reach."""
    shared = overlaps(others, len(others), rectangles[i], -1, -1)
    _moved(rectangles[i], edge, -_REACH, new)
    if new[2 + edge // 2] < model.least_side or overlaps(others, len(others), new, -1, -1) > 0.5 * shared:
        return
    least = overlaps(others, len(others), new, -1, -1) + _CONTACT
    near, far = 0.0, _REACH
    for _ in range(_HALVINGS + 3):
        middle = 0.5 * (near + far)
        _moved(rectangles[i], edge, -middle, new)
        if overlaps(others, len(others), new, -1, -1) > least:
            near = middle
        else:
            far = middle
    _moved(rectangles[i], edge, -far, new)
    limit = own_energy(small, large, rectangles[i], model) + tolerance
    if energy_below(small, large, new, model, limit) < limit:
        rectangles[i] = new


@kernel
def _out(small, large, model, rectangles, i, others, edge, tolerance, new):  # type: ignore[no-untyped-def]
    """Move an edge out to the first contact within reach."""
    base = overlaps(others, len(others), rectangles[i], -1, -1)
    _moved(rectangles[i], edge, _REACH, new)
    if new[2 + edge // 2] > model.largest_side or overlaps(others, len(others), new, -1, -1) <= base + _CONTACT:
        return
    near, far = 0.0, _REACH
    for step in range(1, _STEPS + 1):
        by = _REACH * step / _STEPS
        _moved(rectangles[i], edge, by, new)
        if overlaps(others, len(others), new, -1, -1) > base + _CONTACT:
            far = by
            break
        near = by
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        _moved(rectangles[i], edge, middle, new)
        if overlaps(others, len(others), new, -1, -1) > base + _CONTACT:
            far = middle
        else:
            near = middle
    _moved(rectangles[i], edge, near, new)
    limit = own_energy(small, large, rectangles[i], model) + tolerance
    if energy_below(small, large, new, model, limit) < limit:
        rectangles[i] = new
