"""Density of a point cloud: points per square of a coarse grid, and the point spacing that follows from them.

Nouns
-----
square
    Cell of a coarse grid over the extent, 2 to 5 m wide. It is *covered* when it holds a point: water, gaps between
    flight strips and a ragged border do not count.
point spacing
    Typical distance between neighbouring points where there are any: the side of the area that one point has to
    itself, metres.
lattice
    Points in rows and columns, one above each node at most: the cells of a raster.

No array of the size of the cloud is made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .raster import Frame, Grid

__all__ = ["Statistic", "is_lattice", "point_counts", "point_spacing", "spacing_of_counts"]

_Coordinates = NDArray[np.float64]

#: Metres: half the side of the square whose points are tested for a lattice. Most nodes per point of a lattice with
#: holes (a scanned cloud has hundreds). Fewest points by which a lattice is recognised.
_TESTED, _NODES_PER_POINT, _FEWEST_NODES = 16.0, 4, 50

#: Stands for a choice of all points.
_ALL = np.empty(0, dtype=np.bool_)
#: How the squares are summarised: the *mean* of all covered ones; their *median*, which overlapping flight strips and
#: half covered borders do not affect; or the square of the *median-point*, for points that cover little, as roofs do.
Statistic = Literal["mean", "median", "median-point"]


def point_spacing(
    x: _Coordinates, y: _Coordinates, extent: Sequence[float], *, square: float = 4.0, statistic: Statistic = "mean"
) -> float | None:
    """Return the point spacing in metres; None without a point in the extent.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Metres. For the spacing of pulses, give first returns only.
    extent : sequence of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    square : float
        Side of the squares, metres.
    statistic : {"mean", "median", "median-point"}

    Examples
    --------
    >>> x, y = (values.ravel() for values in np.meshgrid(np.arange(0.25, 8, 0.5), np.arange(0.25, 8, 0.5)))
    >>> point_spacing(x, y, (0, 0, 100, 100))
    0.5
    >>> point_spacing(x, y, (50, 50, 100, 100)) is None
    True
    """
    grid = Grid.covering(extent, square)
    return spacing_of_counts(point_counts(x, y, grid), square, statistic)


def point_counts(
    x: _Coordinates, y: _Coordinates, grid: Grid, *, among: NDArray[np.bool_] | None = None
) -> NDArray[np.int64]:
    """Return the number of points in each cell of a grid, shape (rows, columns); points not finite lie in none.

    With `among`, shape (n,), only the points where it is true count.
    """
    counts = np.zeros(grid.shape, dtype=np.int64)
    _count(x, y, _ALL if among is None else among, grid.frame, counts)
    return counts


def spacing_of_counts(counts: NDArray[np.int64], square: float, statistic: Statistic = "mean") -> float | None:
    """Return the point spacing in metres of counts per square of so many metres; None without a point."""
    covered = counts[counts > 0]
    if not len(covered):
        return None
    if statistic == "mean":
        return math.sqrt(square * square * len(covered) / int(covered.sum()))
    if statistic == "median":
        return float(square / math.sqrt(np.median(covered)))
    ordered = np.sort(covered)
    return float(square / math.sqrt(ordered[np.searchsorted(np.cumsum(ordered), int(covered.sum()) / 2)]))


def is_lattice(x: _Coordinates, y: _Coordinates) -> bool:
    """Return whether the points around the middle one of the arrays are a lattice.

    Examples
    --------
    >>> x, y = (values.ravel() for values in np.meshgrid(np.arange(0.25, 8, 0.5), np.arange(0.25, 8, 0.5)))
    >>> is_lattice(x, y), is_lattice(x + 0.1 * np.sin(y), y)
    (True, False)
    """
    if not len(x):
        return False
    middle = len(x) // 2
    east, north = float(x[middle]), float(y[middle])
    near = (x > east - _TESTED) & (x < east + _TESTED) & (y > north - _TESTED) & (y < north + _TESTED)
    x, y = x[near], y[near]
    nodes = len(np.unique(x)) * len(np.unique(y))
    if len(x) < max(_FEWEST_NODES, nodes / _NODES_PER_POINT):
        return False
    return len(np.unique(np.stack([x, y], axis=1), axis=0)) == len(x)


@kernel
def _count(x: _Coordinates, y: _Coordinates, among: NDArray[np.bool_], frame: Frame, counts: NDArray[np.int64]) -> None:
    """Add the points, or those of `among` unless it is empty, to the counts of their squares, in place."""
    for i in range(len(x)):
        if len(among) > 0 and not among[i]:
            continue
        column, row = (x[i] - frame.west) / frame.gsd, (frame.north - y[i]) / frame.gsd
        if 0 <= column < frame.columns and 0 <= row < frame.rows:
            counts[int(row), int(column)] += 1
