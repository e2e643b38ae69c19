"""Party walls: slivers between neighbours, of gap or of overlap, are closed.

The energy is the same wherever an edge lies between two rows of cell centres, so neighbours end up to a cell apart.
Each edge is moved, by at most a little more than a cell, to where it meets the neighbour: out until contact, or back
until there is no common area. Edges that meet no neighbour stay. The move must not raise the energy of the building by
itself by more than a tolerance.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.kernels import kernel
from .arrays import Rectangles
from .energy import Model, energy_below, overlaps, rectangle_energy
from .reshaping import move_edge
from .tables import Tables
from .windows import Window

__all__ = ["close_walls"]

#: An edge moves by at most this many cells, in steps of an eighth, then by bisection.
_REACH, _STEPS, _HALVINGS = 1.25, 10, 8
#: Common area, cells squared, that counts as contact.
_CONTACT = 1e-3


@kernel
def close_walls(tables: Tables, model: Model, rectangles: Rectangles, tolerance: float) -> None:
    """Move the edges of rectangles, shape (n, 5), in place, one building after the other.

    Parameters
    ----------
    tables : Tables
    model : Model
    rectangles : ndarray, shape (n, 5)
    tolerance : float
        How much the energy of a building by itself may rise with one edge.
    """
    others = np.empty_like(rectangles)
    for i in range(len(rectangles)):
        count = _neighbours(rectangles, i, others)
        # The neighbours do not move while this building does.
        window = Window(tables, model, np.empty(4), others[:count])
        for edge in range(4):
            if _common(window, rectangles[i]) > _CONTACT:
                _move_back(window, rectangles[i], edge, tolerance)
        for edge in range(4):
            _move_out(window, rectangles[i], edge, tolerance)


@kernel
def _common(window: Window, rectangle: Rectangles) -> float:
    """Return the area that a rectangle shares with its neighbours."""
    return float(overlaps(window.fixed, len(window.fixed), rectangle, -1, -1))


@kernel
def _accept(window: Window, rectangle: Rectangles, new: Rectangles, tolerance: float) -> None:
    """Replace a rectangle, in place, where its energy does not rise by more than the tolerance."""
    limit = rectangle_energy(window.tables, rectangle, window.model) + tolerance
    if energy_below(window.tables, new, window.model, limit) < limit:
        rectangle[:] = new


@kernel
def _neighbours(rectangles: Rectangles, i: int, others: Rectangles) -> int:
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
def _move_back(window: Window, rectangle: Rectangles, edge: int, tolerance: float) -> None:
    """Move an edge back, in place, where that takes away most of the common area within reach."""
    new = np.empty(5)
    shared = _common(window, rectangle)
    move_edge(rectangle, edge, -_REACH, new)
    if new[2 + edge // 2] < window.model.least_side or _common(window, new) > 0.5 * shared:
        return
    least = _common(window, new) + _CONTACT
    near, far = 0.0, _REACH
    for _ in range(_HALVINGS + 3):
        middle = 0.5 * (near + far)
        move_edge(rectangle, edge, -middle, new)
        if _common(window, new) > least:
            near = middle
        else:
            far = middle
    move_edge(rectangle, edge, -far, new)
    _accept(window, rectangle, new, tolerance)


@kernel
def _move_out(window: Window, rectangle: Rectangles, edge: int, tolerance: float) -> None:
    """Move an edge out, in place, to the first contact within reach."""
    new = np.empty(5)
    base = _common(window, rectangle)
    move_edge(rectangle, edge, _REACH, new)
    if new[2 + edge // 2] > window.model.largest_side or _common(window, new) <= base + _CONTACT:
        return
    near, far = 0.0, _REACH
    for step in range(1, _STEPS + 1):
        by = _REACH * step / _STEPS
        move_edge(rectangle, edge, by, new)
        if _common(window, new) > base + _CONTACT:
            far = by
            break
        near = by
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        move_edge(rectangle, edge, middle, new)
        if _common(window, new) > base + _CONTACT:
            far = middle
        else:
            near = middle
    move_edge(rectangle, edge, near, new)
    _accept(window, rectangle, new, tolerance)
