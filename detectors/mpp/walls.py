"""Party walls: neighbours that the cells leave a sliver apart, or a sliver over each other, are made to touch.

The energy is the same wherever an edge lies between two rows of cell centres, so neighbours end up to a cell apart.
Each edge is moved, by at most a little more than a cell, to where it meets the neighbour: out until contact, or back
until there is no common area. Edges that meet nobody stay. The move must not raise the building's own energy by more
than a tolerance.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .energy import energy_below, overlaps, own_energy

__all__ = ["close_walls"]

#: An edge moves by at most this many cells, in steps of an eighth, then by bisection.
_REACH, _STEPS, _HALVINGS = 1.25, 10, 8
#: Common area, cells squared, that counts as contact.
_CONTACT = 1e-3


@njit(cache=True, nogil=True)
def _moved(rectangle, edge, by, new):  # type: ignore[no-untyped-def]
    """Fill the rectangle with one edge (0, 1: ends of u; 2, 3: ends of v) moved outwards by some cells."""
    new[:] = rectangle
    axis, end = edge // 2, 1.0 if edge % 2 == 0 else -1.0
    cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
    new[2 + axis] += by
    shift = 0.5 * end * by
    new[0] += shift * (cos if axis == 0 else -sin)
    new[1] += shift * (sin if axis == 0 else cos)


@njit(cache=True, nogil=True)
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
    count = len(rectangles)
    for i in range(count):
        for edge in range(4):
            if overlaps(rectangles, count, rectangles[i], i, -1) > _CONTACT:
                _back(small, large, model, rectangles, i, edge, tolerance, new)
        for edge in range(4):
            _out(small, large, model, rectangles, i, edge, tolerance, new)


@njit(cache=True, nogil=True)
def _back(small, large, model, rectangles, i, edge, tolerance, new):  # type: ignore[no-untyped-def]
    """Move an edge back where that takes away most of the common area within reach."""
    count = len(rectangles)
    shared = overlaps(rectangles, count, rectangles[i], i, -1)
    _moved(rectangles[i], edge, -_REACH, new)
    if new[2 + edge // 2] < model.least_side or overlaps(rectangles, count, new, i, -1) > 0.5 * shared:
        return
    least = overlaps(rectangles, count, new, i, -1) + _CONTACT
    near, far = 0.0, _REACH
    for _ in range(_HALVINGS + 3):
        middle = 0.5 * (near + far)
        _moved(rectangles[i], edge, -middle, new)
        if overlaps(rectangles, count, new, i, -1) > least:
            near = middle
        else:
            far = middle
    _moved(rectangles[i], edge, -far, new)
    limit = own_energy(small, large, rectangles[i], model) + tolerance
    if energy_below(small, large, new, model, limit) < limit:
        rectangles[i] = new


@njit(cache=True, nogil=True)
def _out(small, large, model, rectangles, i, edge, tolerance, new):  # type: ignore[no-untyped-def]
    """Move an edge out to the first contact within reach."""
    count = len(rectangles)
    base = overlaps(rectangles, count, rectangles[i], i, -1)
    _moved(rectangles[i], edge, _REACH, new)
    if new[2 + edge // 2] > model.largest_side or overlaps(rectangles, count, new, i, -1) <= base + _CONTACT:
        return
    near, far = 0.0, _REACH
    for step in range(1, _STEPS + 1):
        by = _REACH * step / _STEPS
        _moved(rectangles[i], edge, by, new)
        if overlaps(rectangles, count, new, i, -1) > base + _CONTACT:
            far = by
            break
        near = by
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        _moved(rectangles[i], edge, middle, new)
        if overlaps(rectangles, count, new, i, -1) > base + _CONTACT:
            far = middle
        else:
            near = middle
    _moved(rectangles[i], edge, near, new)
    limit = own_energy(small, large, rectangles[i], model) + tolerance
    if energy_below(small, large, new, model, limit) < limit:
        rectangles[i] = new
