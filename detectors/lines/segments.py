"""Segments: the straight pieces of curves between corners, as fitted lines.

A *segment* is all curve points between two corners (of an open curve also between a corner and an end); its *line* is
the total least-squares line through them, which ends at the projections of the first and last point before smoothing.
Lines are boxes without width (see `boxes`), directed so that black lies across: the inside point P_in of the paper is
three pixels to that side.
Source: Awrangjeb, Ravanbakhsh & Fraser (2010), section 3.3.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .boxes import OX, OY, U0, U1, UX, UY, V0, V1, Boxes, lengths
from .contours import Curves

__all__ = ["Segments", "beyond_coverage", "fit_line", "fit_segments", "inside_first"]


@dataclass(frozen=True, eq=False)
class Segments:
    """Fitted lines.

    Attributes
    ----------
    lines : ndarray, shape (n, 8)
        Boxes without width; the origin is the middle of the line.
    shapes : ndarray of int64, shape (n,)
        Black shape (or image edge) that each lies along.
    """

    lines: Boxes
    shapes: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.lines)

    def take(self, index: NDArray[np.bool_] | NDArray[np.intp]) -> Segments:
        """Return the segments at `index`."""
        return Segments(self.lines[index], self.shapes[index])


@kernel
def fit_line(points: NDArray[np.float64], raw: NDArray[np.float64], first: int, count: int) -> NDArray[np.float64]:
    """Return the line fitted to a piece of a curve, a box without width, shape (8,).

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        A closed or open curve.
    raw : ndarray, shape (n, 2)
        The same curve before smoothing, which moves it away from its corners. The line ends where the first and the
        last raw point project onto it.
    first, count : int
        Index of the first point of the piece, and its number of points; indices wrap around.
    """
    n = len(points)
    start = first % n
    mx = my = 0.0
    at = start
    for _ in range(count):
        mx += points[at, 0]
        my += points[at, 1]
        at = at + 1 if at + 1 < n else 0
    mx /= count
    my /= count
    xx = xy = yy = 0.0
    at = start
    for _ in range(count):
        dx, dy = points[at, 0] - mx, points[at, 1] - my
        xx += dx * dx
        xy += dx * dy
        yy += dy * dy
        at = at + 1 if at + 1 < n else 0
    angle = 0.5 * math.atan2(2 * xy, xx - yy)
    ux, uy = math.cos(angle), math.sin(angle)
    a, b = start, (first + count - 1) % n
    t0 = (raw[a, 0] - mx) * ux + (raw[a, 1] - my) * uy
    t1 = (raw[b, 0] - mx) * ux + (raw[b, 1] - my) * uy
    if t1 < t0:
        ux, uy, t0, t1 = -ux, -uy, -t0, -t1
    middle, half = (t0 + t1) / 2, (t1 - t0) / 2
    line = np.zeros(8)
    line[OX], line[OY], line[UX], line[UY] = mx + middle * ux, my + middle * uy, ux, uy
    line[U0], line[U1] = -half, half
    return line


@kernel
def _deviation(points: NDArray[np.float64], first: int, count: int, line: NDArray[np.float64]) -> tuple[float, int]:
    """Return the root mean square distance of a piece of curve from its line, and its point farthest from its chord."""
    n = len(points)
    total, farthest, most = 0.0, 0, -1.0
    a, b = first % n, (first + count - 1) % n
    dx, dy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    at = a
    for k in range(count):
        off = (points[at, 1] - line[OY]) * line[UX] - (points[at, 0] - line[OX]) * line[UY]
        total += off * off
        aside = abs((points[at, 1] - points[a, 1]) * dx - (points[at, 0] - points[a, 0]) * dy)
        if aside > most:
            farthest, most = k, aside
        at = at + 1 if at + 1 < n else 0
    return math.sqrt(total / count), farthest


@kernel
def _fit_pieces(
    points: NDArray[np.float64],
    raw: NDArray[np.float64],
    first: int,
    count: int,
    shortest: float,
    deviation: float,
) -> list[NDArray[np.float64]]:
    """Return the lines of a piece of curve, split where it is farthest from its chord while it deviates too much."""
    lines = [np.empty(8) for _ in range(0)]
    waiting = [(first, count)]
    while len(waiting) > 0:
        piece, length = waiting.pop()
        if length < 2:
            continue
        line = fit_line(points, raw, piece, length)
        off, farthest = _deviation(points, piece, length, line)
        if off > deviation and 0 < farthest < length - 1:
            waiting.append((piece + farthest, length - farthest))
            waiting.append((piece, farthest + 1))
        elif line[U1] - line[U0] >= shortest:
            lines.append(line)
    return lines


@kernel
def _fit_all(
    points: NDArray[np.float64],
    raw: NDArray[np.float64],
    offsets: NDArray[np.int64],
    closed: bool,
    corners: NDArray[np.int64],
    corner_offsets: NDArray[np.int64],
    shortest: float,
    deviation: float,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    lines = [np.empty(8) for _ in range(0)]
    owner = [0 for _ in range(0)]
    for i in range(len(offsets) - 1):
        start, end = offsets[i], offsets[i + 1]
        n = end - start
        ends = corners[corner_offsets[i] : corner_offsets[i + 1]]
        pieces = len(ends) + 1
        if closed:
            pieces = len(ends) if len(ends) >= 2 else 0
        for j in range(pieces):
            if closed:
                first, last = ends[j], ends[(j + 1) % len(ends)]
                count = (last - first) % n + 1
            else:
                first = ends[j - 1] if j > 0 else 0
                last = ends[j] if j < len(ends) else n - 1
                count = last - first + 1
            for line in _fit_pieces(points[start:end], raw[start:end], first, count, shortest, deviation):
                lines.append(line)
                owner.append(i)
    packed = np.empty((len(lines), 8))
    for k in range(len(lines)):
        packed[k] = lines[k]
    return packed, np.array(owner, dtype=np.int64)


def fit_segments(
    curves: Curves,
    points: NDArray[np.float64],
    corners: NDArray[np.int64],
    corner_offsets: NDArray[np.int64],
    *,
    shortest: float,
    deviation: float = math.inf,
) -> Segments:
    """Return a line fitted to each piece between corners; a closed curve with fewer than two corners has none.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        The smoothed points of the curves.
    corners, corner_offsets
        As `find_corners` returns them.
    shortest : float
        Shorter lines are dropped, pixels.
    deviation : float
        Largest root mean square distance of a piece from its line, pixels. A piece above it contains a missed corner
        and is split where it is farthest from its chord.
    """
    lines, owner = _fit_all(
        points, curves.points, curves.offsets, curves.closed, corners, corner_offsets, shortest, deviation
    )
    return Segments(lines, curves.shapes[owner])


def inside_first(lines: Boxes, black: NDArray[np.uint8], *, reach: float, outset: float) -> Boxes:
    """Return the lines directed so that black lies across, moved and lengthened by `outset` pixels.

    The black side is where the point `reach` pixels from the middle is black; where both points are equal, the
    direction along the contour is kept. Contour points are centres of black pixels, so the edge of the mask is half a
    pixel farther out, at its corners in both directions.
    """
    rows, columns = black.shape

    def is_black(distance: float) -> NDArray[np.bool_]:
        x = np.floor(lines[:, OX] - distance * lines[:, UY]).astype(np.intp)
        y = np.floor(lines[:, OY] + distance * lines[:, UX]).astype(np.intp)
        on = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        values = black[np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)]
        return np.asarray(on & (values > 0), dtype=np.bool_)

    turned = lines.copy()
    wrong = ~is_black(reach) & is_black(-reach)
    turned[wrong, UX] *= -1
    turned[wrong, UY] *= -1
    turned[:, OX] += outset * turned[:, UY]
    turned[:, OY] -= outset * turned[:, UX]
    half = lengths(turned) / 2 + outset
    turned[:, U0], turned[:, U1] = -half, half
    turned[:, V0] = turned[:, V1] = 0.0
    return turned


def beyond_coverage(lines: Boxes, coverage: NDArray[np.uint8], reach: float) -> NDArray[np.bool_]:
    """Return which lines have no measurements on their outer side: the border of the points or of the image."""
    rows, columns = coverage.shape
    x = np.floor(lines[:, OX] + reach * lines[:, UY]).astype(np.intp)
    y = np.floor(lines[:, OY] - reach * lines[:, UX]).astype(np.intp)
    on = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    covered = coverage[np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)] > 0
    return np.asarray(~(on & covered), dtype=np.bool_)
