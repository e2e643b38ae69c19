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
from enum import IntEnum
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.density import point_counts, spacing_of_counts
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Elevation, Grid
from ...scenes.geodata.sampling import bilinear_at
from .arrays import Floats, Heights, Labels, States
from .threads import ONE_THREAD, Threads

__all__ = ["FEWEST_POINTS", "HIGH", "LOW", "VOID", "Cells", "cell_size", "has_points", "make_cells"]

VOID, LOW, HIGH = np.uint8(0), np.uint8(1), np.uint8(2)

#: In scenes with fewer points no building can be detected.
FEWEST_POINTS = 20

#: Points higher above ground than this many metres are birds and clouds (the tallest building of 2025 has 828 m).
_SKY = 900.0
#: Height of a point that does not count.
_OUTLIER = -(1 << 30)
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
    height: Heights
    state: States
    openness: States


def has_points(z: Floats) -> bool:
    """Return whether a scene has enough finite elevations; the first ones are checked first."""
    return any(np.count_nonzero(np.isfinite(part)) >= FEWEST_POINTS for part in (z[: 100 * FEWEST_POINTS], z))


def cell_size(x: Floats, y: Floats, extent: Sequence[float], *, threads: Threads = ONE_THREAD) -> float:
    """Return the cell size in metres for a mean point spacing: 0.5 to 2 m in steps of 0.25.

    Half the spacing and 0.2 m, rounded up: at 3 points per m2 0.5 m, at 1 point 0.75 m. Cells that no point falls into
    are filled from their neighbours, which loses less detail than larger cells (docs/results/mpp.md). Squares of
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
        Any returns; points that are not finite, outside the grid or in the sky are ignored.
    ground : Elevation
        Bare earth.
    grid : Grid
        Working grid.
    low : float
        Low limit in metres above ground.
    threads : Threads
    """
    size = grid.rows * grid.columns
    counts, tops = np.empty((size, len(_Count)), dtype=np.int32), np.empty((size, 2), dtype=np.int32)
    returns = points.number_of_returns
    if returns is None:
        returns = np.empty(0, dtype=np.uint8)
    elevation = np.ascontiguousarray(ground.values, dtype=np.float32)
    place = (ground.grid.west, ground.grid.north, ground.grid.gsd)
    cloud = _Cloud(points.x, points.y, points.z, returns, elevation, place)
    lowest = math.floor(100 * low)
    height, state = np.empty(grid.shape, dtype=np.int32), np.empty(grid.shape, dtype=np.uint8)
    openness, other = np.empty_like(state), np.empty_like(state)

    def work(first: int, last: int) -> None:
        own = slice(first * grid.columns, last * grid.columns)
        counts[own], tops[own] = 0, 0
        band = _Band(grid.west, grid.north, grid.gsd, first, last, grid.columns)
        _count(cloud, band, lowest, counts)
        _add_tops(cloud, band, counts, tops)
        _summarise(counts, tops, first, last, height, state, openness)

    # Every band reads all points: no more bands than threads.
    threads.bands(work, grid.rows, each=1)
    threads.bands(lambda first, last: _despike(height, state, first, last, other), grid.rows)
    threads.bands(lambda first, last: _fill(height, openness, other, first, last, state), grid.rows)
    threads.bands(lambda first, last: _fill(height, openness, state, first, last, other), grid.rows)
    return Cells(grid, height, other, openness)


class _Cloud(NamedTuple):
    """Points, and the bare earth under them; `returns` is empty where the number of returns is not known."""

    x: Floats
    y: Floats
    z: Floats
    returns: NDArray[np.uint8]
    ground: NDArray[np.float32]
    place: tuple[float, float, float]


class _Band(NamedTuple):
    """Rows first to last of the working grid; west, north and cell in metres."""

    west: float
    north: float
    cell: float
    first: int
    last: int
    columns: int


class _Count(IntEnum):
    """Columns of what is counted in a cell."""

    POINTS = 0
    HIGH_POINTS = 1
    MULTIPLE = 2
    TOP = 3


@kernel(inline="always")
def _cell_of(x: float, y: float, band: _Band) -> int:
    """Return the flat cell of a place, -1 outside the band."""
    # The points of other threads are skipped before the division.
    if not ((band.first - 1) * band.cell < band.north - y < (band.last + 1) * band.cell):
        return -1
    row, column = (band.north - y) / band.cell, (x - band.west) / band.cell
    if not (band.first <= row < band.last and 0 <= column < band.columns):
        return -1
    return int(row) * band.columns + int(column)


@kernel(inline="always")
def _above(cloud: _Cloud, i: int) -> int:
    """Return the height of a point above ground in centimetres, `_OUTLIER` where there is none or it is in the sky."""
    west, north, cell = cloud.place
    h = cloud.z[i] - bilinear_at(cloud.ground, west, north, cell, cloud.x[i], cloud.y[i])
    return math.floor(h * 100.0 + 0.5) if -_SKY < h < _SKY else _OUTLIER


@kernel
def _count(cloud: _Cloud, band: _Band, low: int, counts: Labels) -> None:
    """Fill the numbers of points, of high ones and of parts of multiple returns per cell, and the top."""
    for i in range(len(cloud.x)):
        k = _cell_of(cloud.x[i], cloud.y[i], band)
        if k < 0:
            continue
        height = _above(cloud, i)
        if height == _OUTLIER:
            continue
        counts[k, _Count.POINTS.value] += 1
        if height > low:
            counts[k, _Count.HIGH_POINTS.value] += 1
            counts[k, _Count.TOP.value] = max(counts[k, _Count.TOP.value], height)
        if len(cloud.returns) > 0 and cloud.returns[i] > 1:
            counts[k, _Count.MULTIPLE.value] += 1


@kernel
def _add_tops(cloud: _Cloud, band: _Band, counts: Labels, tops: Labels) -> None:
    """Fill number and sum of the heights of the points near the top of their cell, tops of shape (cells, 2).

    Heights are computed a second time, since in a dense cloud keeping them would take the most memory of all.
    """
    for i in range(len(cloud.x)):
        k = _cell_of(cloud.x[i], cloud.y[i], band)
        if k < 0 or 2 * counts[k, _Count.HIGH_POINTS.value] <= counts[k, _Count.POINTS.value]:
            continue
        height = _above(cloud, i)
        if height != _OUTLIER and height >= counts[k, _Count.TOP.value] - _NEAR_TOP:
            tops[k, 0] += 1
            tops[k, 1] += height


@kernel
def _summarise(
    counts: Labels, tops: Labels, first: int, last: int, height: Heights, state: States, openness: States
) -> None:
    """Fill height, state and openness of some rows from what was counted."""
    columns = state.shape[1]
    for r in range(first, last):
        for c in range(columns):
            k = r * columns + c
            n, high, many = (
                counts[k, _Count.POINTS.value],
                counts[k, _Count.HIGH_POINTS.value],
                counts[k, _Count.MULTIPLE.value],
            )
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
def _despike(height: Heights, before: States, first: int, last: int, state: States) -> None:
    """Fill the states of some rows; high cells become void where no neighbour has their height to 2 m.

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
def _fill(height: Heights, openness: States, before: States, first: int, last: int, state: States) -> None:
    """Fill the states of some rows; void cells take the state of most neighbours where at least three are known.

    Their height and openness become the means of those neighbours.
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
