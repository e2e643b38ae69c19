"""Return numbers by place: where the numbers of a cloud describe its pulses, and where they say nothing.

Clouds are put together from surveys, sensors and providers, some of which write no return numbers, or the same ones at
every point: 1 of 1, 2 of 2. There, numbers are *unknown*: set to 0, as LAS counts from 1.

Nouns
-----
cell
    Square of 2 m, *broken* where its points differ in height by more than 2 m (crowns, walls), *closed* where they do
    by less than 0.5 m (flat roofs, ground).
block
    Square of some cells, aligned to its multiples.
unbroken region
    Neighbouring blocks of 16 m without a single multiple return, and blocks of 4 m without any beside them. In broken
    cells a scanner that records them has some, so that numbers are unknown in a region with many points in such cells.
doubled region
    Neighbouring blocks of 4 m in which about half or more of the points in closed cells, or all points, are parts of
    multiple returns. A closed surface returns a pulse once. Smaller blocks follow the border of the region better, and
    a roof in a block that is left out would be lost.
source
    Points of one point source id (flight strip). Strips overlap, so that regions cannot separate them; a source without
    any multiple return beside sources that have some, or with nothing else, has unknown numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Grid

__all__ = ["KnownReturns", "known_returns"]

_Counts = NDArray[np.int32]

#: Metres: side of a cell; sides of the blocks of doubled and of unbroken regions, multiples of each other.
_CELL, _SMALL, _LARGE = 2.0, 4.0, 16.0
#: Metres: rise within broken and closed cells.
_BROKEN, _CLOSED = 2.0, 0.5
#: Share of multiple returns in closed cells from which they are doubled. In squares of 32 m of five airborne clouds,
#: whole and thinned to a tenth, it is 0.40 at most.
_DOUBLED = 0.45
#: Points in broken (or closed) cells of a region from which it counts. Regions of the same clouds have 312 at
#: most without a multiple return, and 428 doubled.
_FEWEST = 1000
#: Points of a source from which it is tested, and least share of multiple returns of the other sources.
_FEWEST_OF_SOURCE, _LEAST_SHARE = 1000, 0.01
#: Share of unknown points above which the numbers say nothing anywhere, which the tests of a whole cloud report.
_NEARLY_ALL = 0.98


@dataclass(frozen=True)
class KnownReturns:
    """Points whose numbers are 0 where they say nothing.

    Attributes
    ----------
    points : PointCloud
        The given ones where all or none are known.
    unknown : float
        Share of the points whose numbers were found to say nothing, 0 where all or none are known.
    """

    points: PointCloud
    unknown: float

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence where the numbers are known in a part only; in tenths, so that tiles of a city have few."""
        if not self.unknown:
            return ()
        share = f"about {round(10 * self.unknown):d}0%" if self.unknown >= 0.05 else "a few"
        return (
            f"return numbers are not used of {share} of the points: pulses there have all one or all several returns",
        )


def known_returns(points: PointCloud, extent: Sequence[float]) -> KnownReturns:
    """Return the points with return numbers of 0 where the numbers say nothing.

    Parameters
    ----------
    points : PointCloud
    extent : sequence of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    """
    returns = points.number_of_returns
    if returns is None or not (returns > 1).any():
        return KnownReturns(points, 0.0)
    silent = _silent_sources(points, returns)
    blocks = Grid.covering(extent, _LARGE)
    regions = _silent_regions(_sums_of(points, np.where(silent, np.uint8(0), returns), blocks))
    if regions.any():
        each = round(_LARGE / _SMALL)
        small = Grid(blocks.west, blocks.north, _SMALL, blocks.rows * each, blocks.columns * each)
        index, inside = small.cells(points.x, points.y)
        silent |= inside & regions.ravel()[index]
    silent &= returns > 0
    count = np.count_nonzero(silent)
    if not 0 < count <= _NEARLY_ALL * len(points):
        return KnownReturns(points, 0.0)
    number, total = (
        None if column is None else np.where(silent, np.uint8(0), column)
        for column in (points.return_number, points.number_of_returns)
    )
    return KnownReturns(replace(points, return_number=number, number_of_returns=total), count / len(points))


