"""Roofs: what the cells inside a rectangle say about the surface above it.

Nouns
-----
moments
    n, sums of x, y, xx, xy, yy, h, xh, yh, hh over high cells (lengths in cells from the centre, heights in metres),
    of each of four faces, shape (4, 10). Faces of a scan by quadrants: bit 0 set where u >= 0, bit 1 where v >= 0.
roof
    A surface over the rectangle: `FLAT` h = m; `PLANE` h = m + p u + q v; `GABLE_U`, `GABLE_V` h = m - s t with
    t = |v| (ridge along u) or |u|; `HIP` with t = max(|v|, |u| - (a - b)/2) for a >= b (a pyramid when a = b).
tau
    Standard deviation of heights around the roof, metres, not less than the least one that a real roof has.

A roof is chosen by its Gaussian log-likelihood with tau profiled, less a price for each number it has more than a flat
one. Source of the flat one: Yu, Li, Guan & Wang (2013), equation 1; the others are ours (docs/mpp.md).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .rectangles import row_span
from .tables import MILLI

__all__ = ["FLAT", "GABLE_U", "GABLE_V", "HIP", "KINDS", "PLANE", "fit_roof", "log_likelihood", "scan"]

FLAT, PLANE, GABLE_U, GABLE_V, HIP = 0, 1, 2, 3, 4
#: Names of the roofs, by their number.
KINDS = ("flat", "plane", "gable", "gable", "hip")

#: A hip is tried where a gable won and that along the longer side falls by at least this, metres per metre.
_STEEP = 0.12


@njit(cache=True, nogil=True, inline="always")
def _first_cell(x):  # type: ignore[no-untyped-def]
    """Index of the first cell whose centre is not left of x, for x > -1e6 (a ceiling that compiles to one step)."""
    return 1048576 - int(1048576.5 - x)


@njit(cache=True, nogil=True, inline="always")
def _add(small, large, row, first, last, sums, face):  # type: ignore[no-untyped-def]
    """Add the cells first..last of a row to the whole-number sums of a face."""
    n = np.int64(small[row, last, 0] - small[row, first, 0])
    x = np.int64(small[row, last, 1] - small[row, first, 1])
    h = np.int64(small[row, last, 2] - small[row, first, 2])
    sums[face, 0] += n
    sums[face, 1] += x
    sums[face, 2] += row * n
    sums[face, 3] += large[row, last, 0] - large[row, first, 0]
    sums[face, 4] += row * x
    sums[face, 5] += row * row * n
    sums[face, 6] += h
    sums[face, 7] += large[row, last, 1] - large[row, first, 1]
    sums[face, 8] += row * h
    sums[face, 9] += large[row, last, 2] - large[row, first, 2]


@njit(cache=True, nogil=True)
def _centre(sums, cx, cy, cos, sin, moments):  # type: ignore[no-untyped-def]
    """Turn whole-number sums into moments along u and v about the centre, heights in metres.

    The origin is first moved to the cell of the centre in whole numbers, so that nothing depends on where the grid
    begins.
    """
    x0, y0 = np.int64(math.floor(cx)), np.int64(math.floor(cy))
    ox, oy = x0 + 0.5 - cx, y0 + 0.5 - cy
    for q in range(sums.shape[0]):
        count = sums[q, 0]
        m = moments[q]
        if count == 0:
            m[:] = 0.0
            continue
        x_0, y_0 = sums[q, 1] - x0 * count, sums[q, 2] - y0 * count
        xx_0 = sums[q, 3] - 2 * x0 * sums[q, 1] + x0 * x0 * count
        yy_0 = sums[q, 5] - 2 * y0 * sums[q, 2] + y0 * y0 * count
        xy_0 = sums[q, 4] - y0 * sums[q, 1] - x0 * sums[q, 2] + x0 * y0 * count
        n, h = float(count), 0.01 * sums[q, 6]
        x, y = x_0 + ox * n, y_0 + oy * n
        xx = xx_0 + 2.0 * ox * x_0 + ox * ox * n
        yy = yy_0 + 2.0 * oy * y_0 + oy * oy * n
        xy = xy_0 + ox * y_0 + oy * x_0 + ox * oy * n
        xh = 0.01 * (sums[q, 7] - x0 * sums[q, 6]) + ox * h
        yh = 0.01 * (sums[q, 8] - y0 * sums[q, 6]) + oy * h
        m[0], m[1], m[2] = n, x * cos + y * sin, y * cos - x * sin
        m[3] = xx * cos * cos + 2.0 * xy * cos * sin + yy * sin * sin
        m[4] = (yy - xx) * cos * sin + xy * (cos * cos - sin * sin)
        m[5] = xx * sin * sin - 2.0 * xy * cos * sin + yy * cos * cos
        m[6] = h
        m[7], m[8] = xh * cos + yh * sin, yh * cos - xh * sin
        m[9] = 1e-4 * sums[q, 9]


@njit(cache=True, nogil=True)
def scan(small, large, rectangle, moments):  # type: ignore[no-untyped-def]
    """Fill the moments of the four quadrants of a rectangle, about its centre along u and v.

    Returns
    -------
    score : float
        Sum of the scores of its cells, nats.
    outside : float
        How many of its cells are not on the grid.
    """
    rows, columns = small.shape[0], small.shape[1] - 1
    cx, cy, half_a, half_b = rectangle[0], rectangle[1], 0.5 * rectangle[2], 0.5 * rectangle[3]
    cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
    sums = np.zeros((4, 10), dtype=np.int64)
    score, outside = 0, 0
    tangent = sin / cos if abs(cos) > 1e-12 else 1e12
    cotangent = cos / sin if abs(sin) > 1e-12 else 1e12
    tall = half_a * abs(sin) + half_b * abs(cos)
    for row in range(_first_cell(cy - tall), _first_cell(cy + tall)):
        dy = row + 0.5 - cy
        lo, hi = row_span(dy, half_a, half_b, cos, sin)
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
        # Where the row crosses u = 0 and v = 0.
        cut_u, cut_v = -dy * tangent, dy * cotangent
        near, far = min(cut_u, cut_v), max(cut_u, cut_v)
        begin = left
        for part in range(3):
            end = right
            if part == 0:
                end = min(max(_first_cell(cx + near), left), right) if near < hi else right
            elif part == 1:
                end = min(max(_first_cell(cx + far), left), right) if far < hi else right
            if end > begin:
                dx = 0.5 * (begin + end) - cx
                q = (1 if dx * cos + dy * sin >= 0.0 else 0) + (2 if dy * cos - dx * sin >= 0.0 else 0)
                _add(small, large, row, begin, end, sums, q)
                begin = end
    _centre(sums, cx, cy, cos, sin, moments)
    return score / MILLI, float(outside)


@njit(cache=True, nogil=True)
def _scan_hip(small, large, rectangle, moments):  # type: ignore[no-untyped-def]
    """Fill the moments of the four faces of a hip roof: 0, 1 the sides v < 0, v >= 0; 2, 3 the ends u < 0, u >= 0.

    The rectangle is given with a >= b.
    """
    rows, columns = small.shape[0], small.shape[1] - 1
    cx, cy, half_a, half_b = rectangle[0], rectangle[1], 0.5 * rectangle[2], 0.5 * rectangle[3]
    cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
    ridge = half_a - half_b
    sums = np.zeros((4, 10), dtype=np.int64)
    cuts = np.empty(6)
    tall = half_a * abs(sin) + half_b * abs(cos)
    for row in range(max(_first_cell(cy - tall), 0), min(_first_cell(cy + tall), rows)):
        dy = row + 0.5 - cy
        lo, hi = row_span(dy, half_a, half_b, cos, sin)
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
                face = (1 if v >= 0.0 else 0) if abs(u) - ridge <= abs(v) else (3 if u >= 0.0 else 2)
                _add(small, large, row, begin, end, sums, face)
                begin = end
    _centre(sums, cx, cy, cos, sin, moments)


@njit(cache=True, nogil=True)
def log_likelihood(n, residual, least_tau):  # type: ignore[no-untyped-def]
    """Gaussian log-likelihood of n heights whose squared residuals sum up to `residual`, tau profiled."""
    variance = max(residual / n, least_tau * least_tau)
    return -0.5 * n * math.log(2.0 * math.pi * variance) - 0.5 * residual / variance


@njit(cache=True, nogil=True)
def _ridge_residual(n, t, tt, h, th, level):  # type: ignore[no-untyped-def]
    """Residual of h = m - s t with s > 0, and s; the flat residual `level` when the roof does not fall outwards."""
    spread = tt - t * t / n
    if spread <= 1e-9:
        return level, 0.0
    slope = (th - t * h / n) / spread
    if slope >= 0.0:
        return level, 0.0
    return max(level - slope * slope * spread, 0.0), -slope


@njit(cache=True, nogil=True)
def _plane_residual(total, level):  # type: ignore[no-untyped-def]
    """Residual of the best plane, from the sums of all four quadrants."""
    n = total[0]
    uu, uv = total[3] - total[1] * total[1] / n, total[4] - total[1] * total[2] / n
    vv = total[5] - total[2] * total[2] / n
    uh, vh = total[7] - total[1] * total[6] / n, total[8] - total[2] * total[6] / n
    determinant = uu * vv - uv * uv
    if determinant <= 1e-9 * (uu * vv + 1.0):
        return level
    explained = (uh * uh * vv - 2.0 * uh * vh * uv + vh * vh * uu) / determinant
    return max(level - explained, 0.0)


@njit(cache=True, nogil=True)
def fit_roof(small, large, rectangle, roof_price, least_tau, least_height, cell, fit):  # type: ignore[no-untyped-def]
    """Choose the roof of a rectangle.

    Parameters
    ----------
    small, large : tables
    rectangle : ndarray, shape (5,)
    roof_price : float
        Nats per number that a roof has more than a flat one; infinite allows flat roofs alone.
    least_tau, least_height : float
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
    q = np.empty((4, 10))
    score, outside = scan(small, large, rectangle, q)
    total = np.empty(10)
    for k in range(10):
        total[k] = q[0, k] + q[1, k] + q[2, k] + q[3, k]
    n = total[0]
    fit[:] = 0.0
    fit[2] = least_tau
    if n < 1.0:
        return 0.0, score, outside
    mean = total[6] / n
    level = max(total[9] - total[6] * mean, 0.0)
    if mean < least_height:
        level += n * (least_height - mean) ** 2
    residual, kind, slope = level, FLAT, 0.0
    best = log_likelihood(n, level, least_tau)
    if mean >= least_height and n >= 8.0 and roof_price < np.inf:
        trial = _plane_residual(total, level)
        value = log_likelihood(n, trial, least_tau) - 2.0 * roof_price
        if value > best:
            best, residual, kind = value, trial, PLANE
        along_u, slope_u = _ridge_residual(
            n, q[2, 2] + q[3, 2] - q[0, 2] - q[1, 2], total[5], total[6], q[2, 8] + q[3, 8] - q[0, 8] - q[1, 8], level
        )
        value = log_likelihood(n, along_u, least_tau) - roof_price
        if value > best:
            best, residual, kind, slope = value, along_u, GABLE_U, slope_u / cell
        along_v, slope_v = _ridge_residual(
            n, q[1, 1] + q[3, 1] - q[0, 1] - q[2, 1], total[3], total[6], q[1, 7] + q[3, 7] - q[0, 7] - q[2, 7], level
        )
        value = log_likelihood(n, along_v, least_tau) - roof_price
        if value > best:
            best, residual, kind, slope = value, along_v, GABLE_V, slope_v / cell
        steep = (slope_u if rectangle[2] >= rectangle[3] else slope_v) / cell
        if kind >= GABLE_U and steep > _STEEP and residual > n * least_tau * least_tau:
            trial, slope_h = _hip_residual(small, large, rectangle, q, n, total[6], level)
            value = log_likelihood(n, trial, least_tau) - roof_price
            if value > best:
                best, residual, kind, slope = value, trial, HIP, slope_h / cell
    fit[0], fit[1], fit[2], fit[3], fit[4] = n, mean, max(math.sqrt(residual / n), least_tau), kind, slope
    return best, score, outside


@njit(cache=True, nogil=True)
def _hip_residual(small, large, rectangle, q, n, h, level):  # type: ignore[no-untyped-def]
    longer = rectangle.copy()
    if longer[2] < longer[3]:
        longer[2], longer[3], longer[4] = rectangle[3], rectangle[2], rectangle[4] + 0.5 * math.pi
    ridge = 0.5 * (longer[2] - longer[3])
    _scan_hip(small, large, longer, q)
    t, tt, th = 0.0, 0.0, 0.0
    for face in range(4):
        m = q[face]
        sign = 1.0 if face % 2 == 1 else -1.0
        if face < 2:
            t += sign * m[2]
            tt += m[5]
            th += sign * m[8]
        else:
            t += sign * m[1] - ridge * m[0]
            tt += m[3] - 2.0 * sign * ridge * m[1] + ridge * ridge * m[0]
            th += sign * m[7] - ridge * m[6]
    return _ridge_residual(n, t, tt, h, th, level)
