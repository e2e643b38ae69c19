"""Edge orientation histograms of candidate rectangles, and the six tests that separate buildings from trees.

Nouns
-----
H_col
    Collective histogram: length of the image edges inside a rectangle by direction of their tangent, metres. Bins of 5
    degrees; the first and the last one, both at +-90 degrees, are merged into bin 0, so there are 35.
H_ind
    The same of a single edge.
peak
    Circular local maximum above a multiple of the mean bin; the print asks for "well above the mean bin height".

A candidate is a building when any test holds (L_min = 3 m): T1 two peaks of 3 L_min and less than 2 L_min on average in
the bins between them; T2 a bin of 3 L_min and at most 90 m in all; T3 two peaks of 2 L_min and a highest bin of 3 times
the mean; T4 a bin of L_min and 4 times the mean; T5 a bin of L_min in one H_ind and at most 90 m in all; T6 at least
4.5 m2 of rectangle per metre of edge (45 pixels of 0.1 m).
Source: Awrangjeb, Zhang & Fraser (2011), section 3.4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.raster import Grid
from .boxes import U0, U1, V0, V1, Boxes, box_corners, lengths, to_box, widths
from .contours import SAMPLE, Curves
from .image_edges import ImageEdges

__all__ = ["BIN_COUNT", "Texture", "TextureRules", "apply_tests", "histograms_of", "texture_of", "widened"]

#: Bins of 5 degrees in 180, the outer two merged.
BIN_COUNT = 35
#: Side of the square cells that edge points are sorted into, pixels.
_CELL = 64


@dataclass(frozen=True, eq=False)
class Texture:
    """Texture of candidate rectangles.

    Attributes
    ----------
    edges : ImageEdges
    collective : ndarray, shape (k, 35)
        H_col of each candidate, metres.
    strongest : ndarray, shape (k,)
        Highest bin of any H_ind, metres.
    passed : ndarray of bool, shape (k, 6)
        Tests T1 to T6.
    """

    edges: ImageEdges
    collective: NDArray[np.float64]
    strongest: NDArray[np.float64]
    passed: NDArray[np.bool_]

    @property
    def buildings(self) -> NDArray[np.bool_]:
        """Which candidates pass any test."""
        return np.asarray(self.passed.any(axis=1))


class TextureRules(NamedTuple):
    """Limits of the six tests.

    Attributes
    ----------
    margin : float
        How far outside a candidate an edge still belongs to it, metres. A final rectangle may end a strip inside the
        edge of its roof, where the image has its strongest edge.
    least : float
        L_min, metres.
    most_edges : float
        Largest total length of edges of T2 and T5, metres.
    area_per_edge : float
        Least area per length of edges of T6, metres.
    peak_ratio : float
        Least ratio of a peak of T1 and T3 to the mean bin.
    any_bin : bool
        Whether any bins that are high enough, and not only local maxima, are peaks of T1 and T3.
    """

    margin: float
    least: float
    most_edges: float
    area_per_edge: float
    peak_ratio: float
    any_bin: bool = False


class _EdgePoints(NamedTuple):
    """Edge points sorted into the square cells of a coarse grid.

    Attributes
    ----------
    points : ndarray, shape (n, 2)
        x and y, pixels.
    bins, owner : ndarray of int64, shape (n,)
        Histogram bin and edge of each point.
    order : ndarray of int64, shape (n,)
        Points ordered by cell.
    start : ndarray of int64, shape (cells + 1,)
        Where each cell begins in `order`, row by row.
    rows, columns : int
        Of the coarse grid.
    """

    points: NDArray[np.float64]
    bins: NDArray[np.int64]
    owner: NDArray[np.int64]
    order: NDArray[np.int64]
    start: NDArray[np.int64]
    rows: int
    columns: int


@kernel
def _orientation_bins(points: NDArray[np.float64], offsets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the histogram bin of the tangent at each curve point, by differences of its neighbours."""
    out = np.zeros(len(points), dtype=np.int64)
    for i in range(len(offsets) - 1):
        first, last = offsets[i], offsets[i + 1] - 1
        for k in range(first, last + 1):
            a, b = max(k - 1, first), min(k + 1, last)
            # Row axis points down; degrees are counter-clockwise from the column axis, in [-90, 90).
            degrees = math.degrees(math.atan2(points[a, 1] - points[b, 1], points[b, 0] - points[a, 0]))
            out[k] = int(((degrees + 90.0) % 180.0) / 5.0 + 1e-9) % BIN_COUNT
    return out