def _silent_sources(points: PointCloud, returns: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Return which points are of a source whose numbers say nothing."""
    none = np.zeros(len(points), dtype=np.bool_)
    if points.source is None:
        return none
    count, several = (
        np.bincount(points.source, weights=weights, minlength=1 << 16) for weights in (returns > 0, returns > 1)
    )
    many = count >= _FEWEST_OF_SOURCE
    constant = many & ((several == 0) | (several == count))
    others = ~constant
    if not constant.any() or several[others].sum() < _LEAST_SHARE * count[others].sum():
        return none
    return np.asarray(constant[points.source])


class _Sums(NamedTuple):
    """Points, multiple returns, and both in closed cells, per small block; points in broken cells per large block."""

    points: _Counts
    several: _Counts
    closed: _Counts
    doubled: _Counts
    broken: _Counts


def _sums_of(points: PointCloud, returns: NDArray[np.uint8], blocks: Grid) -> _Sums:
    """Return what is counted on the cells of a grid of large blocks."""
    each = round(_LARGE / _CELL)
    shape = blocks.rows * each, blocks.columns * each
    place = blocks.west, blocks.north, _CELL
    count, several, low, high = _tallied(points.x, points.y, points.z, returns, place, shape)
    rise = np.where(count > 1, high - low, np.float32(1))
    closed = rise < _CLOSED
    small = round(_SMALL / _CELL)
    return _Sums(
        points=_summed(count, small),
        several=_summed(several, small),
        closed=_summed(count * closed, small),
        doubled=_summed(several * closed, small),
        broken=_summed(count * (rise > _BROKEN), each),
    )


def _summed(values: _Counts, each: int) -> _Counts:
    """Return the sums of squares of so many cells."""
    rows, columns = values.shape
    sums: _Counts = values.reshape(rows // each, each, columns // each, each).sum(axis=(1, 3))
    return sums


@kernel
def _tallied(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    z: NDArray[np.float64],
    returns: NDArray[np.uint8],
    place: tuple[float, float, float],
    shape: tuple[int, int],
) -> tuple[_Counts, _Counts, NDArray[np.float32], NDArray[np.float32]]:
    """Return number, multiple returns, lowest and highest of the points of each cell whose numbers are known."""
    count, several = np.zeros(shape, dtype=np.int32), np.zeros(shape, dtype=np.int32)
    low, high = np.full(shape, np.inf, dtype=np.float32), np.full(shape, -np.inf, dtype=np.float32)
    west, north, size = place
    rows, columns = shape
    for i in range(len(x)):
        if returns[i] == 0:
            continue
        row, column = (north - y[i]) / size, (x[i] - west) / size
        if not (0 <= row < rows and 0 <= column < columns):
            continue
        r, c = int(row), int(column)
        height = np.float32(z[i])
        count[r, c] += 1
        several[r, c] += returns[i] > 1
        low[r, c] = min(low[r, c], height)
        high[r, c] = max(high[r, c], height)
    return count, several, low, high


def _silent_regions(sums: _Sums) -> NDArray[np.bool_]:
    """Return the small blocks of unbroken and of doubled regions, shape (rows, columns)."""
    import cv2

    each = round(_LARGE / _SMALL)
    found = _regions(_summed(sums.several, each) == 0, sums.broken).repeat(each, axis=0).repeat(each, axis=1)
    if found.any():
        window = np.ones((2 * each + 1, 2 * each + 1), np.uint8)
        found |= (cv2.dilate(found.astype(np.uint8), window) > 0) & (sums.several == 0)
    all_several = (sums.points > 0) & (sums.several == sums.points)
    return found | _regions(all_several | ((sums.closed > 0) & (sums.doubled > _DOUBLED * sums.closed)), sums.closed)


def _regions(chosen: NDArray[np.bool_], weights: _Counts) -> NDArray[np.bool_]:
    """Return the connected regions of chosen blocks whose weights sum up to `_FEWEST` or more."""
    import cv2

    count, labels = cv2.connectedComponents(chosen.astype(np.uint8), connectivity=4)
    total = np.bincount(labels.ravel(), weights=weights.ravel(), minlength=count)
    total[0] = 0
    return np.asarray(total[labels] >= _FEWEST)
