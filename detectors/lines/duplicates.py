"""Duplicates: rectangles of a building that is already in the result.

Two rectangles are *oblique* when they are neither parallel nor perpendicular. The parts of an L, T, U or C shaped
building adjoin at right angles, so their overlap is natural; that of oblique rectangles is not. The *new share* of a
rectangle is the share of its area outside all larger rectangles that are oblique to it. A *duplicate* has a new share
near zero, adding little more than its corners, or it and a larger rectangle at any angle are mostly the same area
(intersection over union), or what it adds to the larger ones at any angle is narrower than a part of a building
(*new width*). Parts of one building are never: they differ in size, or in place.

The 2010 paper (section 3.4) joins perpendicular parts, leaves open how natural and other overlaps are separated, and
drops an initial rectangle that lies completely inside a final one. A rectangle from a short jagged line crosses the
sides of the earlier rectangle and is never completely inside it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .adjustment import rotation_between
from .boxes import U0, U1, UX, UY, V0, V1, Boxes, box_centres, from_box, lengths, to_box, widths

__all__ = ["DuplicateRules", "find_duplicates"]

#: Lattice points along each side of a rectangle.
_LATTICE = 32
#: Lattice points across a new width, and the most along a side of a rectangle.
_FINE, _MOST = 7.5, 256


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
    width : float
        Least width of what a rectangle adds to all larger ones, pixels; 0: not tested.
    """

    least: float
    tolerance: float
    same: float = 1.0
    width: float = 0.0


@kernel
def new_share(box: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    """Return the share of a box's area outside all others, sampled on a lattice in its own coordinates."""
    new = 0
    for i in range(_LATTICE):
        along = box[U0] + (i + 0.5) * (box[U1] - box[U0]) / _LATTICE
        for j in range(_LATTICE):
            across = box[V0] + (j + 0.5) * (box[V1] - box[V0]) / _LATTICE
            x, y = from_box(along, across, box)
            new += 1
            for k in range(len(others)):
                u, v = to_box(x, y, others[k])
                if others[k, U0] <= u <= others[k, U1] and others[k, V0] <= v <= others[k, V1]:
                    new -= 1
                    break
    return new / _LATTICE**2


@kernel
def adds_width(box: NDArray[np.float64], others: NDArray[np.float64], width: float) -> bool:
    """Return whether a square parallel to a box, `width` wide, fits into the part of the box outside all others.

    The part is sampled on a lattice in the coordinates of the box, so that widths are known to an eighth. A box that is
    narrower than `width` needs its own width only.
    """
    length, depth = box[U1] - box[U0], box[V1] - box[V0]
    rows = min(_MOST, math.ceil(_FINE * length / width))
    columns = min(_MOST, math.ceil(_FINE * depth / width))
    # A strip that is n - 1/2 steps wide contains n or n - 1 rows of the lattice, equally often.
    down, across = round(width * rows / length + 0.5), round(width * columns / depth + 0.5)
    down, across = min(rows, down), min(columns, across)
    run = np.zeros(columns, dtype=np.int64)
    for i in range(rows):
        along = box[U0] + (i + 0.5) * length / rows
        beside = 0
        for j in range(columns):
            side = box[V0] + (j + 0.5) * depth / columns
            x, y = from_box(along, side, box)
            run[j] += 1
            for k in range(len(others)):
                u, v = to_box(x, y, others[k])
                if others[k, U0] <= u <= others[k, U1] and others[k, V0] <= v <= others[k, V1]:
                    run[j] = 0
                    break
            beside = beside + 1 if run[j] >= down else 0
            if beside >= across:
                return True
    return False


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
    oblique, overlapping = np.empty_like(boxes), np.empty_like(boxes)
    for place in range(len(order)):
        i = order[place]
        area = (boxes[i, U1] - boxes[i, U0]) * (boxes[i, V1] - boxes[i, V0])
        found, near = 0, 0
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
            for k in range(8):
                overlapping[near, k] = boxes[j, k]
            near += 1
            if abs(rotation_between(directions[i], directions[j])) > rules.tolerance:
                for k in range(8):
                    oblique[found, k] = boxes[j, k]
                found += 1
        if not duplicates[i]:
            duplicates[i] = found > 0 and new_share(boxes[i], oblique[:found]) < rules.least
        if not duplicates[i] and near > 0 and rules.width > 0:
            duplicates[i] = not adds_width(boxes[i], overlapping[:near], rules.width)
    return duplicates


def find_duplicates(boxes: Boxes, rules: DuplicateRules) -> NDArray[np.bool_]:
    """Return which rectangles are duplicates of larger ones that are no duplicates themselves, shape (n,)."""
    largest_first = np.argsort(-lengths(boxes) * widths(boxes), kind="stable").astype(np.int64)
    directions = np.arctan2(boxes[:, UY], boxes[:, UX])
    radius = np.hypot(lengths(boxes), widths(boxes)) / 2
    duplicates: NDArray[np.bool_] = _find(boxes, largest_first, directions, box_centres(boxes), radius, rules)
    return duplicates
