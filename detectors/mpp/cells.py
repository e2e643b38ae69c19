"""Cells: the point cloud as one small record per square of ground.

Nouns
-----
cell
    Square of the working grid (0.5 to 2 m); axis order (row, column), row 0 northernmost.
height
    Metres above ground of a point; of a cell, the mean of the points near its top in whole centimetres, so that the
    wall below a roof's edge does not count.
state
    `VOID`: no point in or around the cell; `LOW`: most points below the low limit (ground, cars, hedges, and crowns
    that most pulses pass); `HIGH`: most points above it (roofs and closed crowns).
openness
    Share (0 to 255 for 0 to 1) of a cell's points that a closed surface would not give: parts of a multiple return,
    or points below the low limit in a high cell.

All sums are whole numbers, so they do not depend on the order of the points nor on how the work is split.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.density import point_counts, spacing_of_counts
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Elevation, Grid
from ...scenes.geodata.sampling import bilinear_at
from .threads import ONE_THREAD, Threads

__all__ = ["FEWEST_POINTS", "HIGH", "LOW", "VOID", "Cells", "cell_size", "has_points", "make_cells"]

VOID, LOW, HIGH = np.uint8(0), np.uint8(1), np.uint8(2)

#: Scenes with fewer points hold nothing that can be detected.
FEWEST_POINTS = 20

#: Points higher above ground than this many metres are birds and clouds (the tallest building of 2025 has 828 m).
_SKY = 900.0
_ASTRAY = -(1 << 30)
#: Points this many centimetres below the highest of a cell still belong to its top.
_NEAR_TOP = 75
#: A height that differs by more than this many centimetres from all its neighbours is a spike.
_SPIKE = 200


@dataclass(frozen=True, eq=False)
class Cells:
    """The cloud on the working grid.

    Attributes
    ----------
    grid : Grid
    height : ndarray of int32, shape (rows, columns)
        Centimetres above ground; 0 where the cell is not high.
    state : ndarray of uint8, shape (rows, columns)
        `VOID`, `LOW` or `HIGH`.
    openness : ndarray of uint8, shape (rows, columns)
        0 to 255 for a share of 0 to 1.
    """

    grid: Grid
    height: NDArray[np.int32]
    state: NDArray[np.uint8]
    openness: NDArray[np.uint8]


def has_points(z: NDArray[np.float64]) -> bool:
    """Return whether a scene has enough finite elevations; the first ones are looked at first."""
    return any(np.count_nonzero(np.isfinite(part)) >= FEWEST_POINTS for part in (z[: 100 * FEWEST_POINTS], z))


def cell_size(
    x: NDArray[np.float64], y: NDArray[np.float64], extent: Sequence[float], *, threads: Threads = ONE_THREAD
) -> float:
    """Return the cell size in metres for a mean point spacing: 0.5 to 2 m in steps of 0.25.

    Half the spacing and 0.2 m, rounded up: at 3 points per m2 0.5 m, at 1 point 0.75 m. Cells that no point falls into
    are filled from their neighbours, which costs less than what larger cells blur (docs/results/mpp.md). Squares of
    4 m without a point do not count as covered (water, a ragged border).
    """
    coarse = Grid.covering(extent, 4.0)
    edges = [len(x) * part // threads.count for part in range(threads.count + 1)]
    found = threads.map(lambda part: point_counts(x[slice(*part)], y[slice(*part)], coarse), pairwise(edges))
    spacing = spacing_of_counts(np.sum(found, axis=0), coarse.gsd)
    return 1.0 if spacing is None else min(max(math.ceil(2 * spacing + 0.8) / 4, 0.5), 2.0)


def make_cells(
    points: PointCloud,
    ground: Elevation,
    grid: Grid,
    *,
    low: float,
    threads: Threads = ONE_THREAD,
) -> Cells:
    """Sort the points into cells.

    Parameters
    ----------
    points : PointCloud
        Any returns; points that are not finite, outside the grid or in the sky are passed over.
    ground : Elevation
        Bare earth.
    grid : Grid
        Working grid.
    low : float
        Low limit in metres above ground.
    threads : Threads
    """
    size = grid.rows * grid.columns
    counts, tops = np.empty((size, 4), dtype=np.int32), np.empty((size, 2), dtype=np.int32)
    returns = points.number_of_returns
    if returns is None:
        returns = np.empty(0, dtype=np.uint8)
    elevation = np.ascontiguousarray(ground.values, dtype=np.float32)
    place = (ground.grid.west, ground.grid.north, ground.grid.gsd)
    frame = (grid.west, grid.north, grid.gsd)
    cloud = (points.x, points.y, points.z)
    lowest = math.floor(100 * low)

    height, state = np.empty(grid.shape, dtype=np.int32), np.empty(grid.shape, dtype=np.uint8)
    openness, other = np.empty_like(state), np.empty_like(state)

    def work(first: int, last: int) -> None:
        mine = slice(first * grid.columns, last * grid.columns)
        counts[mine], tops[mine] = 0, 0
        _count(*cloud, returns, elevation, place, frame, first, last, grid.columns, lowest, counts)
        _add_tops(*cloud, elevation, place, frame, first, last, grid.columns, counts, tops)
        _summarise(counts, tops, first, last, height, state, openness)

    # Every band goes through all points: no more bands than threads.
    threads.bands(work, grid.rows, each=1)
    threads.bands(lambda first, last: _despike(height, state, first, last, other), grid.rows)
    threads.bands(lambda first, last: _fill(height, openness, other, first, last, state), grid.rows)
    threads.bands(lambda first, last: _fill(height, openness, state, first, last, other), grid.rows)
    return Cells(grid, height, other, openness)


@kernel(inline="always")
def _cell_of(x, y, frame, first, last, columns):  # type: ignore[no-untyped-def]
    """Return the flat cell of a place, -1 outside rows first..last and outside the columns."""
    west, north, cell = frame
    # Other threads' points are passed over before anything is divided.
    if not ((first - 1) * cell < north - y < (last + 1) * cell):
        return -1
    row, column = (north - y) / cell, (x - west) / cell
    if not (first <= row < last and 0 <= column < columns):
        return -1
    return int(row) * columns + int(column)


@kernel(inline="always")
def _above(x, y, z, ground, place):  # type: ignore[no-untyped-def]
    """Return the height above ground in centimetres, `_ASTRAY` where there is none or it is in the sky."""
    west, north, cell = place
    h = z - bilinear_at(ground, west, north, cell, x, y)
    return math.floor(h * 100.0 + 0.5) if -_SKY < h < _SKY else _ASTRAY


@kernel
def _count(x, y, z, returns, ground, place, frame, first, last, columns, low, counts):  # type: ignore[no-untyped-def]
    """Count all points, high ones and parts of multiple returns per cell, and find the top: columns 0 to 3."""
    for i in range(len(x)):
        k = _cell_of(x[i], y[i], frame, first, last, columns)
        if k < 0:
            continue
        height = _above(x[i], y[i], z[i], ground, place)
        if height == _ASTRAY:
            continue
        counts[k, 0] += 1
        if height > low:
            counts[k, 1] += 1
            counts[k, 3] = max(counts[k, 3], height)
        if len(returns) > 0 and returns[i] > 1:
            counts[k, 2] += 1


@kernel
def _add_tops(x, y, z, ground, place, frame, first, last, columns, counts, tops):  # type: ignore[no-untyped-def]
    """Count and sum up the points near the top of their cell.

    Heights are computed a second time, since keeping them would take more memory than all else in a dense cloud.
    """
    for i in range(len(x)):
        k = _cell_of(x[i], y[i], frame, first, last, columns)
        if k < 0 or 2 * counts[k, 1] <= counts[k, 0]:
            continue
        height = _above(x[i], y[i], z[i], ground, place)
        if height != _ASTRAY and height >= counts[k, 3] - _NEAR_TOP:
            tops[k, 0] += 1
            tops[k, 1] += height


@kernel
def _summarise(counts, tops, first, last, height, state, openness):  # type: ignore[no-untyped-def]
    """Fill height, state and openness of some rows from what was counted."""
    columns = state.shape[1]
    for r in range(first, last):
        for c in range(columns):
            k = r * columns + c
            n, high, many = counts[k, 0], counts[k, 1], counts[k, 2]
            height[r, c], openness[r, c] = 0, 0
            if n == 0:
                state[r, c] = VOID
            elif 2 * high <= n:
                state[r, c] = LOW
            else:
                state[r, c] = HIGH
                height[r, c] = tops[k, 1] // tops[k, 0]
                openness[r, c] = (255 * max(n - high, many)) // n


@kernel
def _despike(height, before, first, last, state):  # type: ignore[no-untyped-def]
    """Fill the states of some rows, in which high cells are void whose height no neighbour shares to 2 m.

    Birds, masts, chimneys and errors of the sensor are such cells.
    """
    rows, columns = state.shape
    for r in range(first, last):
        for c in range(columns):
            state[r, c] = before[r, c]
            if before[r, c] != HIGH:
                continue
            shared = 0
            for i in range(max(r - 1, 0), min(r + 2, rows)):
                for j in range(max(c - 1, 0), min(c + 2, columns)):
                    if before[i, j] == HIGH and abs(height[i, j] - height[r, c]) <= _SPIKE:
                        shared += 1
                # The cell itself is among them.
                if shared > 1:
                    break
            if shared <= 1:
                state[r, c] = VOID


@kernel
def _fill(height, openness, before, first, last, state):  # type: ignore[no-untyped-def]
    """Fill the states of some rows, in which void cells have that of most neighbours where three at least are known.

    Their height and openness are set to go with it.
    """
    rows, columns = state.shape
    for r in range(first, last):
        for c in range(columns):
            state[r, c] = before[r, c]
            if before[r, c] != VOID:
                continue
            known, high, rise, openly = 0, 0, 0, 0
            for i in range(max(r - 1, 0), min(r + 2, rows)):
                for j in range(max(c - 1, 0), min(c + 2, columns)):
                    if before[i, j] != VOID:
                        known += 1
                    if before[i, j] == HIGH:
                        high += 1
                        rise += height[i, j]
                        openly += openness[i, j]
            height[r, c], openness[r, c] = 0, 0
            if known >= 3:
                state[r, c] = LOW
                if 2 * high > known:
                    state[r, c], height[r, c], openness[r, c] = HIGH, rise // high, openly // high
