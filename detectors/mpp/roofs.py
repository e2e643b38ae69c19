"""Roofs: what the cells inside a rectangle say about the surface above it.

Nouns
-----
moments
    n, sums of u, v, uu, uv, vv, h, uh, vh, hh over the high cells of a rectangle: place u, v in cells from the centre
    along its sides, height in metres.
roof
    A surface over the rectangle: `FLAT` h = m; `PLANE` h = m + p u + q v; `GABLE_U`, `GABLE_V` h = m - s t with
    t = |v| (ridge along u) or |u|; `HIP` with t = max(|v|, |u| - (a - b)/2) for a >= b (a pyramid when a = b).
tau
    Standard deviation of heights around the roof, metres, not less than the least one that a real roof has.

A roof is chosen by its Gaussian log-likelihood with tau profiled, less a price for each number it has more than a flat
one. Source of the flat one: Yu, Li, Guan & Wang (2013), equation 1; the others are ours (docs/results/mpp.md).
"""

from __future__ import annotations

import math

import numpy as np

from ...core.kernels import kernel
from .tables import MILLI, part_sums

__all__ = [
    "FLAT",
    "GABLE_U",
    "GABLE_V",
    "HIP",
    "KINDS",
    "PLANE",
    "choose_roof",
    "fit_roof",
    "log_likelihood",
    "scan",
    "scan_halves",
]

FLAT, PLANE, GABLE_U, GABLE_V, HIP = 0, 1, 2, 3, 4
#: Names of the roofs, by their number.
KINDS = ("flat", "plane", "gable", "gable", "hip")

#: A hip is tried where a gable won and that along the longer side falls by at least this, metres per metre.
_STEEP = 0.12


@kernel(inline="always")
def _first_cell(x):  # type: ignore[no-untyped-def]
    """Index of the first cell whose centre is not left of x, for x > -1e6 (a ceiling that compiles to one step)."""
    return 1048576 - int(1048576.5 - x)


