"""Voting: lines around one black shape that agree in length and direction are building edges.

Four votes from 0 to 1 for each extended line l of a shape: v1 its length against the mean length of the shape's lines;
v2 = (Theta - theta) / Theta for the angle theta by which it was adjusted; v3 = n_e / n_t, the share of the shape's
lines that remain after extension; v4 = 1 when the longest image line within a rectangle 3 m wide around l is at least
2 L_min long, (L - L_min) / L_min when shorter, 0 without one. A line is kept when their mean exceeds 0.5.
Source: Awrangjeb, Zhang & Fraser (2011), section 3.3.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .boxes import OX, OY, U0, U1, UX, UY, V0, V1, Boxes, length_inside, lengths

__all__ = ["cast_votes", "longest_image_lines"]


@kernel
def _longest(
    lines: NDArray[np.float64], image_lines: NDArray[np.float64], half_width: float, reach: float
) -> NDArray[np.float64]:
    out = np.zeros(len(lines))
    centres = image_lines[:, OY].copy()
    for i in range(len(lines)):
        box = lines[i].copy()
        box[V0], box[V1] = -half_width, half_width
        middle = (box[U0] + box[U1]) / 2
        x, y = box[OX] + middle * box[UX], box[OY] + middle * box[UY]
        radius = math.hypot((box[U1] - box[U0]) / 2, half_width) + reach
        first, last = np.searchsorted(centres, y - radius), np.searchsorted(centres, y + radius)
        for j in range(first, last):
            if abs(image_lines[j, OX] - x) <= radius:
                out[i] = max(out[i], length_inside(image_lines[j], box))
    return out


def longest_image_lines(lines: Boxes, image_lines: Boxes, *, half_width: float) -> NDArray[np.float64]:
    """Return the length of the longest image line within `half_width` of each line; 0 without one.

    All lengths in pixels; the origins of the image lines are their midpoints.
    """
    if not len(image_lines):
        return np.zeros(len(lines))
    ordered = image_lines[np.argsort(image_lines[:, OY], kind="stable")]
    longest: NDArray[np.float64] = _longest(lines, ordered, half_width, float(lengths(ordered).max()) / 2)
    return longest


def cast_votes(
    line_lengths: NDArray[np.float64],
    rotation: NDArray[np.float64],
    image_lengths: NDArray[np.float64],
    shapes: NDArray[np.int64],
    surviving: NDArray[np.bool_],
    *,
    tolerance: float,
    least: float,
    length_as_printed: bool,
) -> NDArray[np.float64]:
    """Return the votes v1 to v4 of each surviving line, shape (n, 4), NaN for the others.

    Parameters
    ----------
    line_lengths, image_lengths : ndarray, shape (n,)
        Lengths of the extended lines, and of the longest image line of each (0: none), metres.
    rotation : ndarray, shape (n,)
        Adjustment angle, radians.
    shapes : ndarray of int64, shape (n,)
        Of all extracted lines.
    surviving : ndarray of bool, shape (n,)
        Which of them remain after the extension.
    tolerance : float
        Theta, the largest adjustment, radians.
    least : float
        L_min, metres.
    length_as_printed : bool
        Whether v1 of a line shorter than the mean is (mean - L) / mean, which favours shorter lines, and not L / mean.
    """
    _, shape = np.unique(shapes, return_inverse=True)
    extracted = np.bincount(shape)
    left = np.bincount(shape, weights=surviving)
    mean = np.bincount(shape, weights=np.where(surviving, line_lengths, 0.0)) / np.maximum(left, 1)
    relative = line_lengths / np.where(mean > 0, mean, 1.0)[shape]
    shorter = 1.0 - relative if length_as_printed else relative
    votes = np.stack(
        [
            np.where(relative >= 1.0, 1.0, shorter),
            (tolerance - np.abs(rotation)) / tolerance if tolerance > 0 else np.ones(len(shapes)),
            (left / extracted)[shape],
            np.clip((image_lengths - least) / least, 0.0, 1.0) if least > 0 else np.sign(image_lengths),
        ],
        axis=-1,
    )
    votes[~surviving] = np.nan
    return votes
