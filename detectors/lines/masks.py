"""The two building masks: areas without ground points, and areas with high points.

Nouns
-----
height threshold
    Ground height + 2.5 m, one value per point.
primary mask
    Black where no point below the threshold is near: void areas. Its black shapes are possible buildings.
secondary mask
    Black near points above the threshold: filled areas. It limits the extension of a building.
raised ground
    Where the DEM is above the laser points: it is interpolated below buildings and crowns, and on a slope it cuts
    through the levelled ground of a house.
neighbourhood
    Side of the square that a point marks; it follows the point spacing (5 x 5 pixels of 0.15 m for points 0.5 m apart).
nearest point
    Nearest of all points that are not exactly at the threshold. Squares around low points reach into adjacent roofs, by
    more the nearer the points are to the wall. Where the nearest point decides, the border between ground and roof is
    half-way between a low and a high point, which is unbiased.
coverage
    Where there are points, with voids up to the size of a large roof or pond filled.

Masks are uint8 rasters on the grid of the orthoimage, 1 = black. Source: Awrangjeb, Ravanbakhsh & Fraser (2010),
section 3.2; ground height per point: Awrangjeb, Zhang & Fraser (2011), section 3.1; mode of the tile: the conference
version (IAPRS XXXVIII-3A, 2010), section 3.1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.density import point_counts, spacing_of_counts
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Elevation, Grid
from ..shared.selection import ordered_value
from .nearest_points import nearest_kind

__all__ = ["Masks", "build_cell_masks", "build_masks", "ground_correction", "ground_heights", "pulse_spacing"]

#: Side of the cells in which points are counted to tell coverage and density, metres.
_COVERAGE_CELL = 2.5
#: A gap in the points narrower than this is a void inside the coverage, metres.
_WIDEST_VOID = 50.0
#: Side of the cells in which points below the ground are counted, metres: with their neighbours they span a house.
_CORRECTION_CELL = 4.0
#: A void farther than this many neighbourhoods from any high point is no roof: water and wet asphalt give no returns.
_BARE = 4.0
#: Least number of pixels beside a high point that are black in the secondary mask. Where points are denser than pixels,
#: the squares would be single pixels, and the outermost strip of a roof never black enough to be added.
_LEAST_BORDER = 1
#: Distance between successive bins of the height histogram of a tile (conference version), metres.
_HEIGHT_BIN = 2.0
#: Side of the cells of masks that do not follow the image, metres.
_MASK_CELL = 0.25
#: Share of a cell, or metres, by which rounding may move a place or a height.
_ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Masks:
    """Both masks of a scene.

    Attributes
    ----------
    primary, secondary : ndarray of uint8, shape (rows, columns)
        1 = black.
    coverage : ndarray of uint8, shape (rows, columns)
        1 where there are points around.
    neighbourhood : int
        Side of the square that each point marks, pixels, odd.
    """

    primary: NDArray[np.uint8]
    secondary: NDArray[np.uint8]
    coverage: NDArray[np.uint8]
    neighbourhood: int


def _places(grid: Grid, coarse: Grid) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the row of another grid below the centre of each row of a grid, and the column of each column."""
    x, _ = grid.to_world(0, np.arange(grid.columns) + 0.5)
    _, y = grid.to_world(np.arange(grid.rows) + 0.5, 0)
    row, _ = coarse.to_pixel(coarse.west, y)
    _, column = coarse.to_pixel(x, coarse.north)
    # Centres on the border of two cells belong to the second, whatever the rounding.
    return (
        np.clip(np.floor(row + _ROUNDING), 0, coarse.rows - 1).astype(np.intp),
        np.clip(np.floor(column + _ROUNDING), 0, coarse.columns - 1).astype(np.intp),
    )


def pulse_spacing(points: PointCloud, grid: Grid) -> float:
    """Return the typical distance between neighbouring pulses, metres.

    The square root of the area per first return in the median occupied cell; every point counts as a pulse when the
    cloud has no return numbers or no first returns.
    """
    first = None if points.return_number is None else points.return_number == 1
    if first is not None and not first.any():
        first = None
    cell = 2 * _COVERAGE_CELL
    counts = point_counts(points.x, points.y, Grid.covering(grid.extent, cell), among=first)
    return spacing_of_counts(counts, cell, "median") or cell


def _coverage(points: PointCloud, grid: Grid) -> NDArray[np.uint8]:
    # All coarse cells are those of a raster in absolute coordinates: a window of a scene has the same ones.
    coarse = Grid.covering(grid.extent, _COVERAGE_CELL)
    occupied = (point_counts(points.x, points.y, coarse) > 0).astype(np.uint8)
    width = 2 * round(_WIDEST_VOID / _COVERAGE_CELL / 2) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))
    margin = width // 2
    padded = cv2.copyMakeBorder(occupied, margin, margin, margin, margin, cv2.BORDER_CONSTANT, value=0)
    closed = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, kernel)[margin:-margin, margin:-margin]
    rows, columns = _places(grid, coarse)
    # Columns first: then whole rows are copied.
    covered: NDArray[np.uint8] = closed.take(columns, axis=1).take(rows, axis=0)
    return covered


