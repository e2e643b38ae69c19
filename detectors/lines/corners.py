"""Corners of curves by chord-to-point distance accumulation (CPDA).

Nouns
-----
chord
    Straight line between two points of a curve, L curve points apart.
accumulated distance
    h_L(k) = | sum of the signed distances of point k from all chords of length L that span it |: large where the curve
    turns, and less noisy than the curvature from derivatives.
candidate
    Local maximum, along a curve, of the squared displacement between two smoothings (sigma 4 and 3).

A candidate is a corner when the product of its accumulated distances for three chord lengths, each divided by its
maximum along the curve, exceeds a threshold, and when the angle of the curve there is not nearly straight. Source:
Awrangjeb, Lu, Fraser & Ravanbakhsh (2009), the corner detector that the 2010 paper names in section 3.3.1.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .contours import Curves, smooth

__all__ = ["CHORDS", "find_corners"]

#: Chord lengths, curve points.
CHORDS = (10, 20, 30)
#: Difference of the two smoothings that candidates come from, curve points.
_WIDER = 1.0


@kernel
def accumulated_distance(curve: NDArray[np.float64], chord: int, closed: bool) -> NDArray[np.float64]:
    """Return h_L(k) for every point of one curve, shape (n,); chords beyond the end of an open curve do not exist."""
    n = len(curve)
    out = np.zeros(n)
    x, y = curve[:, 0].copy(), curve[:, 1].copy()
    starts = n if closed else max(n - chord, 0)
    dx, dy = np.empty(starts), np.empty(starts)
    for start in range(min(starts, n - chord)):
        i, end = np.uintp(start), np.uintp(start) + np.uintp(chord)  # unsigned: no index from the end
        dx[i], dy[i] = x[end] - x[i], y[end] - y[i]
    for start in range(max(n - chord, 0), starts):
        dx[start], dy[start] = x[start + chord - n] - x[start], y[start + chord - n] - y[start]
    for start in range(starts):
        # np.divide has no test for zero, which would prevent vectorisation: a chord of no length has no direction.
        scale = np.divide(1.0, max(math.sqrt(dx[start] * dx[start] + dy[start] * dy[start]), 1e-9))
        dx[start] *= scale
        dy[start] *= scale
    # The inner loop runs over neighbours in memory, and each point adds up its chords in the order of their starts:
    # those over the end of a closed curve last.
    for step in range(chord - 1, 0, -1):
        for start in range(min(starts, n - step)):
            i, to = np.uintp(start), np.uintp(start) + np.uintp(step)
            out[to] += (x[to] - x[i]) * dy[i] - (y[to] - y[i]) * dx[i]
    for step in range(chord - 1, 0, -1):
        for k in range(starts + step - n):
            start = n - step + k
            out[k] += (x[k] - x[start]) * dy[start] - (y[k] - y[start]) * dx[start]
    for k in range(n):
        out[k] = abs(out[k])
    return out


@kernel
def _turn(curve: NDArray[np.float64], before: int, at: int, after: int) -> float:
    """Return the angle by which the path before -> at -> after turns, degrees; 0 is straight."""
    ax, ay = curve[at, 0] - curve[before, 0], curve[at, 1] - curve[before, 1]
    bx, by = curve[after, 0] - curve[at, 0], curve[after, 1] - curve[at, 1]
    return abs(math.degrees(math.atan2(ax * by - ay * bx, ax * bx + ay * by)))


@kernel
def _neighbours(corners: list[int], i: int, n: int, arm: int, closed: bool) -> tuple[int, int]:
    """Return the two points that define the angle at corner i: its neighbouring corners, or points `arm` away."""
    at = corners[i]
    if closed:
        if len(corners) >= 3:
            return corners[i - 1], corners[(i + 1) % len(corners)]
        arm = min(arm, n // 3)
        return (at - arm) % n, (at + arm) % n
    before = corners[i - 1] if i > 0 else 0
    after = corners[i + 1] if i + 1 < len(corners) else n - 1
    return before, after


@kernel
def _turn_at(curve: NDArray[np.float64], corners: list[int], i: int, arm: int, closed: bool) -> float:
    """Return the angle by which the curve turns at corner i, degrees."""
    before, after = _neighbours(corners, i, len(curve), arm, closed)
    return float(_turn(curve, before, corners[i], after))


@kernel
def corners_of_curve(
    curve: NDArray[np.float64],
    wider: NDArray[np.float64],
    closed: bool,
    chords: tuple[int, int, int],
    product: float,
    least_turn: float,
) -> NDArray[np.int64]:
    """Return the indices of the corners of one curve, in order; `wider` is the same curve smoothed more."""
    n = len(curve)
    strength = np.ones(n)
    for chord in chords:
        span = min(chord, n // 2)
        if span < 2:
            return np.empty(0, dtype=np.int64)
        h = accumulated_distance(curve, span, closed)
        highest = 0.0
        for k in range(n):
            highest = max(highest, h[k])
        for k in range(n):
            strength[k] *= h[k] / highest if highest > 0 else h[k]
    moved = np.empty(n)
    for k in range(n):
        dx, dy = curve[k, 0] - wider[k, 0], curve[k, 1] - wider[k, 1]
        moved[k] = dx * dx + dy * dy
    corners = [0 for _ in range(0)]
    for k in range(n):
        if closed:
            is_peak = moved[k] > moved[k - 1] and moved[k] >= moved[(k + 1) % n]
        else:
            is_peak = 0 < k < n - 1 and moved[k] > moved[k - 1] and moved[k] >= moved[k + 1]
        if is_peak and strength[k] > product:
            corners.append(k)
    # The flattest corner is removed first, because that changes the angles of its neighbours.
    turns = [_turn_at(curve, corners, i, chords[2], closed) for i in range(len(corners))]
    while len(corners) > 0:
        flattest, flattest_turn = -1, least_turn
        for i in range(len(corners)):
            if turns[i] < flattest_turn:
                flattest, flattest_turn = i, turns[i]
        if flattest < 0:
            break
        corners.pop(flattest)
        turns.pop(flattest)
        left = len(corners)
        for i in range(left):
            beside = i in (flattest - 1, flattest) or (closed and (i - flattest) % left in (0, left - 1))
            if beside or (closed and left < 3):
                turns[i] = _turn_at(curve, corners, i, chords[2], closed)
    return np.array(corners, dtype=np.int64)


@kernel
def _corners_of_all(
    points: NDArray[np.float64],
    wider: NDArray[np.float64],
    offsets: NDArray[np.int64],
    closed: bool,
    chords: tuple[int, int, int],
    product: float,
    least_turn: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    found = np.empty(len(points), dtype=np.int64)
    out_offsets = np.zeros(len(offsets), dtype=np.int64)
    n = 0
    for i in range(len(offsets) - 1):
        first, last = offsets[i], offsets[i + 1]
        corners = corners_of_curve(points[first:last], wider[first:last], closed, chords, product, least_turn)
        for corner in corners:
            found[n] = corner
            n += 1
        out_offsets[i + 1] = n
    return found[:n].copy(), out_offsets


def find_corners(
    curves: Curves, *, sigma: float, product: float, straight: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Smooth the curves and find their corners.

    Parameters
    ----------
    sigma : float
        Of the Gaussian that the curves are smoothed with, curve points.
    product : float
        Least product of the three normalised accumulated distances.
    straight : tuple of float
        Interior angles that are no corner, degrees: 157 to 203.

    Returns
    -------
    points : ndarray, shape (n, 2)
        The smoothed curves.
    corners : ndarray of int64
        Indices within their curve.
    offsets : ndarray of int64, shape (curves + 1,)
        Corners of curve i are ``corners[offsets[i]:offsets[i + 1]]``.
    """
    points = smooth(curves, sigma)
    wider = smooth(curves, sigma + _WIDER)
    least_turn = min(180.0 - straight[0], straight[1] - 180.0)
    corners, offsets = _corners_of_all(points, wider, curves.offsets, curves.closed, CHORDS, product, least_turn)
    return points, corners, offsets
