"""Shared areas of polygons without an overlay: fans of triangles around one common apex.

Nouns
-----
outline
    The edges of a polygon: exterior rings in one direction, holes in the other, parts of a multipolygon one after the
    other. Nothing else of the polygon is needed.
fan
    The triangles that an apex O spans with every edge of an outline, each with the sign of its orientation. Summed
    with their signs, the indicator functions of the triangles give that of the polygon.
wedge
    The directions from the apex that a triangle covers, less than half a turn.

With one apex for both polygons, the area of their intersection is the sum, over all pairs of triangles, of the product
of signs and the area of the intersection of the two triangles. Two triangles with a common apex meet in the common
part of their wedges, below the nearer of the two edges, and the edges cross there at most once.

The apex is the middle of the common part of the bounds, and coordinates are taken from it, so nothing depends on the
distance from the origin of the CRS. The cost of a pair is the product of the numbers of edges.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .outline_arrays import Outlines

__all__ = ["fan_areas", "in_canonical_order"]

#: Share of the smaller polygon's area that the sums of a fan cannot resolve.
_ROUNDING = 1e-12
#: Pairs that a thread works on at a time.
_CHUNK = 1 << 16


def fan_areas(
    one: Outlines,
    two: Outlines,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    *,
    threads: int | None = None,
) -> NDArray[np.float64]:
    """Return the area that polygon `first` of one set shares with `second` of the other, m2, shape (n,).

    Polygons that touch or are apart share 0; so does a pair whose area is below `_ROUNDING` of the smaller one. A
    polygon shares exactly its own area with a copy of itself. Large sets are worked on by `threads` threads (by
    default as many as there are processors); the bits of the result do not depend on their number.

    Examples
    --------
    >>> import shapely
    >>> from roofbench import Footprints
    >>> from roofbench.evaluators.overlay.outline_arrays import outlines_of
    >>> outlines = outlines_of(Footprints.of([shapely.box(0, 0, 2, 2), shapely.box(1, 1, 3, 3)]))
    >>> fan_areas(outlines, outlines, np.array([0, 0]), np.array([0, 1]))
    array([4., 1.])
    """
    areas = np.empty(len(first))
    chunks = [slice(start, start + _CHUNK) for start in range(0, len(first), _CHUNK)]
    workers = min(threads or (os.cpu_count() or 1), len(chunks))

    def fill(part: slice) -> None:
        _fill(one, two, first[part], second[part], areas[part])

    if workers > 1:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(fill, chunks))
    else:
        for part in chunks:
            fill(part)
    return areas


def in_canonical_order(
    outlines: Outlines, first: NDArray[np.int64], second: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return pairs of one set so that the one with the lower bounds, area or vertices comes first.

    The last bits of a shared area depend on which outline is taken first; so they do not depend on the order of rows.
    """
    first, second = first.copy(), second.copy()
    _order(outlines, first, second)
    return first, second


@kernel
def _order(outlines: Outlines, first: NDArray[np.int64], second: NDArray[np.int64]) -> None:
    """Exchange the sides of pairs, in place, so that the smaller outline is the first."""
    for pair in range(len(first)):
        i, j = first[pair], second[pair]
        less = outlines.area[i] - outlines.area[j]
        axis = 0
        while less == 0.0 and axis < 4:
            less = outlines.bounds[i, axis] - outlines.bounds[j, axis]
            axis += 1
        low, other = outlines.start[i], outlines.start[j]
        count = min(outlines.start[i + 1] - low, outlines.start[j + 1] - other)
        k = 0
        while less == 0.0 and k < count:
            less = outlines.points[low + k, 0] - outlines.points[other + k, 0]
            if less == 0.0:
                less = outlines.points[low + k, 1] - outlines.points[other + k, 1]
            k += 1
        if less > 0.0:
            first[pair], second[pair] = j, i


@kernel
def _fill(
    one: Outlines, two: Outlines, first: NDArray[np.int64], second: NDArray[np.int64], areas: NDArray[np.float64]
) -> None:
    """Fill the shared areas of some pairs."""
    room = 16
    fan = np.empty((room, 6))
    for pair in range(len(first)):
        i, j = first[pair], second[pair]
        xmin, ymin = max(one.bounds[i, 0], two.bounds[j, 0]), max(one.bounds[i, 1], two.bounds[j, 1])
        xmax, ymax = min(one.bounds[i, 2], two.bounds[j, 2]), min(one.bounds[i, 3], two.bounds[j, 3])
        if not (xmin < xmax and ymin < ymax):
            areas[pair] = 0.0
            continue
        low, high = two.start[j], two.start[j + 1]
        if high - low == one.start[i + 1] - one.start[i] and _same(one.points, one.start[i], two.points, low, high):
            areas[pair] = one.area[i]
            continue
        x, y = 0.5 * (xmin + xmax), 0.5 * (ymin + ymax)
        if high - low > room:
            room = 2 * (high - low)
            fan = np.empty((room, 6))
        count = _spread(two.points, low, high, x, y, fan)
        total = 0.0
        low = one.start[i]
        vx, vy = one.points[low, 0] - x, one.points[low, 1] - y
        for k in range(low + 1, one.start[i + 1]):
            ux, uy = vx, vy
            vx, vy = one.points[k, 0] - x, one.points[k, 1] - y
            turn = ux * vy - uy * vx
            if turn > 0.0:
                total += _against(ux, uy, vx, vy, turn, fan, count)
            elif turn < 0.0:
                total -= _against(vx, vy, ux, uy, -turn, fan, count)
        shared = 0.5 * total * one.sign[i] * two.sign[j]
        areas[pair] = shared if shared > _ROUNDING * min(one.area[i], two.area[j]) else 0.0


