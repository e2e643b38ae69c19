"""Duplicates: rectangles of a building that is already in the result.

Two rectangles are *oblique* when they are neither parallel nor perpendicular. The parts of an L, T, U or C shaped
building adjoin at right angles, so their overlap is natural; that of oblique rectangles is not. The *new share* of a
rectangle is the share of its area outside all larger rectangles that are oblique to it. A *duplicate* has a new share
near zero, adding little more than its corners, or it and a larger rectangle at any angle are mostly the same area
(intersection over union). Parts of one building are never: they differ in size, or in place.

The 2010 paper (section 3.4) joins perpendicular parts, leaves open how natural and other overlaps are separated, and
drops an initial rectangle that lies completely inside a final one. A rectangle from a short jagged line crosses the
sides of the earlier rectangle and is never completely inside it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .adjustment import rotation_between
from .boxes import OX, OY, U0, U1, UX, UY, V0, V1, Boxes, box_centres, lengths, to_box, widths

__all__ = ["DuplicateRules", "find_duplicates"]

#: Lattice points along each side of a rectangle.
_LATTICE = 32


class DuplicateRules(NamedTuple):
    """When a rectangle is a duplicate.

    Attributes
    ----------
    least : float
        Smallest new share of a rectangle that is no duplicate.
    tolerance : float
        Largest angle between rectangles that count as parallel or perpendicular, radians.
    same : float
        Largest intersection over union of a rectangle and a larger one that are two; 1 or more: not tested.
    """

    least: float
    tolerance: float
    same: float = 1.0


@kernel
def new_share(box: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    """Return the share of a box's area outside all others, sampled on a lattice in its own coordinates."""
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


@kernel
def _find(
    boxes: NDArray[np.float64],
    order: NDArray[np.int64],
    directions: NDArray[np.float64],
    centres: NDArray[np.float64],
    radius: NDArray[np.float64],
    rules: DuplicateRules,
) -> NDArray[np.bool_]:
    duplicates = np.zeros(len(boxes), dtype=np.bool_)
    oblique = np.empty_like(boxes)
    for place in range(len(order)):
        i = order[place]
        area = (boxes[i, U1] - boxes[i, U0]) * (boxes[i, V1] - boxes[i, V0])
        found = 0
        for j in order[:place]:
            dx, dy, reach = centres[i, 0] - centres[j, 0], centres[i, 1] - centres[j, 1], radius[i] + radius[j]
            if duplicates[j] or dx * dx + dy * dy >= reach * reach:
                continue
            if rules.same < 1:
                larger = (boxes[j, U1] - boxes[j, U0]) * (boxes[j, V1] - boxes[j, V0])
                common = area * (1 - new_share(boxes[i], boxes[j : j + 1]))
                if common > rules.same * (area + larger - common):
                    duplicates[i] = True
                    break
            if abs(rotation_between(directions[i], directions[j])) > rules.tolerance:
                for k in range(8):
                    oblique[found, k] = boxes[j, k]
                found += 1
        if not duplicates[i]:
            duplicates[i] = found > 0 and new_share(boxes[i], oblique[:found]) < rules.least
    return duplicates


def find_duplicates(boxes: Boxes, rules: DuplicateRules) -> NDArray[np.bool_]:
    """Return which rectangles are duplicates of larger ones that are no duplicates themselves, shape (n,)."""
    largest_first = np.argsort(-lengths(boxes) * widths(boxes), kind="stable").astype(np.int64)
    directions = np.arctan2(boxes[:, UY], boxes[:, UX])
    radius = np.hypot(lengths(boxes), widths(boxes)) / 2
    duplicates: NDArray[np.bool_] = _find(boxes, largest_first, directions, box_centres(boxes), radius, rules)
    return duplicates
