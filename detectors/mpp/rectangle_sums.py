"""Sums over the cells of a rectangle, from the row prefix sums of `tables`.

Nouns
-----
moments
    n, sums of u, v, uu, uv, vv, h, uh, vh, hh over the high cells of a rectangle: place u, v in cells from the centre
    along its sides, height in metres.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.kernels import kernel
from .arrays import Rectangles
from .tables import MILLI, Tables, part_sums

__all__ = ["Sums", "scan", "scan_halves", "scan_hip"]


class Sums(NamedTuple):
    """What a scan adds up over the cells of a rectangle.

    Attributes
    ----------
    score : float
        Scores of its cells, nats.
    outside : float
        How many of its cells are not on the grid.
    n, u, v, uu, uv, vv, h, uh, vh, hh : float
        Its moments.
    """

    score: float
    outside: float
    n: float
    u: float
    v: float
    uu: float
    uv: float
    vv: float
    h: float
    uh: float
    vh: float
    hh: float


@kernel(inline="always")
def _first_cell(x: float) -> int:
    """Index of the first cell whose centre is not left of x, for x > -1e6 (a ceiling that compiles to one step)."""
    return 1048576 - int(1048576.5 - x)


@kernel
def _lines(rectangle: Rectangles) -> tuple[float, float, float, float, float, float, float]:
    """Return cos, sin and half the height of a rectangle, and slope and reach in x of the strips that it is made of.

    In the row at dy from the centre |u| <= a/2 is |dx - dy slope_u| <= reach_u, and |v| <= b/2 the same with v.
    """
    cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
    half_a, half_b = 0.5 * rectangle[2], 0.5 * rectangle[3]
    tall = half_a * abs(sin) + half_b * abs(cos)
    slope_u, reach_u, slope_v, reach_v = 0.0, np.inf, 0.0, np.inf
    if abs(cos) > 1e-12:
        slope_u, reach_u = -sin / cos, half_a / abs(cos)
    if abs(sin) > 1e-12:
        slope_v, reach_v = cos / sin, half_b / abs(sin)
    return cos, sin, tall, slope_u, reach_u, slope_v, reach_v


@kernel
def scan(tables: Tables, rectangle: Rectangles) -> Sums:
    """Add up the cells of a rectangle.

    Sums are whole numbers about the cell of the centre, so that nothing depends on where the grid begins.
    """
    small = tables.small
    rows, columns = small.shape[0], small.shape[1] - 1
    cx, cy = rectangle[0], rectangle[1]
    cos, sin, tall, slope_u, reach_u, slope_v, reach_v = _lines(rectangle)
    x0, y0 = np.int64(math.floor(cx)), np.int64(math.floor(cy))
    zero = np.int64(0)
    score, outside, n, x, y, xx, xy, yy = zero, zero, zero, zero, zero, zero, zero, zero
    h, xh, yh, hh = zero, zero, zero, zero
    for row in range(_first_cell(cy - tall), _first_cell(cy + tall)):
        dy = row + 0.5 - cy
        lo = max(dy * slope_u - reach_u, dy * slope_v - reach_v)
        hi = min(dy * slope_u + reach_u, dy * slope_v + reach_v)
        if not lo < hi:
            continue
        first, last = _first_cell(cx + lo), _first_cell(cx + hi)
        if row < 0 or row >= rows:
            outside += max(last - first, 0)
            continue
        left, right = min(max(first, 0), columns), min(max(last, 0), columns)
        outside += max(last - first, 0) - max(right - left, 0)
        if right <= left:
            continue
        score += small[row, right, 3] - small[row, left, 3]
        if small[row, right, 0] == small[row, left, 0]:
            continue
        j = row - y0
        n_r, x_r, xx_r, h_r, xh_r, hh_r = part_sums(tables, row, left, right, x0)
        n += n_r
        x += x_r
        y += j * n_r
        xx += xx_r
        xy += j * x_r
        yy += j * j * n_r
        h += h_r
        xh += xh_r
        yh += j * h_r
        hh += hh_r
    ox, oy = x0 + 0.5 - cx, y0 + 0.5 - cy
    size, height = float(n), 0.01 * h
    fx, fy = x + ox * size, y + oy * size
    fxx, fyy = xx + 2.0 * ox * x + ox * ox * size, yy + 2.0 * oy * y + oy * oy * size
    fxy = xy + ox * y + oy * x + ox * oy * size
    fxh, fyh = 0.01 * xh + ox * height, 0.01 * yh + oy * height
    return Sums(
        score / MILLI,
        float(outside),
        size,
        fx * cos + fy * sin,
        fy * cos - fx * sin,
        fxx * cos * cos + 2.0 * fxy * cos * sin + fyy * sin * sin,
        (fyy - fxx) * cos * sin + fxy * (cos * cos - sin * sin),
        fxx * sin * sin - 2.0 * fxy * cos * sin + fyy * cos * cos,
        height,
        fxh * cos + fyh * sin,
        fyh * cos - fxh * sin,
        1e-4 * hh,
    )


@kernel
def _with_part(
    sums: tuple[int, int, int, int, int, int], tables: Tables, row: int, part: tuple[int, int], origin: tuple[int, int]
) -> tuple[int, int, int, int, int, int]:
    """Return the sums of 1, x, y, h, xh and yh, those over a part of a row added; nothing where it is empty."""
    begin, end = part
    if end <= begin:
        return sums
    x0, y0 = origin
    n, x, y, h, xh, yh = sums
    n_r, x_r, _, h_r, xh_r, _ = part_sums(tables, row, begin, end, x0)
    j = row - y0
    return n + n_r, x + x_r, y + j * n_r, h + h_r, xh + xh_r, yh + j * h_r


@kernel
def scan_halves(tables: Tables, rectangle: Rectangles) -> tuple[float, float, float, float]:
    """Return the sums of u and uh over the cells with u > 0, and of v and vh over those with v > 0."""
    small = tables.small
    rows, columns = small.shape[0], small.shape[1] - 1
    cx, cy = rectangle[0], rectangle[1]
    cos, sin, tall, slope_u, reach_u, slope_v, reach_v = _lines(rectangle)
    # The sides of the lines u = 0 and v = 0: u > 0 is right of its line where cos > 0, v > 0 left of its where sin > 0.
    right_u, right_v = cos > 0.0, sin < 0.0
    x0, y0 = np.int64(math.floor(cx)), np.int64(math.floor(cy))
    zero = np.int64(0)
    by_u = (zero, zero, zero, zero, zero, zero)
    by_v = by_u
    for row in range(max(_first_cell(cy - tall), 0), min(_first_cell(cy + tall), rows)):
        dy = row + 0.5 - cy
        lo = max(dy * slope_u - reach_u, dy * slope_v - reach_v)
        hi = min(dy * slope_u + reach_u, dy * slope_v + reach_v)
        if not lo < hi:
            continue
        left, right = min(max(_first_cell(cx + lo), 0), columns), min(max(_first_cell(cx + hi), 0), columns)
        if right <= left or small[row, right, 0] == small[row, left, 0]:
            continue
        begin, end = left, right
        if abs(cos) <= 1e-12:
            end = right if dy * sin > 0.0 else left
        else:
            cut = min(max(_first_cell(cx + min(max(dy * slope_u, lo), hi)), left), right)
            begin, end = (cut, right) if right_u else (left, cut)
        by_u = _with_part(by_u, tables, row, (begin, end), (x0, y0))
        begin, end = left, right
        if abs(sin) <= 1e-12:
            end = right if dy * cos > 0.0 else left
        else:
            cut = min(max(_first_cell(cx + min(max(dy * slope_v, lo), hi)), left), right)
            begin, end = (cut, right) if right_v else (left, cut)
        by_v = _with_part(by_v, tables, row, (begin, end), (x0, y0))
    ox, oy = x0 + 0.5 - cx, y0 + 0.5 - cy
    n_u, x_u, y_u, h_u, xh_u, yh_u = by_u
    n_v, x_v, y_v, h_v, xh_v, yh_v = by_v
    return (
        (x_u + ox * n_u) * cos + (y_u + oy * n_u) * sin,
        0.01 * ((xh_u + ox * h_u) * cos + (yh_u + oy * h_u) * sin),
        (y_v + oy * n_v) * cos - (x_v + ox * n_v) * sin,
        0.01 * ((yh_v + oy * h_v) * cos - (xh_v + ox * h_v) * sin),
    )


@kernel
def scan_hip(tables: Tables, rectangle: Rectangles) -> tuple[float, float, float]:
    """Return the sums of t, tt and th of a hip roof, t = max(|v|, |u| - ridge), the rectangle given with a >= b."""
    small = tables.small
    rows, columns = small.shape[0], small.shape[1] - 1
    cx, cy = rectangle[0], rectangle[1]
    cos, sin, tall, slope_u, reach_u, slope_v, reach_v = _lines(rectangle)
    ridge = 0.5 * (rectangle[2] - rectangle[3])
    x0 = np.int64(math.floor(cx))
    ox = x0 + 0.5 - cx
    cuts = np.empty(6)
    t, tt, th = 0.0, 0.0, 0.0
    for row in range(max(_first_cell(cy - tall), 0), min(_first_cell(cy + tall), rows)):
        dy = row + 0.5 - cy
        lo = max(dy * slope_u - reach_u, dy * slope_v - reach_v)
        hi = min(dy * slope_u + reach_u, dy * slope_v + reach_v)
        if not lo < hi:
            continue
        left, right = min(max(_first_cell(cx + lo), 0), columns), min(max(_first_cell(cx + hi), 0), columns)
        if right <= left or small[row, right, 0] == small[row, left, 0]:
            continue
        # The row crosses v = 0 and the lines of the hips u + i v = j ridge.
        many = 0
        for line in range(5):
            if line == 0:
                slope, level = -sin, -dy * cos
            else:
                i = 1.0 if line <= 2 else -1.0
                j = 1.0 if line % 2 == 1 else -1.0
                slope = cos - i * sin
                level = j * ridge - dy * (sin + i * cos)
            if abs(slope) > 1e-12:
                cut = level / slope
                if lo < cut < hi:
                    k = many
                    while k > 0 and cuts[k - 1] > cut:
                        cuts[k] = cuts[k - 1]
                        k -= 1
                    cuts[k] = cut
                    many += 1
        begin = left
        for part in range(many + 1):
            end = min(max(_first_cell(cx + cuts[part]), left), right) if part < many else right
            if end > begin:
                dx = 0.5 * (begin + end) - cx
                u, v = dx * cos + dy * sin, dy * cos - dx * sin
                n, x, xx, h, xh, _ = part_sums(tables, row, begin, end, x0)
                # In this part of the row t = east dx + rest.
                if abs(u) - ridge <= abs(v):
                    sign = 1.0 if v >= 0.0 else -1.0
                    east, rest = -sign * sin, sign * dy * cos
                else:
                    sign = 1.0 if u >= 0.0 else -1.0
                    east, rest = sign * cos, sign * dy * sin - ridge
                rest += east * ox
                t += east * x + rest * n
                tt += east * east * xx + 2.0 * east * rest * x + rest * rest * n
                th += 0.01 * (east * xh + rest * h)
                begin = end
    return t, tt, th
