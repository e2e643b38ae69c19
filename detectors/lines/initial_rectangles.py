"""Initial rectangles: extended from the lines, the longest first.

A line is *already inside* a rectangle when its midpoint and at least nine tenths of its length are, with a margin for
the last step of the extension; it makes no rectangle.
Source: Awrangjeb, Ravanbakhsh & Fraser (2010), section 3.3.3.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .boxes import OX, OY, U0, U1, UX, UY, V0, V1, length_inside, to_box
from .extension import Cover, Growth, extend_rectangle

__all__ = ["INSIDE", "TOO_NARROW", "InitialRules", "initial_rectangles"]

#: Codes of lines that made no rectangle; indices of rectangles are 0 or more.
INSIDE = -1
TOO_NARROW = -2


class InitialRules(NamedTuple):
    """Rules of initial rectangles; lengths in pixels.

    Attributes
    ----------
    depth : float
        Width of a rectangle before it is extended.
    least_side : float
        Least length and width; smaller rectangles are dropped.
    margin : float
        Distance outside a rectangle up to which a line counts as inside: an extension may end a step early.
    inside_share : float
        Least share of its length inside for a line whose midpoint is inside.
    """

    depth: float
    least_side: float
    margin: float
    inside_share: float


@kernel
def share_inside(line: NDArray[np.float64], box: NDArray[np.float64], margin: float) -> float:
    """Return the share of a line's length that lies in a box widened by `margin`; 0 when its midpoint does not."""
    middle = (line[U0] + line[U1]) / 2
    u, v = to_box(line[OX] + middle * line[UX], line[OY] + middle * line[UY], box)
    if not (box[U0] - margin <= u <= box[U1] + margin and box[V0] - margin <= v <= box[V1] + margin):
        return 0.0
    wide = box.copy()
    wide[U0] -= margin
    wide[U1] += margin
    wide[V0] -= margin
    wide[V1] += margin
    return float(length_inside(line, wide) / (line[U1] - line[U0]))


@kernel
def initial_rectangles(
    cover: Cover,
    growth: Growth,
    rules: InitialRules,
    lines: NDArray[np.float64],
    green: NDArray[np.bool_],
    order: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return a rectangle extended from each line that is not yet inside one.

    Parameters
    ----------
    green : ndarray of bool, shape (n,)
        Whether vegetation is beside each line.
    order : ndarray of int64, shape (n,)
        Lines from the longest to the shortest.

    Returns
    -------
    rectangles : ndarray, shape (m, 8)
    made : ndarray of int64, shape (n,)
        Index of the rectangle that each line made, `INSIDE` or `TOO_NARROW`.
    """
    n = len(lines)
    rectangles, made = np.empty((n, 8)), np.full(n, INSIDE)
    found = 0
    for i in order:
        inside = False
        for j in range(found):
            if share_inside(lines[i], rectangles[j], rules.margin) >= rules.inside_share:
                inside = True
                break
        if inside:
            continue
        box = lines[i].copy()
        box[V0], box[V1] = 0.0, rules.depth
        box = extend_rectangle(cover, growth, box, green[i])
        if min(box[U1] - box[U0], box[V1] - box[V0]) < rules.least_side:
            made[i] = TOO_NARROW
        else:
            for k in range(8):
                rectangles[found, k] = box[k]
            made[i] = found
            found += 1
    return rectangles[:found].copy(), made