def _tiles(x: NDArray[np.float64], y: NDArray[np.float64], side: float) -> NDArray[np.int64]:
    """Return the number of each point's tile in a global raster that does not depend on the extent of the scene."""
    return np.floor(x / side).astype(np.int64) * (1 << 32) + np.floor(y / side).astype(np.int64)


def _tile_dem(points: PointCloud, dem: Elevation, side: float) -> NDArray[np.float64]:
    row, column = np.nonzero(np.isfinite(dem.values))
    x, y = dem.grid.to_world(row + 0.5, column + 0.5)
    heights = dem.values[row, column].astype(np.float64)
    tiles, index = np.unique(_tiles(x, y, side), return_inverse=True)
    means = np.bincount(index, heights) / np.bincount(index)
    wanted = _tiles(points.x, points.y, side)
    place = np.minimum(np.searchsorted(tiles, wanted), len(tiles) - 1)
    return np.where(tiles[place] == wanted, means[place], heights.mean())


def _tile_mode(points: PointCloud, side: float) -> NDArray[np.float64]:
    tiles, index = np.unique(_tiles(points.x, points.y, side), return_inverse=True)
    level = np.floor(points.z / _HEIGHT_BIN).astype(np.int64)
    level -= (lowest := level.min())
    counts = np.bincount(index * (level.max() + 1) + level, minlength=len(tiles) * (int(level.max()) + 1))
    modes = np.argmax(counts.reshape(len(tiles), -1), axis=1)
    return np.asarray(((modes + lowest + 0.5) * _HEIGHT_BIN)[index], dtype=np.float64)


def ground_heights(
    points: PointCloud, ground: Elevation | None, *, method: str, tile_side: float
) -> NDArray[np.float64]:
    """Return the ground height under each point, metres, shape (n,).

    Parameters
    ----------
    points : PointCloud
    ground : Elevation, optional
        The scene's ground; the mode of the points needs none.
    method : {"tile-dem", "tile-mode", "point-dem"}
        Mean DEM of the point's tile (2010, section 3.2); most frequent 2 m height bin of the tile's points (conference
        version); ground under the point (2011, section 3.1).
    tile_side : float
        Metres.
    """
    if not len(points):
        return np.empty(0)
    if method == "tile-mode":
        return _tile_mode(points, tile_side)
    assert ground is not None
    return _tile_dem(points, ground, tile_side) if method == "tile-dem" else ground.sample(points.x, points.y)


def ground_correction(
    points: PointCloud, ground: NDArray[np.float64], share: float, *, deciding: float | None = None
) -> NDArray[np.float64]:
    """Return the correction of raised ground at each point, metres, shape (n,): zero or less.

    In cells of 4 m, at most `share` of the points may lie below the ground. The correction of a cell is the largest
    that it or one of its eight neighbours needs, because a house hides the ground below it. Between the centres of
    cells the correction is interpolated.

    Parameters
    ----------
    points : PointCloud
    ground : ndarray, shape (n,)
        Height of the ground under each point, metres; NaN where it is not known.
    share : float
    deciding : float, optional
        Height above the ground, metres: only corrections that can decide whether a point is above it are computed, and
        the others are 0. None: all are computed.
    """
    above = points.z - ground
    known = np.isfinite(above)
    x, y, own = points.x, points.y, above
    if not known.all():
        x, y, own = x[known], y[known], above[known]
    correction = np.zeros(len(points))
    if not len(own) or own.min() >= 0:
        return correction
    grid = Grid.covering((x.min() - _CORRECTION_CELL, y.min() - _CORRECTION_CELL, x.max(), y.max()), _CORRECTION_CELL)
    cell = grid.cells(x, y)[0]
    wanted = np.ones(grid.shape, dtype=np.uint8)
    if deciding is not None:
        # No correction is larger than the depth of the lowest point.
        least = deciding + own.min() - _ROUNDING
        undecided = (own >= least) & (own <= deciding + _ROUNDING)
        wanted[:] = 0
        wanted.ravel()[cell[undecided]] = 1
        # A correction is interpolated from the next cells, which follow their neighbours.
        wanted = cv2.dilate(wanted, np.ones((5, 5), np.uint8))
    low = _lowest(own, cell, share, wanted.ravel()).reshape(grid.shape)
    lowest = Elevation(cv2.erode(low, np.ones((3, 3), np.uint8)), grid)
    if deciding is None:
        return lowest.sample(points.x, points.y)
    place = np.flatnonzero(known)[undecided]
    correction[place] = lowest.sample(points.x[place], points.y[place])
    return correction


