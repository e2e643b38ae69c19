"""Rectangles in the frame of the grid.

Nouns
-----
grid frame
    x to the east and y to the south in cells, from the upper left corner of the grid; the centre of cell
    (row, column) is at (column + 0.5, row + 0.5).
rectangle
    Five numbers: centre x, y, side a along its direction u, side b along v, and the angle from x towards y of u, in
    radians, 0 <= angle < pi. (a, b, angle) and (b, a, angle + pi/2) are the same shape; both are states.
"""

from __future__ import annotations

import math

import numpy as np

from ...core.kernels import kernel
from ...scenes.geodata.raster import Grid
from .arrays import Floats, Mask, Rectangles

__all__ = ["corners", "inside_any", "overlap_area", "row_span", "to_grid_frame", "to_world"]


def corners(rectangles: Rectangles) -> Floats:
    """Return the corners in the grid frame, shape (n, 4, 2), of rectangles, shape (n, 5)."""
    x, y, a, b, angle = np.asarray(rectangles, dtype=np.float64).reshape(-1, 5).T
    cos, sin = np.cos(angle), np.sin(angle)
    along, across = (cos * a / 2, sin * a / 2), (-sin * b / 2, cos * b / 2)
    place = np.empty((len(x), 4, 2))
    for axis, centre in enumerate((x, y)):
        low, high = centre - along[axis], centre + along[axis]
        place[:, 0, axis], place[:, 1, axis] = low - across[axis], high - across[axis]
        place[:, 2, axis], place[:, 3, axis] = high + across[axis], low + across[axis]
    return place


def to_world(rectangles: Rectangles, grid: Grid) -> Floats:
    """Return the corners in metres of the CRS, shape (n, 4, 2)."""
    place = corners(rectangles)
    x, y = grid.to_world(place[..., 1], place[..., 0])
    return np.stack([x, y], axis=-1)


def to_grid_frame(quadrilaterals: Floats, grid: Grid) -> Rectangles:
    """Return rectangles, shape (n, 5), from corners in metres of the CRS, shape (n, 4, 2) in ring order."""
    row, column = grid.to_pixel(quadrilaterals[..., 0], quadrilaterals[..., 1])
    place = np.stack([column, row], axis=-1)
    along, across = place[:, 1] - place[:, 0], place[:, 3] - place[:, 0]
    angle = np.arctan2(along[:, 1], along[:, 0]) % np.pi
    sides = np.stack([np.hypot(*along.T), np.hypot(*across.T), angle], axis=-1)
    return np.concatenate([place.mean(axis=1), sides], axis=1)


@kernel(inline="always")
def row_span(dy: float, half_a: float, half_b: float, cos: float, sin: float) -> tuple[float, float]:
    """Return the interval of x - centre x, inside the rectangle, of the line at y - centre y = dy; lo > hi when none.

    Inside is |dx cos + dy sin| <= a/2 and |-dx sin + dy cos| <= b/2: the intersection of two intervals.
    """
    lo, hi = -np.inf, np.inf
    if abs(cos) > 1e-12:
        middle, reach = -dy * sin / cos, half_a / abs(cos)
        lo, hi = middle - reach, middle + reach
    elif abs(dy * sin) > half_a:
        return 1.0, -1.0
    if abs(sin) > 1e-12:
        middle, reach = dy * cos / sin, half_b / abs(sin)
        lo, hi = max(lo, middle - reach), min(hi, middle + reach)
    elif abs(dy * cos) > half_b:
        return 1.0, -1.0
    return lo, hi


@kernel
def overlap_area(first: Rectangles, second: Rectangles) -> float:
    """Return the common area of two rectangles in cells squared.

    The corners of the first, in the frame of the second, are clipped at its four sides (Sutherland and Hodgman 1974).
    """
    dx, dy = first[0] - second[0], first[1] - second[1]
    reach = 0.5 * (math.hypot(first[2], first[3]) + math.hypot(second[2], second[3]))
    if dx * dx + dy * dy >= reach * reach:
        return 0.0
    cos, sin = math.cos(second[4]), math.sin(second[4])
    u0, v0 = dx * cos + dy * sin, dy * cos - dx * sin
    turn = first[4] - second[4]
    cos, sin = math.cos(turn), math.sin(turn)
    ax, ay = 0.5 * first[2] * cos, 0.5 * first[2] * sin
    bx, by = -0.5 * first[3] * sin, 0.5 * first[3] * cos
    half_u, half_v = 0.5 * second[2], 0.5 * second[3]
    width, height = abs(ax) + abs(bx), abs(ay) + abs(by)
    if abs(u0) >= half_u + width or abs(v0) >= half_v + height:
        return 0.0
    p = np.empty((2, 16, 2))
    p[0, 0, 0], p[0, 0, 1] = u0 - ax - bx, v0 - ay - by
    p[0, 1, 0], p[0, 1, 1] = u0 + ax - bx, v0 + ay - by
    p[0, 2, 0], p[0, 2, 1] = u0 + ax + bx, v0 + ay + by
    p[0, 3, 0], p[0, 3, 1] = u0 - ax + bx, v0 - ay + by
    n, now = 4, 0
    for side in range(4):
        axis = side // 2
        sign = 1.0 if side % 2 == 0 else -1.0
        limit = half_u if axis == 0 else half_v
        m, other = 0, 1 - now
        for i in range(n):
            j = (i + 1) % n
            inner, outer = sign * p[now, i, axis] - limit, sign * p[now, j, axis] - limit
            if inner <= 0.0:
                p[other, m] = p[now, i]
                m += 1
            if (inner < 0.0 < outer) or (outer < 0.0 < inner):
                share = inner / (inner - outer)
                p[other, m, 0] = p[now, i, 0] + share * (p[now, j, 0] - p[now, i, 0])
                p[other, m, 1] = p[now, i, 1] + share * (p[now, j, 1] - p[now, i, 1])
                m += 1
        n, now = m, other
        if n < 3:
            return 0.0
    area = 0.0
    for i in range(n):
        j = (i + 1) % n
        area += p[now, i, 0] * p[now, j, 1] - p[now, j, 0] * p[now, i, 1]
    return float(0.5 * abs(area))


def inside_any(rectangles: Rectangles, shape: tuple[int, int]) -> Mask:
    """Return which cells of a grid of this shape have their centre inside one of the rectangles, shape (n, 5)."""
    mask = np.zeros(shape, dtype=np.bool_)
    _fill(np.ascontiguousarray(rectangles, dtype=np.float64), mask)
    return mask


@kernel
def _fill(rectangles: Rectangles, mask: Mask) -> None:
    """Mark the cells whose centre lies in one of the rectangles, in place."""
    rows, columns = mask.shape
    for k in range(len(rectangles)):
        cx, cy, half_a, half_b = rectangles[k, 0], rectangles[k, 1], 0.5 * rectangles[k, 2], 0.5 * rectangles[k, 3]
        cos, sin = math.cos(rectangles[k, 4]), math.sin(rectangles[k, 4])
        tall = half_a * abs(sin) + half_b * abs(cos)
        for r in range(max(math.floor(cy - tall), 0), min(math.ceil(cy + tall), rows)):
            lo, hi = row_span(r + 0.5 - cy, half_a, half_b, cos, sin)
            if lo < hi:
                first, last = math.ceil(cx + lo - 0.5), math.floor(cx + hi + 0.5)
                mask[r, max(first, 0) : max(min(last, columns), 0)] = True
