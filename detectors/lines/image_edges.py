"""Edges of the orthoimage: Canny edge pixels linked to open curves, and the straight lines among them.

Nouns
-----
chain
    Edge pixels in order, followed from an end as straight as possible; a branch is a separate chain.
image line
    Line fitted to a piece of a chain between corners, like the lines around black shapes.

Canny's upper threshold is the gradient that 70 % of the cells do not reach, but at least that of a step of some grey
levels, so that noise in a uniform image makes no edges; the lower threshold is 0.4 of it.
Source: Awrangjeb, Zhang & Fraser (2011), sections 3.3 and 3.4, which print no edge detector parameters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .boxes import Boxes
from .contours import SAMPLE, Curves, sample_curves
from .corners import find_corners
from .segments import fit_segments

__all__ = ["ImageEdges", "extract_edges"]

#: Share of the cells whose gradient is below Canny's upper threshold, and its lower threshold as a share of the upper.
_QUIET_SHARE = 0.7
_LOWER = 0.4
#: Variance of the smoothing by the Sobel filter along the gradient, square pixels.
_SOBEL_VARIANCE = 0.7
_NEIGHBOURS = np.array([(0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, -1), (-1, 1)])


@dataclass(frozen=True, eq=False)
class ImageEdges:
    """Edges of an orthoimage.

    Attributes
    ----------
    curves : Curves
        Chains, evenly sampled.
    points : ndarray, shape (n, 2)
        The same points, smoothed.
    lines : ndarray, shape (m, 8)
        Image lines, boxes without width.
    """

    curves: Curves
    points: NDArray[np.float64]
    lines: Boxes


def edge_pixels(grey: NDArray[np.uint8], blur: float, contrast: float) -> NDArray[np.uint8]:
    """Return Canny's edge map of a grey image blurred with sigma `blur` pixels, 1 = edge.

    `contrast` is the smallest step in grey levels that starts an edge.
    """
    smooth = cv2.GaussianBlur(grey, (0, 0), blur) if blur > 0 else grey
    dx, dy = cv2.Sobel(smooth, cv2.CV_16S, 1, 0), cv2.Sobel(smooth, cv2.CV_16S, 0, 1)
    strength = np.hypot(dx[::4, ::4].astype(np.float32), dy[::4, ::4].astype(np.float32))
    # A blurred step of one grey level has the slope 1 / (sqrt(2 pi) sigma); Sobel multiplies it by 8.
    step = 8 * contrast / math.sqrt(2 * math.pi * (blur**2 + _SOBEL_VARIANCE))
    upper = max(float(np.quantile(strength, _QUIET_SHARE)), step, 1.0)
    edges = cv2.Canny(dx, dy, _LOWER * upper, upper, L2gradient=True)
    return np.asarray(edges > 0).view(np.uint8)


@kernel
def _next_pixel(edges: NDArray[np.uint8], row: int, column: int, from_row: int, from_column: int) -> int:
    """Return the unused neighbour that continues a chain from (from_row, from_column) straightest; -1 for none."""
    rows, columns = edges.shape
    best, best_score = -1, -1e9
    back_row, back_column = row - from_row, column - from_column
    for k in range(8):
        dr, dc = _NEIGHBOURS[k]
        r, c = row + dr, column + dc
        if 0 <= r < rows and 0 <= c < columns and edges[r, c] == 1:
            score = (dr * back_row + dc * back_column) / math.hypot(dr, dc) - 0.01 * k
            if score > best_score:
                best, best_score = k, score
    return best


@kernel
def _unused_neighbours(edges: NDArray[np.uint8], row: int, column: int) -> int:
    rows, columns = edges.shape
    count = 0
    for k in range(8):
        r, c = row + _NEIGHBOURS[k, 0], column + _NEIGHBOURS[k, 1]
        if 0 <= r < rows and 0 <= c < columns and edges[r, c] == 1:
            count += 1
    return count


@kernel
def link_pixels(edges: NDArray[np.uint8], least: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the chains of at least `least` edge pixels: points (n, 2) at pixel centres, and offsets.

    Chains are followed from their ends first; closed ones, which have no end, last.
    """
    edges = edges.copy()  # used pixels become 2
    rows, columns = edges.shape
    capacity = 0
    for row in range(rows):
        for column in range(columns):
            capacity += edges[row, column]
    points = np.empty((capacity, 2))
    offsets = np.zeros(capacity + 1, dtype=np.int64)
    chains, used = 0, 0
    for only_ends in (True, False):
        for start_row in range(rows):
            for start_column in range(columns):
                if edges[start_row, start_column] != 1:
                    continue
                if only_ends and _unused_neighbours(edges, start_row, start_column) != 1:
                    continue
                row, column, first = start_row, start_column, used
                edges[row, column] = 2
                points[used, 0], points[used, 1] = column + 0.5, row + 0.5
                used += 1
                while True:
                    behind = max(first, used - 5)
                    step = _next_pixel(edges, row, column, int(points[behind, 1]), int(points[behind, 0]))
                    if step < 0:
                        break
                    row, column = row + _NEIGHBOURS[step, 0], column + _NEIGHBOURS[step, 1]
                    edges[row, column] = 2
                    points[used, 0], points[used, 1] = column + 0.5, row + 0.5
                    used += 1
                if used - first >= least:
                    chains += 1
                    offsets[chains] = used
                else:
                    used = first
    return points[:used].copy(), offsets[: chains + 1].copy()


def extract_edges(
    grey: NDArray[np.uint8],
    *,
    gsd: float,
    blur: float,
    contrast: float,
    shortest: float,
    smoothing: float,
    product: float,
    straight: tuple[float, float],
) -> ImageEdges:
    """Extract the edges of a grey image that are at least `shortest` metres long, and their lines of that length.

    `blur` is in pixels, `contrast` in grey levels (see `edge_pixels`); `smoothing`, `product` and `straight` are those
    of `find_corners`.
    """
    points, offsets = link_pixels(edge_pixels(grey, blur, contrast), max(2, math.ceil(shortest / gsd / math.sqrt(2))))
    curves = sample_curves(points, offsets, np.arange(len(offsets) - 1), closed=False, spacing=SAMPLE / gsd)
    long_enough = np.flatnonzero((np.diff(curves.offsets) - 1) * curves.spacing * gsd >= shortest - SAMPLE / 2)
    curves = _take(curves, long_enough)
    smoothed, corners, corner_offsets = find_corners(curves, sigma=smoothing, product=product, straight=straight)
    segments = fit_segments(curves, smoothed, corners, corner_offsets, shortest=shortest / gsd)
    return ImageEdges(curves, smoothed, segments.lines)


def _take(curves: Curves, index: NDArray[np.intp]) -> Curves:
    counts = np.diff(curves.offsets)
    keep = np.zeros(len(curves), dtype=np.bool_)
    keep[index] = True
    offsets = np.concatenate([[0], np.cumsum(counts[keep])]).astype(np.int64)
    return Curves(curves.points[np.repeat(keep, counts)], offsets, curves.shapes[keep], curves.closed, curves.spacing)
