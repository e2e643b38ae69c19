"""Boxes: lines and rectangles in one form, and sums of rasters inside them.

Nouns
-----
pixel coordinates
    x to the right (column), y down (row), in pixels of the orthoimage; cell (row, column) covers
    ``column <= x < column + 1``, ``row <= y < row + 1``.
box
    Eight numbers: origin (`OX`, `OY`), unit direction (`UX`, `UY`) and the intervals [`U0`, `U1`) along that direction
    and [`V0`, `V1`) across it, pixels. *Across* is the direction turned by +90 degrees in pixel coordinates,
    ``(-UY, UX)``; lines are directed so that the building lies on that side. A line is a box without width
    (``V0 = V1 = 0``). To extend a side of a rectangle, one end of one interval is moved.
row prefix sums
    Of a raster of shape (rows, columns): shape (rows, columns + 1), entry (r, c) is the sum of the first c cells of
    row r. The sum over a rotated box takes one subtraction per row that it crosses.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel

__all__ = [
    "OX",
    "OY",
    "U0",
    "U1",
    "UX",
    "UY",
    "V0",
    "V1",
    "Boxes",
    "box_centres",
    "box_corners",
    "column_range",
    "from_box",
    "length_inside",
    "lengths",
    "prefix_sums",
    "rescaled",
    "row_range",
    "sum_in_box",
    "sums_in_box",
    "to_box",
    "widths",
]

OX: Final = 0
OY: Final = 1
UX: Final = 2
UY: Final = 3
U0: Final = 4
U1: Final = 5
V0: Final = 6
V1: Final = 7

#: Many boxes, shape (n, 8).
Boxes = NDArray[np.float64]


def lengths(boxes: Boxes) -> NDArray[np.float64]:
    """Return the extent along the direction, pixels, shape (n,)."""
    return np.asarray(boxes[:, U1] - boxes[:, U0])


def widths(boxes: Boxes) -> NDArray[np.float64]:
    """Return the extent across the direction, pixels, shape (n,)."""
    return np.asarray(boxes[:, V1] - boxes[:, V0])


def _at(boxes: Boxes, u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float64]:
    x = boxes[:, OX] + u * boxes[:, UX] - v * boxes[:, UY]
    y = boxes[:, OY] + u * boxes[:, UY] + v * boxes[:, UX]
    return np.stack([x, y], axis=-1)


def box_corners(boxes: Boxes) -> NDArray[np.float64]:
    """Return the four corners (x, y) in ring order, pixels, shape (n, 4, 2)."""
    u0, u1, v0, v1 = boxes[:, U0], boxes[:, U1], boxes[:, V0], boxes[:, V1]
    return np.stack([_at(boxes, u0, v0), _at(boxes, u1, v0), _at(boxes, u1, v1), _at(boxes, u0, v1)], axis=1)


def box_centres(boxes: Boxes) -> NDArray[np.float64]:
    """Return the centres (x, y), pixels, shape (n, 2)."""
    return _at(boxes, (boxes[:, U0] + boxes[:, U1]) / 2, (boxes[:, V0] + boxes[:, V1]) / 2)


def rescaled(boxes: Boxes, pixels: int) -> Boxes:
    """Return boxes in the coordinates of a raster whose cells are `pixels` pixels wide."""
    scaled = boxes.copy()
    for column in (OX, OY, *range(U0, boxes.shape[1])):
        scaled[:, column] /= pixels
    return scaled


@kernel
def prefix_sums(raster: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return the row prefix sums of a uint8 raster."""
    rows, columns = raster.shape
    prefix = np.empty((rows, columns + 1), dtype=np.int32)
    for row in range(rows):
        total = 0
        prefix[row, 0] = 0
        for column in range(columns):
            total += raster[row, column]
            prefix[row, column + 1] = total
    return prefix