@kernel
def _lowest(
    above: NDArray[np.float64], cell: NDArray[np.intp], share: float, wanted: NDArray[np.uint8]
) -> NDArray[np.float32]:
    """Return the lowest height of each cell after the `share` of its points that may be lower, at most 0.

    Cells that are not wanted, of which `wanted` has one number each, have 0.
    """
    cells = len(wanted)
    starts, ends = np.zeros(cells + 1, dtype=np.int64), np.zeros(cells, dtype=np.int64)
    for i in range(len(above)):
        starts[cell[i] + 1] += wanted[cell[i]]
    for k in range(cells):
        starts[k + 1] += starts[k]
        ends[k] = starts[k]
    # By cell, the heights below 0, which end at `ends`. A height above 0 is overwritten: no branch is mispredicted.
    heights = np.empty(starts[cells], dtype=np.float32)
    for i in range(len(above)):
        if wanted[cell[i]]:
            heights[ends[cell[i]]] = above[i]
            ends[cell[i]] += above[i] < 0
    lowest = np.zeros(cells, dtype=np.float32)
    for k in range(cells):
        allowed = math.floor(share * (starts[k + 1] - starts[k]))
        if ends[k] - starts[k] > allowed:
            lowest[k] = ordered_value(heights[starts[k] :], ends[k] - starts[k], allowed)
    return lowest


def _hits(
    points: PointCloud, thresholds: NDArray[np.float64], grid: Grid
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the pixels with a point below its threshold, and those with one above."""
    hits = np.zeros((2, grid.rows * grid.columns), dtype=np.uint8)
    _mark(*grid.cells(points.x, points.y), points.z, thresholds, hits)
    low, high = hits.reshape(2, *grid.shape)
    return low, high


@kernel
def _mark(
    cell: NDArray[np.intp],
    inside: NDArray[np.bool_],
    z: NDArray[np.float64],
    thresholds: NDArray[np.float64],
    hits: NDArray[np.uint8],
) -> None:
    """Fill the cells of points below their threshold in the first row of `hits`, of those above in the second."""
    for i in range(len(z)):
        if inside[i]:
            if z[i] < thresholds[i]:
                hits[0, cell[i]] = 1
            elif z[i] > thresholds[i]:
                hits[1, cell[i]] = 1


def _squares(hits: NDArray[np.uint8], side: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.dilate(hits, np.ones((side, side), np.uint8)), dtype=np.uint8)


def build_masks(
    points: PointCloud,
    thresholds: NDArray[np.float64],
    grid: Grid,
    *,
    neighbourhood: float,
    nearest: bool,
    clip: bool = True,
) -> Masks:
    """Build both masks.

    Parameters
    ----------
    thresholds : ndarray, shape (n,)
        Height threshold of each point, metres; a point without one (NaN) marks nothing.
    neighbourhood : float
        Side of the square that a point marks, metres.
    nearest : bool
        Whether the nearest point decides: the primary mask is white where it is low or no high point is near, and the
        secondary mask is black also where it is high, up to `neighbourhood` away. Otherwise both masks are made of
        squares, as printed.
    clip : bool
        Whether the primary mask is white outside the coverage.
    """
    side = 2 * max(_LEAST_BORDER if nearest else 0, round((neighbourhood / grid.gsd - 1) / 2)) + 1
    coverage = _coverage(points, grid)
    low, high = _hits(points, thresholds, grid)
    secondary = _squares(high, side)
    if nearest:
        reach = neighbourhood / grid.gsd
        primary, filled = nearest_kind(low, high, reach, _BARE * reach)
        secondary |= filled
    else:
        primary = _squares(low, side)
    np.subtract(1, primary, out=primary)
    if clip:
        primary &= coverage
    return Masks(primary, secondary, coverage, side)


def build_cell_masks(
    points: PointCloud, thresholds: NDArray[np.float64], grid: Grid, *, spacing: float, clip: bool = True
) -> Masks:
    """Return both masks made of squares on cells of 0.25 m, resampled to the grid of the image.

    A point marks 3 x 3 cells at a spacing of 0.5 m and 7 x 7 at 1 m: half the side is
    max(0.5, 0.5 floor(2 spacing + 0.5)) / 0.25 - 1 cells, as in the authors' own program.

    Parameters
    ----------
    thresholds : ndarray, shape (n,)
        Height threshold of each point, metres; a point without one (NaN) marks nothing.
    spacing : float
        Point spacing, metres.
    clip : bool
        Whether the primary mask is white outside the coverage.
    """
    cells = Grid.covering(grid.extent, _MASK_CELL)
    side = 2 * round(max(0.5, 0.5 * math.floor(2 * spacing + 0.5)) / _MASK_CELL - 1) + 1
    places = np.ix_(*_places(grid, cells))
    white, secondary = (_squares(hits, side)[places] for hits in _hits(points, thresholds, cells))
    coverage = _coverage(points, grid)
    primary = np.subtract(1, white, dtype=np.uint8)
    if clip:
        primary &= coverage
    return Masks(primary, secondary, coverage, 2 * round((side * _MASK_CELL / grid.gsd - 1) / 2) + 1)
