"""Duplicates: final rectangles that see again what larger ones have seen.

The *new share* of a rectangle is the share of its area that lies in none of the larger rectangles that stay. A part of
an L, T, U or C shaped building overlaps the others too, a *natural overlap*, but reaches beyond them; a *duplicate*
adds hardly more than the corners by which it is turned or shifted.
The 2010 paper (section 3.4) finds it "hard to decide which overlap is unexpected and which is natural" and drops an
initial rectangle that is "completely within" a final one before it is extended. A rectangle that a short jagged line
made lies across the sides of the one before it, so it is never completely within; judging it against all larger ones
together, after extension, is a reading of ours.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from .boxes import OX, OY, U0, U1, UX, UY, V0, V1, Boxes, box_centres, lengths, to_box, widths

__all__ = ["find_duplicates"]

#: Points of the lattice that a rectangle is sampled on, along each side.
_LATTICE = 32


@njit(cache=True)
def new_share(box: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    """Return the share of a box's area that lies in none of the others, from a lattice in its own coordinates."""
    new = 0
    for i in range(_LATTICE):
        along = box[U0] + (i + 0.5) * (box[U1] - box[U0]) / _LATTICE
        for j in range(_LATTICE):
            across = box[V0] + (j + 0.5) * (box[V1] - box[V0]) / _LATTICE
            x = box[OX] + along * box[UX] - across * box[UY]
            y = box[OY] + along * box[UY] + across * box[UX]
            new += 1
            for k in range(len(others)):
                u, v = to_box(x, y, others[k])
                if others[k, U0] <= u <= others[k, U1] and others[k, V0] <= v <= others[k, V1]:
                    new -= 1
                    break
    return new / _LATTICE**2


def find_duplicates(boxes: Boxes, least: float) -> NDArray[np.bool_]:
    """Tell which rectangles are duplicates: largest first, those whose new share is below `least`, shape (n,)."""
    area = lengths(boxes) * widths(boxes)
    centres, radius = box_centres(boxes), np.hypot(lengths(boxes), widths(boxes)) / 2
    stays = np.zeros(len(boxes), dtype=np.bool_)
    for i in np.argsort(-area, kind="stable"):
        near = stays & (np.hypot(*(centres - centres[i]).T) < radius + radius[i])
        stays[i] = new_share(boxes[i], boxes[near]) >= least
    return ~stays