@kernel
def row_range(box: NDArray[np.float64]) -> tuple[int, int]:
    """Return the half-open range of rows whose centre line can cross the box."""
    along0, along1 = box[U0] * box[UY], box[U1] * box[UY]
    across0, across1 = box[V0] * box[UX], box[V1] * box[UX]
    low = box[OY] + min(along0, along1) + min(across0, across1)
    high = box[OY] + max(along0, along1) + max(across0, across1)
    return math.ceil(low - 0.5), math.ceil(high - 0.5)


@kernel
def _slab(slope: float, low: float, high: float, x0: float, x1: float) -> tuple[float, float]:
    """Return the part of the interval [x0, x1) where ``low <= slope * x < high``."""
    if abs(slope) < 1e-12:
        return (x0, x1) if low <= 0.0 < high else (0.0, 0.0)
    at_low, at_high = np.divide(low, slope), np.divide(high, slope)  # without a test for zero
    return max(x0, min(at_low, at_high)), min(x1, max(at_low, at_high))


@kernel
def column_range(box: NDArray[np.float64], row: int) -> tuple[int, int]:
    """Return the half-open range of columns of one row whose cell centres lie in the box; not clipped to a raster."""
    dy = row + 0.5 - box[OY]
    x0, x1 = _slab(box[UX], box[U0] - dy * box[UY], box[U1] - dy * box[UY], -1e9, 1e9)
    x0, x1 = _slab(-box[UY], box[V0] - dy * box[UX], box[V1] - dy * box[UX], x0, x1)
    first = math.ceil(box[OX] + x0 - 0.5)
    return first, max(first, math.ceil(box[OX] + x1 - 0.5))


@kernel
def sums_in_box(
    prefix: NDArray[np.int32], other: NDArray[np.int32], box: NDArray[np.float64]
) -> tuple[int, int, int, int]:
    """Return the sums of two rasters over the cells whose centre is in the box, their number on them, and in all."""
    rows, columns = prefix.shape[0], prefix.shape[1] - 1
    first_row, last_row = row_range(box)
    total, of_other, on_raster, in_all = 0, 0, 0, 0
    for row in range(first_row, last_row):
        first, last = column_range(box, row)
        in_all += last - first
        if 0 <= row < rows:
            first, last = max(first, 0), min(last, columns)
            if last > first:
                on_raster += last - first
                total += prefix[row, last] - prefix[row, first]
                of_other += other[row, last] - other[row, first]
    return total, of_other, on_raster, in_all


@kernel
def sum_in_box(prefix: NDArray[np.int32], box: NDArray[np.float64]) -> tuple[int, int, int]:
    """Return the sum over the cells whose centre is in the box, their number on the raster, and their total number."""
    total, _, on_raster, in_all = sums_in_box(prefix, prefix, box)
    return total, on_raster, in_all


@kernel
def to_box(x: float, y: float, box: NDArray[np.float64]) -> tuple[float, float]:
    """Return the coordinates (u, v) of a point (x, y) along and across a box."""
    dx, dy = x - box[OX], y - box[OY]
    return dx * box[UX] + dy * box[UY], -dx * box[UY] + dy * box[UX]


@kernel
def from_box(u: float, v: float, box: NDArray[np.float64]) -> tuple[float, float]:
    """Return the point (x, y) with coordinates (u, v) along and across a box: the inverse of `to_box`."""
    return box[OX] + u * box[UX] - v * box[UY], box[OY] + u * box[UY] + v * box[UX]


@kernel
def length_inside(line: NDArray[np.float64], box: NDArray[np.float64]) -> float:
    """Return the length of the part of a line that lies in a box, pixels."""
    u, v = to_box(line[OX], line[OY], box)
    slope_u = line[UX] * box[UX] + line[UY] * box[UY]
    slope_v = line[UY] * box[UX] - line[UX] * box[UY]
    t0, t1 = line[U0], line[U1]
    for base, slope, low, high in ((u, slope_u, box[U0], box[U1]), (v, slope_v, box[V0], box[V1])):
        if abs(slope) > 1e-12:
            a, b = (low - base) / slope, (high - base) / slope
            t0, t1 = max(t0, min(a, b)), min(t1, max(a, b))
        elif base < low or base > high:
            return 0.0
    return float(max(0.0, t1 - t0))
