"""Adjustment: rotate lines until they are parallel or perpendicular to a reference line.

The *rotation* of a line towards a reference is the smallest angle that makes both parallel or perpendicular, in
(-45, 45] degrees. All rotations use the directions as fitted, so the result does not depend on the order.
Sources: Awrangjeb, Ravanbakhsh & Fraser (2010), section 3.3.2 (references in the neighbourhood); Awrangjeb, Zhang &
Fraser (2011), section 3.3 (the longest line of the same black shape).

In the 2010 paper, the smallest rotation is to avoid wrong references. Where streets are curved, houses differ by a few
degrees, so the smallest rotation is towards a neighbour, and the lines of one house get several directions
(`adjust_within_shape` is the reading against it).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .boxes import OX, OY, U0, U1, UX, UY, Boxes, lengths

__all__ = [
    "adjust_to_neighbours",
    "adjust_to_shape",
    "adjust_within_shape",
    "by_length",
    "rotate",
    "rotation_between",
]


@kernel
def rotation_between(direction: float, reference: float) -> float:
    """Return the angle that turns `direction` parallel or perpendicular to `reference`, radians in (-pi/4, pi/4]."""
    quarter = math.pi / 2
    turn = (reference - direction) % quarter
    return turn - quarter if turn > math.pi / 4 else turn


@kernel
def _nearest_rotations(
    lines: NDArray[np.float64],
    order: NDArray[np.int64],
    references: int,
    radius: float,
    tolerance: float,
    longer_only: bool,
) -> NDArray[np.float64]:
    n = len(lines)
    angles = np.arctan2(lines[:, UY], lines[:, UX])
    rotation = np.full(n, np.nan)
    for place in range(references):
        i = order[place]
        for other in range(place + 1 if longer_only else 0, n):
            j = order[other]
            if i == j or math.hypot(lines[i, OX] - lines[j, OX], lines[i, OY] - lines[j, OY]) > radius:
                continue
            turn = rotation_between(angles[j], angles[i])
            if abs(turn) <= tolerance and not abs(turn) >= abs(rotation[j]):
                rotation[j] = turn
        # The longest line of a neighbourhood stays when another line is adjusted to it.
        if longer_only and math.isnan(rotation[i]):
            for other in range(place + 1, n):
                j = order[other]
                if math.hypot(lines[i, OX] - lines[j, OX], lines[i, OY] - lines[j, OY]) <= radius and (
                    abs(rotation_between(angles[j], angles[i])) <= tolerance
                ):
                    rotation[i] = 0.0
                    break
    return rotation


def by_length(lines: Boxes) -> NDArray[np.int64]:
    """Return the order from the longest line to the shortest; equal lengths keep their order."""
    return np.argsort(-lengths(lines), kind="stable").astype(np.int64)


def adjust_to_neighbours(
    lines: Boxes, *, radius: float, tolerance: float, longer_only: bool, share: float = 1.0
) -> NDArray[np.float64]:
    """Return the smallest rotation of each line towards a line whose centre is near, radians, NaN without any.

    Parameters
    ----------
    radius : float
        Largest distance of the centres, pixels.
    tolerance : float
        Largest rotation, radians.
    longer_only : bool
        Whether only longer lines are references; otherwise each line is a reference for all others.
    share : float
        Share of the lines, the longest first, that can be references.
    """
    references = math.ceil(share * len(lines))
    rotation: NDArray[np.float64] = _nearest_rotations(
        lines, by_length(lines), references, radius, tolerance, longer_only
    )
    return rotation


@kernel
def _rotations_within(
    lines: NDArray[np.float64],
    shapes: NDArray[np.int64],
    order: NDArray[np.int64],
    references: int,
    radius: float,
    tolerance: float,
    reach: float,
) -> NDArray[np.float64]:
    angles = np.arctan2(lines[:, UY], lines[:, UX])
    rotation = np.full(len(lines), np.nan)
    for place in range(len(order)):
        j = order[place]
        half = (lines[j, U1] - lines[j, U0]) / 2
        for i in order[: min(place, references)]:
            if shapes[i] != shapes[j] or math.hypot(lines[i, OX] - lines[j, OX], lines[i, OY] - lines[j, OY]) > radius:
                continue
            turn = rotation_between(angles[j], angles[i])
            if abs(turn) <= tolerance and half * math.sin(abs(turn)) <= reach:
                rotation[j] = turn
                break
    return rotation


def adjust_within_shape(
    lines: Boxes, shapes: NDArray[np.int64], *, radius: float, tolerance: float, reach: float, share: float = 1.0
) -> NDArray[np.float64]:
    """Return the rotation of each line towards the longest line of its shape that is near it in place and direction.

    Parameters
    ----------
    radius : float
        Largest distance of the centres, pixels.
    tolerance : float
        Largest rotation, radians.
    reach : float
        Largest distance by which the rotation moves the ends of the line, pixels: a short line follows its shape by a
        large angle, a long one, whose direction is certain, by a small one.
    share : float
        Share of the lines, the longest first, that can be references.

    Returns
    -------
    ndarray, shape (n,)
        Radians; NaN for lines without such a longer line.
    """
    references = math.ceil(share * len(lines))
    rotation: NDArray[np.float64] = _rotations_within(
        lines, shapes, by_length(lines), references, radius, tolerance, reach
    )
    return rotation


def adjust_to_shape(
    lines: Boxes, shapes: NDArray[np.int64], *, tolerance: float, longest_only: bool
) -> NDArray[np.float64]:
    """Return the rotation of each line towards a base line of its shape, radians, NaN without one.

    Parameters
    ----------
    tolerance : float
        Largest rotation, radians.
    longest_only : bool
        Whether the longest line of a shape is its only base line, as printed. Otherwise a line that cannot be adjusted
        to any base line becomes a further one, because a shape often joins buildings and trees at different angles. A
        further base line to which no other line is adjusted is dropped.
    """
    rotation = np.full(len(lines), np.nan)
    bases: dict[int, list[int]] = {}
    followers = np.zeros(len(lines), dtype=np.int64)
    angles = np.arctan2(lines[:, UY], lines[:, UX])
    for i in by_length(lines):
        own = bases.setdefault(int(shapes[i]), [])
        turns = {base: rotation_between(angles[i], angles[base]) for base in own}
        near = [base for base, turn in turns.items() if abs(turn) <= tolerance]
        if near:
            rotation[i] = turns[near[0]]
            followers[near[0]] += 1
        elif not own or not longest_only:
            own.append(int(i))
            rotation[i] = 0.0
    for own in bases.values():
        for base in own[1:]:
            if followers[base] == 0:
                rotation[base] = np.nan
    return rotation


def rotate(lines: Boxes, rotation: NDArray[np.float64]) -> Boxes:
    """Return the lines rotated about their origins, which must be their centres."""
    turned = lines.copy()
    cos, sin = np.cos(rotation), np.sin(rotation)
    turned[:, UX] = lines[:, UX] * cos - lines[:, UY] * sin
    turned[:, UY] = lines[:, UX] * sin + lines[:, UY] * cos
    return turned
