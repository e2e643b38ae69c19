"""Windows: the part of a scene whose buildings are changed at a time.

Nouns
-----
window
    Rectangle of the grid in which the centres of the buildings lie that may change. Buildings centred outside are
    *fixed*: what they share with others costs energy, but they do not change.
"""

from __future__ import annotations

from typing import NamedTuple

from ...core.kernels import kernel
from .arrays import Floats, Rectangles
from .energy import Model, configuration_energy, overlaps
from .tables import Tables

__all__ = ["Window", "allowed", "shared_area", "window_energy"]


class Window(NamedTuple):
    """What the chain and the local search read of a window.

    Attributes
    ----------
    tables : Tables
    model : Model
    edges : ndarray, shape (4,)
        x0, y0, x1, y1 in cells: where centres may lie.
    fixed : ndarray, shape (m, 5)
    """

    tables: Tables
    model: Model
    edges: Floats
    fixed: Rectangles


@kernel
def allowed(window: Window, rectangle: Rectangles) -> bool:
    """Return whether the centre of a rectangle lies in the window and its sides in their range."""
    edges, model = window.edges, window.model
    return bool(
        edges[0] <= rectangle[0] < edges[2]
        and edges[1] <= rectangle[1] < edges[3]
        and model.least_side <= rectangle[2] <= model.largest_side
        and model.least_side <= rectangle[3] <= model.largest_side
    )


@kernel
def shared_area(
    window: Window, rectangles: Rectangles, count: int, rectangle: Rectangles, skip: int, other: int
) -> float:
    """Return the area, cells squared, that a rectangle shares with the first `count` and with the fixed ones.

    The rectangles with the numbers `skip` and `other` are passed over.
    """
    area = overlaps(rectangles, count, rectangle, skip, other)
    return float(area + overlaps(window.fixed, len(window.fixed), rectangle, -1, -1))


@kernel
def window_energy(window: Window, rectangles: Rectangles) -> float:
    """Return the energy of all buildings of a window, from scratch."""
    return float(configuration_energy(window.tables, rectangles, len(rectangles), window.fixed, window.model))
