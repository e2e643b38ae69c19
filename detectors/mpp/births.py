"""Where new buildings are proposed: everywhere, and around boxes that the data suggest.

The density of a proposed rectangle x is q(x) = (1 - share) / (|window| sides^2 pi) + share * sum_i w_i K_i(x): a
uniform part, so that every state can be reached, and kernels around the boxes. K_i is uniform in the centre (a square
around the box's centre), in the logarithm of both sides and in the angle. Death needs q of the building that would be
reborn, so the boxes lie in a grid of buckets no narrower than a kernel: only 3 x 3 of them can hold a kernel over x.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.kernels import kernel
from .arrays import Floats, Integers, RandomState, Rectangles
from .random_stream import uniform
from .windows import Window

__all__ = ["Births", "birth_density", "make_births", "propose_birth"]

#: Half widths of a kernel: centre in cells, logarithm of a side, angle in radians.
KERNEL_SHIFT, KERNEL_SIDE, KERNEL_TURN = 2.0, 0.20, 0.06


class Births(NamedTuple):
    """The birth proposal of one window.

    Attributes
    ----------
    share : float
        Of the kernels; 0 for uniform births alone.
    edges : ndarray, shape (4,)
        x0, y0, x1, y1 in cells: where centres may lie.
    sides : ndarray, shape (2,)
        Least and largest side in cells.
    boxes : ndarray, shape (n, 5)
        Sorted by bucket.
    weights, steps : ndarray, shape (n,)
        Weight of each kernel (they sum up to 1) and their running sum.
    starts : ndarray of int64, shape (rows * columns + 1,)
        First box of each bucket.
    buckets : ndarray of int64, shape (2,)
        Rows and columns of buckets.
    origin : ndarray, shape (3,)
        x, y of the first bucket and their width, cells.
    """

    share: float
    edges: Floats
    sides: Floats
    boxes: Rectangles
    weights: Floats
    steps: Floats
    starts: Integers
    buckets: Integers
    origin: Floats


def make_births(window: Window, boxes: Rectangles, weights: Floats, share: float) -> Births:
    """Build the proposal of a window; boxes whose kernel cannot reach it are left out.

    Parameters
    ----------
    window : Window
    boxes : ndarray, shape (n, 5)
    weights : ndarray, shape (n,)
        Positive; scaled to sum up to 1.
    share : float
        Share of births from kernels, less than 1; 0 where no box is left.
    """
    x0, y0, x1, y1 = window.edges.tolist()
    near = (boxes[:, 0] > x0) & (boxes[:, 0] < x1) & (boxes[:, 1] > y0) & (boxes[:, 1] < y1)
    boxes, weights = boxes[near], weights[near]
    width = max(2 * KERNEL_SHIFT, math.sqrt((x1 - x0) * (y1 - y0)) / 64)
    columns = int((x1 - x0) / width) + 1
    rows = int((y1 - y0) / width) + 1
    bucket = ((boxes[:, 1] - y0) / width).astype(np.int64) * columns + ((boxes[:, 0] - x0) / width).astype(np.int64)
    order = np.argsort(bucket, kind="stable")
    boxes, weights, bucket = boxes[order], weights[order], bucket[order]
    total = weights.sum()
    weights = weights / total if total > 0 else weights
    return Births(
        share if len(boxes) else 0.0,
        window.edges,
        np.array([window.model.least_side, window.model.largest_side]),
        np.ascontiguousarray(boxes, dtype=np.float64).reshape(-1, 5),
        np.ascontiguousarray(weights, dtype=np.float64),
        np.cumsum(weights),
        np.searchsorted(bucket, np.arange(rows * columns + 1)).astype(np.int64),
        np.array([rows, columns], dtype=np.int64),
        np.array([x0, y0, width], dtype=np.float64),
    )


@kernel
def propose_birth(births: Births, state: RandomState, rectangle: Rectangles) -> None:
    """Fill a rectangle drawn from q; its centre or sides may be outside what is allowed, where the target is 0."""
    least, largest = births.sides[0], births.sides[1]
    if uniform(state) >= births.share:
        w = births.edges
        rectangle[0] = w[0] + uniform(state) * (w[2] - w[0])
        rectangle[1] = w[1] + uniform(state) * (w[3] - w[1])
        rectangle[2] = least + uniform(state) * (largest - least)
        rectangle[3] = least + uniform(state) * (largest - least)
        rectangle[4] = uniform(state) * math.pi
        return
    i = min(np.searchsorted(births.steps, uniform(state), side="right"), len(births.boxes) - 1)
    box = births.boxes[i]
    rectangle[0] = box[0] + KERNEL_SHIFT * (2.0 * uniform(state) - 1.0)
    rectangle[1] = box[1] + KERNEL_SHIFT * (2.0 * uniform(state) - 1.0)
    rectangle[2] = box[2] * math.exp(KERNEL_SIDE * (2.0 * uniform(state) - 1.0))
    rectangle[3] = box[3] * math.exp(KERNEL_SIDE * (2.0 * uniform(state) - 1.0))
    rectangle[4] = (box[4] + KERNEL_TURN * (2.0 * uniform(state) - 1.0)) % math.pi


@kernel
def birth_density(births: Births, rectangle: Rectangles) -> float:
    """Return q of a rectangle, per cells^4 and radian."""
    w = births.edges
    span = births.sides[1] - births.sides[0]
    density = (1.0 - births.share) / ((w[2] - w[0]) * (w[3] - w[1]) * span * span * math.pi)
    if births.share == 0.0:
        return float(density)
    width = births.origin[2]
    row, column = int((rectangle[1] - births.origin[1]) / width), int((rectangle[0] - births.origin[0]) / width)
    rows, columns = births.buckets[0], births.buckets[1]
    volume = 16.0 * KERNEL_SHIFT * KERNEL_SHIFT * KERNEL_SIDE * KERNEL_SIDE * 2.0 * KERNEL_TURN
    total = 0.0
    for r in range(max(row - 1, 0), min(row + 2, rows)):
        first = births.starts[r * columns + max(column - 1, 0)]
        last = births.starts[r * columns + min(column + 1, columns - 1) + 1]
        for i in range(first, last):
            box = births.boxes[i]
            if abs(rectangle[0] - box[0]) > KERNEL_SHIFT or abs(rectangle[1] - box[1]) > KERNEL_SHIFT:
                continue
            turn = abs(rectangle[4] - box[4]) % math.pi
            if min(turn, math.pi - turn) > KERNEL_TURN:
                continue
            if abs(math.log(rectangle[2] / box[2])) > KERNEL_SIDE or abs(math.log(rectangle[3] / box[3])) > KERNEL_SIDE:
                continue
            total += births.weights[i]
    return float(density + births.share * total / (volume * rectangle[2] * rectangle[3]))
