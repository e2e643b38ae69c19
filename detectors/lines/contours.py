"""Contours: the outlines of black shapes as evenly sampled, smoothed curves.

Nouns
-----
shape
    A connected black area of the primary mask.
curve
    Closed outline of a shape (outer) or of a white hole in it (inner), or an open chain of image edge pixels: points
    (x, y) in pixel coordinates, evenly spaced along it.
curves
    Several curves in one array: curve i is ``points[offsets[i]:offsets[i + 1]]``.

The paper runs the Canny detector on the binary mask and links the edges; tracing the contour gives the same pixels, in
order and labelled by shape. Points are resampled to the paper's pixel of 0.15 m by default, so that lengths in curve
points do not depend on the ground sampling distance. Source: Awrangjeb, Ravanbakhsh & Fraser (2010), section 3.3.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel

__all__ = ["SAMPLE", "Curves", "sample_curves", "smooth", "trace_shapes"]

#: Distance between curve points, metres: the pixel of the papers' first data set.
SAMPLE = 0.15


@dataclass(frozen=True, eq=False)
class Curves:
    """Several evenly sampled curves.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        x, y in pixel coordinates.
    offsets : ndarray of int64, shape (curves + 1,)
    shapes : ndarray of int64, shape (curves,)
        Shape that each curve bounds.
    closed : bool
    spacing : float
        Distance between successive points before smoothing, pixels.
    """

    points: NDArray[np.float64]
    offsets: NDArray[np.int64]
    shapes: NDArray[np.int64]
    closed: bool
    spacing: float

    def __len__(self) -> int:
        return len(self.shapes)


@kernel
def _resample(
    points: NDArray[np.float64], offsets: NDArray[np.int64], spacing: float, closed: bool
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return points placed evenly along each polyline, about `spacing` apart, and the offsets of the curves."""
    curves = len(offsets) - 1
    distance = np.zeros(len(points) + curves)
    counts = np.zeros(curves + 1, dtype=np.int64)
    for i in range(curves):
        first, last = offsets[i], offsets[i + 1]
        n = last - first
        steps = n if closed else n - 1
        for k in range(steps):
            here, there = points[first + k], points[first + k + 1 if k + 1 < n else first]
            dx, dy = there[0] - here[0], there[1] - here[1]
            distance[first + i + k + 1] = distance[first + i + k] + math.sqrt(dx * dx + dy * dy)
        total = distance[first + i + steps]
        counts[i + 1] = max(2, round(total / spacing)) + (0 if closed else 1)
    out_offsets = counts.copy()
    for i in range(curves):
        out_offsets[i + 1] += out_offsets[i]
    out = np.empty((out_offsets[-1], 2))
    for i in range(curves):
        first, last = offsets[i], offsets[i + 1]
        n = last - first
        steps = n if closed else n - 1
        intervals = counts[i + 1] if closed else counts[i + 1] - 1
        total = distance[first + i + steps]
        k = 0
        for j in range(counts[i + 1]):
            at = total * j / intervals
            while k < steps - 1 and distance[first + i + k + 1] < at:
                k += 1
            start, end = distance[first + i + k], distance[first + i + k + 1]
            share = (at - start) / (end - start) if end > start else 0.0
            here, there = points[first + k], points[first + k + 1 if k + 1 < n else first]
            out[out_offsets[i] + j, 0] = here[0] + share * (there[0] - here[0])
            out[out_offsets[i] + j, 1] = here[1] + share * (there[1] - here[1])
    return out, out_offsets


def sample_curves(
    points: NDArray[np.float64],
    offsets: NDArray[np.int64],
    shapes: NDArray[np.int64],
    *,
    closed: bool,
    spacing: float,
) -> Curves:
    """Resample polylines to even spacing.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        All polylines in one array, pixel coordinates.
    offsets : ndarray of int64, shape (curves + 1,)
    shapes : ndarray of int64, shape (curves,)
    closed : bool
    spacing : float
        Distance of successive points, pixels.
    """
    sampled, sampled_offsets = _resample(points, offsets, spacing, closed)
    return Curves(sampled, sampled_offsets, shapes, closed, spacing)