@kernel
def _lines(rectangle):  # type: ignore[no-untyped-def]
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
def scan(small, large, rectangle):  # type: ignore[no-untyped-def]
    """Add up the cells of a rectangle.

    Sums are whole numbers about the cell of the centre, so that nothing depends on where the grid begins.

    Returns
    -------
    score : float
        Sum of the scores of its cells, nats.
    outside : float
        How many of its cells are not on the grid.
    n, u, v, uu, uv, vv, h, uh, vh, hh : float
        Its moments.
    """
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
        n_r, x_r, xx_r, h_r, xh_r, hh_r = part_sums(small, large, row, left, right, x0)
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
    return (
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
def _with_part(sums, small, large, row, begin, end, x0, y0):  # type: ignore[no-untyped-def]
    """Return the sums of 1, x, y, h, xh and yh, those over a part of a row added; nothing where it is empty."""
    if end <= begin:
        return sums
    n, x, y, h, xh, yh = sums
    n_r, x_r, _, h_r, xh_r, _ = part_sums(small, large, row, begin, end, x0)
    j = row - y0
    return n + n_r, x + x_r, y + j * n_r, h + h_r, xh + xh_r, yh + j * h_r


@kernel
def scan_halves(small, large, rectangle):  # type: ignore[no-untyped-def]
    """Return the sums of u and uh over the cells with u > 0, and of v and vh over those with v > 0."""
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
        by_u = _with_part(by_u, small, large, row, begin, end, x0, y0)
        begin, end = left, right
        if abs(sin) <= 1e-12:
            end = right if dy * cos > 0.0 else left
        else:
            cut = min(max(_first_cell(cx + min(max(dy * slope_v, lo), hi)), left), right)
            begin, end = (cut, right) if right_v else (left, cut)
        by_v = _with_part(by_v, small, large, row, begin, end, x0, y0)
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
def _scan_hip(small, large, rectangle):  # type: ignore[no-untyped-def]
    """Return the sums of t, tt and th of a hip roof, t = max(|v|, |u| - ridge), the rectangle given with a >= b."""
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
                n, x, xx, h, xh, _ = part_sums(small, large, row, begin, end, x0)
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


@kernel
def log_likelihood(n, residual, least_tau):  # type: ignore[no-untyped-def]
    """Gaussian log-likelihood of n heights whose squared residuals sum up to `residual`, tau profiled; 0 of none."""
    variance = max(residual / max(n, 1.0), least_tau * least_tau)
    return -0.5 * n * math.log(2.0 * math.pi * variance) - 0.5 * residual / variance


@kernel
def _ridge_residual(n, t, tt, h, th, level):  # type: ignore[no-untyped-def]
    """Residual of h = m - s t with s > 0, and s; the flat residual `level` when the roof does not fall outwards."""
    spread = tt - t * t / n
    if spread <= 1e-9:
        return level, 0.0
    slope = (th - t * h / n) / spread
    if slope >= 0.0:
        return level, 0.0
    return max(level - slope * slope * spread, 0.0), -slope


@kernel
def _plane_residual(n, u, v, uu, uv, vv, h, uh, vh, level):  # type: ignore[no-untyped-def]
    """Residual of the best plane."""
    uu, uv, vv = uu - u * u / n, uv - u * v / n, vv - v * v / n
    uh, vh = uh - u * h / n, vh - v * h / n
    determinant = uu * vv - uv * uv
    if determinant <= 1e-9 * (uu * vv + 1.0):
        return level
    explained = (uh * uh * vv - 2.0 * uh * vh * uv + vh * vh * uu) / determinant
    return max(level - explained, 0.0)


@kernel
def choose_roof(small, large, rectangle, moments, roof_price, least_tau, explained, least_height, cell, needed):  # type: ignore[no-untyped-def]
    """Choose the roof of a rectangle from its moments.

    Parameters
    ----------
    small, large : tables
    rectangle : ndarray, shape (5,)
    moments : tuple of float
        As `scan` returns them.
    roof_price, least_tau, explained, least_height, cell : float
        See `fit_roof`.
    needed : float
        Roofs that cannot be likelier than this are not tried: the likelihood is right if it is more than this, else
        it is some number that is not.

    Returns
    -------
    likelihood, residual, kind, slope
    """
    _, _, n, u, v, uu, uv, vv, h, uh, vh, hh = moments
    if n < 1.0:
        return 0.0, 0.0, FLAT, 0.0
    mean = h / n
    level = max(hh - h * mean, 0.0)
    if mean < least_height:
        level += n * (least_height - mean) ** 2
    residual, kind, slope = level, FLAT, 0.0
    slack = n * explained
    best = log_likelihood(n, max(level - slack, 0.0), least_tau)
    if mean < least_height or n < 8.0 or roof_price == np.inf:
        return best, residual, kind, slope
    at_best = log_likelihood(n, 0.0, least_tau) - roof_price
    if at_best <= max(best, needed):
        return best, residual, kind, slope
    trial = _plane_residual(n, u, v, uu, uv, vv, h, uh, vh, level)
    value = log_likelihood(n, max(trial - slack, 0.0), least_tau) - 2.0 * roof_price
    if value > best:
        best, residual, kind = value, trial, PLANE
    if at_best <= best:
        return best, residual, kind, slope
    u_half, uh_half, v_half, vh_half = scan_halves(small, large, rectangle)
    along_u, slope_u = _ridge_residual(n, 2.0 * v_half - v, vv, h, 2.0 * vh_half - vh, level)
    value = log_likelihood(n, max(along_u - slack, 0.0), least_tau) - roof_price
    if value > best:
        best, residual, kind, slope = value, along_u, GABLE_U, slope_u / cell
    along_v, slope_v = _ridge_residual(n, 2.0 * u_half - u, uu, h, 2.0 * uh_half - uh, level)
    value = log_likelihood(n, max(along_v - slack, 0.0), least_tau) - roof_price
    if value > best:
        best, residual, kind, slope = value, along_v, GABLE_V, slope_v / cell
    steep = (slope_u if rectangle[2] >= rectangle[3] else slope_v) / cell
    if kind >= GABLE_U and steep > _STEEP and residual - slack > n * least_tau * least_tau:
        trial, slope_h = _hip_residual(small, large, rectangle, n, h, level)
        value = log_likelihood(n, max(trial - slack, 0.0), least_tau) - roof_price
        if value > best:
            best, residual, kind, slope = value, trial, HIP, slope_h / cell
    return best, residual, kind, slope


@kernel
def fit_roof(small, large, rectangle, roof_price, least_tau, explained, least_height, cell, fit):  # type: ignore[no-untyped-def]
    """Choose the roof of a rectangle.

    Parameters
    ----------
    small, large : tables
    rectangle : ndarray, shape (5,)
    roof_price : float
        Nats per number that a roof has more than a flat one; infinite allows flat roofs alone.
    least_tau : float
        Metres.
    explained : float
        Variance of heights, m2, that is no roof's: what exceeds it counts.
    least_height : float
        Metres. A roof whose mean height is below the least height is a flat one at the least height.
    cell : float
        Metres.
    fit : ndarray, shape (5,)
        Filled with n, mean height, tau, kind of roof, slope (metres per metre, 0 of a flat one).

    Returns
    -------
    likelihood : float
        Of the heights of its high cells under its roof, less the price; 0 without a high cell. Nats.
    score : float
        Sum of the scores of its cells, nats.
    outside : float
        How many of its cells are not on the grid.
    """
    moments = scan(small, large, rectangle)
    best, residual, kind, slope = choose_roof(
        small, large, rectangle, moments, roof_price, least_tau, explained, least_height, cell, -np.inf
    )
    n = max(moments[2], 1.0)
    fit[0], fit[1], fit[2] = moments[2], moments[8] / n, max(math.sqrt(residual / n), least_tau)
    fit[3], fit[4] = kind, slope
    return best, moments[0], moments[1]


@kernel
def _hip_residual(small, large, rectangle, n, h, level):  # type: ignore[no-untyped-def]
    longer = rectangle.copy()
    if longer[2] < longer[3]:
        longer[2], longer[3], longer[4] = rectangle[3], rectangle[2], rectangle[4] + 0.5 * math.pi
    t, tt, th = _scan_hip(small, large, longer)
    return _ridge_residual(n, t, tt, h, th, level)