@kernel
def _sort_into_cells(
    points: NDArray[np.float64], rows: int, columns: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the point indices ordered by cell, and where each cell begins among them."""
    start = np.zeros(rows * columns + 1, dtype=np.int64)
    cell = np.empty(len(points), dtype=np.int64)
    for k in range(len(points)):
        row = min(max(int(points[k, 1] / _CELL), 0), rows - 1)
        column = min(max(int(points[k, 0] / _CELL), 0), columns - 1)
        cell[k] = row * columns + column
        start[cell[k] + 1] += 1
    start = np.cumsum(start)
    place, order = start.copy(), np.empty(len(points), dtype=np.int64)
    for k in range(len(points)):
        order[place[cell[k]]] = k
        place[cell[k]] += 1
    return order, start


@kernel
def _histograms(
    boxes: NDArray[np.float64], bounds: NDArray[np.float64], edges: _EdgePoints
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the number of points in each box by bin, and the largest number of points of one edge in one bin.

    `bounds` are the xmin, ymin, xmax, ymax of the boxes, shape (k, 4).
    """
    points, bins, owner = edges.points, edges.bins, edges.owner
    rows, columns = edges.rows, edges.columns
    collective = np.zeros((len(boxes), BIN_COUNT), dtype=np.int64)
    strongest = np.zeros(len(boxes), dtype=np.int64)
    for i in range(len(boxes)):
        box = boxes[i]
        row0, row1 = max(int(bounds[i, 1] / _CELL), 0), min(int(bounds[i, 3] / _CELL), rows - 1)
        column0, column1 = max(int(bounds[i, 0] / _CELL), 0), min(int(bounds[i, 2] / _CELL), columns - 1)
        keys = [np.int64(0) for _ in range(0)]
        for row in range(row0, row1 + 1):
            for column in range(column0, column1 + 1):
                cell = row * columns + column
                for k in edges.order[edges.start[cell] : edges.start[cell + 1]]:
                    u, v = to_box(points[k, 0], points[k, 1], box)
                    if box[U0] <= u < box[U1] and box[V0] <= v < box[V1]:
                        collective[i, bins[k]] += 1
                        keys.append(owner[k] * BIN_COUNT + bins[k])
        if len(keys) == 0:
            continue
        ordered = np.sort(np.array(keys))
        run = 0
        for k in range(len(ordered)):
            run = run + 1 if k > 0 and ordered[k] == ordered[k - 1] else 1
            strongest[i] = max(strongest[i], run)
    return collective, strongest


def histograms_of(
    boxes: Boxes, curves: Curves, points: NDArray[np.float64], shape: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return H_col (k, 35) and the highest bin of any H_ind (k,) of each box, metres.

    `points` are the smoothed points of the curves, `shape` the rows and columns of the image. Each curve point
    represents `SAMPLE` metres of edge.
    """
    rows, columns = math.ceil(shape[0] / _CELL), math.ceil(shape[1] / _CELL)
    corners = box_corners(boxes)
    bounds = np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1)
    bins = _orientation_bins(points, curves.offsets)
    owner = np.repeat(np.arange(len(curves)), np.diff(curves.offsets))
    order, start = _sort_into_cells(points, rows, columns)
    collective, strongest = _histograms(boxes, bounds, _EdgePoints(points, bins, owner, order, start, rows, columns))
    return collective * SAMPLE, strongest * SAMPLE


def find_peaks(histogram: NDArray[np.float64], ratio: float) -> NDArray[np.intp]:
    """Return the circular local maxima above `ratio` times the mean; for a plateau, its first bin."""
    rising = histogram > np.roll(histogram, 1)
    high = np.flatnonzero(rising & (histogram > ratio * histogram.mean()))
    return np.asarray([k for k in high if _falls_after(histogram, int(k))], np.intp)


def _falls_after(histogram: NDArray[np.float64], k: int) -> bool:
    for step in range(1, len(histogram)):
        following = histogram[(k + step) % len(histogram)]
        if following != histogram[k]:
            return bool(following < histogram[k])
    return False


def apply_tests(
    collective: NDArray[np.float64],
    strongest: NDArray[np.float64],
    areas: NDArray[np.float64],
    rules: TextureRules,
) -> NDArray[np.bool_]:
    """Return which of the tests T1 to T6 each candidate passes, shape (k, 6).

    Parameters
    ----------
    collective : ndarray, shape (k, 35)
        H_col, metres.
    strongest : ndarray, shape (k,)
        Highest bin of any H_ind, metres.
    areas : ndarray, shape (k,)
        Of the candidates, square metres.
    rules : TextureRules
    """
    least, most_edges = rules.least, rules.most_edges
    total, highest, mean = collective.sum(axis=1), collective.max(axis=1, initial=0.0), collective.mean(axis=1)
    passed = np.zeros((len(collective), 6), dtype=np.bool_)
    passed[:, 1] = (highest >= 3 * least) & (total <= most_edges)
    passed[:, 3] = (highest >= least) & (highest >= 4 * mean)
    passed[:, 4] = (strongest >= least) & (total <= most_edges)
    passed[:, 5] = areas >= rules.area_per_edge * total
    for i in np.flatnonzero(highest >= 2 * least):
        peaks = np.arange(BIN_COUNT) if rules.any_bin else find_peaks(collective[i], rules.peak_ratio)
        heights = collective[i, peaks]
        passed[i, 2] = (heights >= 2 * least).sum() >= 2 and highest[i] >= 3 * mean[i]
        high = peaks[heights >= 3 * least]
        passed[i, 0] = any(
            b > a + 1 and collective[i, a + 1 : b].mean() < 2 * least for n, a in enumerate(high) for b in high[n + 1 :]
        )
    return passed


def widened(boxes: Boxes, margin: float) -> Boxes:
    """Return boxes with all sides moved outwards by `margin` pixels."""
    return np.asarray(boxes + np.array([0, 0, 0, 0, -1, 1, -1, 1]) * margin)


def texture_of(boxes: Boxes, edges: ImageEdges, grid: Grid, rules: TextureRules) -> Texture:
    """Return the histograms and tests of candidate rectangles on the grid of the image."""
    wide = widened(boxes, rules.margin / grid.gsd)
    collective, strongest = histograms_of(wide, edges.curves, edges.points, grid.shape)
    areas = lengths(wide) * widths(wide) * grid.gsd**2
    return Texture(edges, collective, strongest, apply_tests(collective, strongest, areas, rules))