def trace_shapes(black: NDArray[np.uint8], *, shortest: float, gsd: float, sample: float = SAMPLE) -> Curves:
    """Trace the closed outlines of the black shapes that are at least `shortest` metres long.

    Points are the centres of the black pixels along the border, half a pixel inside the true edge. Along a curve, black
    lies across (see `boxes`), for outer and inner outlines alike.
    """
    if shortest > gsd:
        # Most shapes are single pixels, of no length, and each would be an outline: they become white.
        around = cv2.boxFilter(black, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
        black = np.minimum(black, around - 1)
    found, hierarchy = cv2.findContours(black, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    parents = np.empty(0, dtype=np.int32) if hierarchy is None else hierarchy[0, :, 3]
    # A step is a pixel or a diagonal long.
    sizes = np.fromiter(map(len, found), dtype=np.int64, count=len(found))
    long = sizes * gsd >= shortest
    for index in np.flatnonzero(~long & (sizes * gsd * math.sqrt(2) >= shortest)).tolist():
        long[index] = cv2.arcLength(found[index], True) * gsd >= shortest
    kept = np.flatnonzero(long)
    offsets = np.concatenate([[0], np.cumsum(sizes[kept])])
    shapes = np.where(parents[kept] < 0, kept, parents[kept])
    # Each outline is reversed: all of them are, and so is their order before.
    polylines = [found[index] for index in kept[::-1].tolist()]
    points = np.concatenate([*polylines, np.empty((0, 1, 2), dtype=np.int32)])[::-1, 0] + 0.5
    return sample_curves(points, offsets, shapes.astype(np.int64), closed=True, spacing=sample / gsd)


@kernel
def _padded(curve: NDArray[np.float64], reach: int, closed: bool) -> NDArray[np.float64]:
    """Return a curve with `reach` points more at both ends: closed ones wrap around, open ones are mirrored."""
    n = len(curve)
    out = np.empty((n + 2 * reach, 2))
    out[reach : reach + n] = curve
    for outside in range(1, reach + 1):
        before, after = reach - outside, reach + n - 1 + outside
        for axis in range(2):
            if closed:
                out[before, axis] = curve[-outside % n, axis]
                out[after, axis] = curve[(n - 1 + outside) % n, axis]
            else:
                out[before, axis] = 2 * curve[0, axis] - curve[min(outside, n - 1), axis]
                out[after, axis] = 2 * curve[n - 1, axis] - curve[max(n - 1 - outside, 0), axis]
    return out


@kernel
def _convolve(
    points: NDArray[np.float64], offsets: NDArray[np.int64], kernel: NDArray[np.float64], closed: bool
) -> NDArray[np.float64]:
    """Convolve each curve with an odd kernel; closed curves wrap around, open ones are mirrored at their ends."""
    out = np.zeros_like(points)
    for i in range(len(offsets) - 1):
        padded = _padded(points[offsets[i] : offsets[i + 1]], len(kernel) // 2, closed).ravel()
        target = out[offsets[i] : offsets[i + 1]].ravel()
        # A tap of the kernel at a time: the inner loop runs over neighbours in memory.
        for j in range(len(kernel)):
            tap, shift = kernel[j], 2 * j
            for k in range(len(target)):
                target[k] += tap * padded[k + shift]
    return out


def smooth(curves: Curves, sigma: float) -> NDArray[np.float64]:
    """Return the points of the curves after a Gaussian of `sigma` curve points, cut off at 3 sigma."""
    if sigma <= 0:
        return curves.points
    reach = max(1, math.ceil(3 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    smoothed: NDArray[np.float64] = _convolve(curves.points, curves.offsets, kernel / kernel.sum(), curves.closed)
    return smoothed