@kernel
def _same(one: NDArray[np.float64], start: int, two: NDArray[np.float64], low: int, high: int) -> bool:
    """Return whether two outlines have the same vertices in the same order."""
    for k in range(high - low):
        for axis in range(2):
            a, b = one[start + k, axis], two[low + k, axis]
            if a != b and (a == a or b == b):
                return False
    return True


@kernel
def _spread(points: NDArray[np.float64], low: int, high: int, x: float, y: float, fan: NDArray[np.float64]) -> int:
    """Write the triangles of a fan: two corners counter-clockwise, twice the area, the sign. Return their number."""
    count = 0
    zx, zy = points[low, 0] - x, points[low, 1] - y
    for k in range(low + 1, high):
        wx, wy = zx, zy
        zx, zy = points[k, 0] - x, points[k, 1] - y
        turn = wx * zy - wy * zx
        if turn > 0.0:
            fan[count, 0], fan[count, 1], fan[count, 2], fan[count, 3] = wx, wy, zx, zy
            fan[count, 4], fan[count, 5] = turn, 1.0
            count += 1
        elif turn < 0.0:
            fan[count, 0], fan[count, 1], fan[count, 2], fan[count, 3] = zx, zy, wx, wy
            fan[count, 4], fan[count, 5] = -turn, -1.0
            count += 1
    return count


@kernel
def _against(ux: float, uy: float, vx: float, vy: float, turn: float, fan: NDArray[np.float64], count: int) -> float:
    """Return twice the signed area that the triangle (O, u, v) shares with all triangles of a fan."""
    total = 0.0
    ex, ey = vx - ux, vy - uy
    for k in range(count):
        wx, wy, zx, zy = fan[k, 0], fan[k, 1], fan[k, 2], fan[k, 3]
        fx, fy = zx - wx, zy - wy
        u_w, w_v = ux * wy - uy * wx, wx * vy - wy * vx
        u_z, z_v = ux * zy - uy * zx, zx * vy - zy * vx
        # The common wedge begins at w where that lies between u and v, else at u where that lies between w and z; it
        # ends likewise. There the first edge is met at p and q, the second at a and b. A wedge so thin that an edge
        # and a direction are parallel to rounding holds no area.
        if u_w >= 0.0 and w_v >= 0.0:
            slope = wx * ey - wy * ex
            if slope <= 0.0:
                continue
            ax, ay = wx, wy
            px, py = wx * (turn / slope), wy * (turn / slope)
        elif u_w <= 0.0 and u_z >= 0.0:
            slope = ux * fy - uy * fx
            if slope <= 0.0:
                continue
            px, py = ux, uy
            ax, ay = ux * (fan[k, 4] / slope), uy * (fan[k, 4] / slope)
        else:
            continue
        if u_z >= 0.0 and z_v >= 0.0:
            slope = zx * ey - zy * ex
            if slope <= 0.0:
                continue
            bx, by = zx, zy
            qx, qy = zx * (turn / slope), zy * (turn / slope)
        elif w_v >= 0.0 and z_v <= 0.0:
            slope = vx * fy - vy * fx
            if slope <= 0.0:
                continue
            qx, qy = vx, vy
            bx, by = vx * (fan[k, 4] / slope), vy * (fan[k, 4] / slope)
        else:
            continue
        # Signed distances of p and q from the second edge, positive on the apex's side.
        at_p = fx * (py - wy) - fy * (px - wx)
        at_q = fx * (qy - wy) - fy * (qx - wx)
        if at_p >= 0.0 and at_q >= 0.0:
            part = px * qy - py * qx
        elif at_p <= 0.0 and at_q <= 0.0:
            part = ax * by - ay * bx
        else:
            along = at_p / (at_p - at_q)
            mx, my = px + along * (qx - px), py + along * (qy - py)
            near = px * my - py * mx if at_p > 0.0 else ax * my - ay * mx
            far = mx * by - my * bx if at_p > 0.0 else mx * qy - my * qx
            part = near + far
        total += fan[k, 5] * part
    return total
