"""Bare earth from laser points: elevation models of ground points, and a ground filter for unclassified points.

Nouns
-----
lowest surface
    Per cell the lowest point that is not isolated, metres.
object
    A connected region of cells that an opening of the lowest surface removes and that stands on walls: a roof, a
    crown, a bridge. A hill top, which an opening removes too, ends without walls and stays ground.
wall
    A step of the lowest surface by more than the wall height within two cells, beyond the slope of its surroundings.

The filter is a progressive opening with growing windows and a height threshold that grows with the window (Zhang et
al. 2003, "A progressive morphological filter for removing nonground measurements from airborne LIDAR data", IEEE TGRS
41(4); Pingel, Clarke & McBride 2013, "An improved simple morphological filter", ISPRS J. 77), taken relative to the
coarse trend of the land, so that a slope costs nothing, with the test for walls added, so that windows as wide as the
largest halls do not cut hills. Axis order of grids: (row, column), row 0 northernmost.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..geodata.points import PointCloud
from ..geodata.raster import Elevation, Grid
from .doubt import Doubt, doubtful_ground
from .filling import fill_unknown
from .lowest_points import default_cell, lowest_surface, mean_above
from .objects import objects_of

__all__ = ["elevation_from_points", "filtered_ground", "ground_surface"]

_Floats = NDArray[np.float32]
_Mask = NDArray[np.bool_]

#: Size in metres of the blocks whose lowest heights give the trend.
_TREND_BLOCK = 5.0
#: Neighbourhoods of the rounds in which the trend is fitted, as shares of the largest object; fewer rounds where only
#: land is left and nothing large need lose its weight.
_SHARES, _SHARES_OF_LAND = (1.0, 1.0, 0.5, 0.5, 0.25, 0.25, 0.25), (1.0, 0.5, 0.25)
#: Points put on the grid at a time, so that a large cloud is not copied.
_CHUNK = 2_000_000
#: Share of the scene under objects from which the trend is fitted again without them.
_CROWDED = 0.3


def ground_surface(
    points: PointCloud,
    extent: Sequence[float],
    *,
    cell: float | None = None,
    largest_object: float = 130.0,
    slope: float = 0.15,
    wall_height: float = 1.0,
    tolerance: float = 0.4,
) -> Elevation:
    """Return the bare earth below all points, whatever they were reflected by.

    Parameters
    ----------
    points : PointCloud
        Any returns; points that are not finite are left out.
    extent : sequence of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    cell : float, optional
        Cell size in metres; by default 1 m, more where the points are so sparse that a cell would hold less than two.
    largest_object : float
        Width in metres up to which an object is taken off the ground.
    slope : float
        Rise over run, besides that of the trend, that is still ground.
    wall_height : float
        Least step, metres, at the border of an object.
    tolerance : float
        Lowest points nearer than this, metres, to the ground found are ground themselves.

    Returns
    -------
    Elevation
        Known everywhere, unless there is no point at all (then NaN).
    """
    rules = (largest_object, slope, wall_height)
    return filtered_ground(points, extent, cell=cell, rules=rules, tolerance=tolerance)[0]


def filtered_ground(
    points: PointCloud,
    extent: Sequence[float],
    *,
    cell: float | None = None,
    rules: tuple[float, float, float] = (130.0, 0.15, 1.0),
    tolerance: float = 0.4,
) -> tuple[Elevation, Doubt]:
    """Return what `ground_surface` does, and where it is unsure.

    Parameters
    ----------
    rules : tuple of float
        Largest object, slope and wall height, see `ground_surface`.
    """
    largest_object, slope, wall_height = rules
    x, y, z = _finite(points)
    grid = Grid.covering(extent, cell or default_cell(x, y, extent))
    lowest = lowest_surface(x, y, z, grid)
    if np.isnan(lowest).all():
        return Elevation(lowest, grid), Doubt(grid, {"no height": np.ones(lowest.shape, dtype=bool)})
    trend = _trend(lowest, grid.gsd, largest_object)
    relief = lowest - trend
    objects = objects_of(relief, grid.gsd, largest_object, slope, wall_height)
    crowded = objects.cells.mean() > _CROWDED
    if crowded or objects.widest > (largest_object / 2) ** 2:
        # Roofs that cover most of a neighbourhood lift its trend: the trend of the rest is that of the land.
        shares = _SHARES if crowded else _SHARES_OF_LAND
        trend = _trend(np.where(objects.cells, np.float32(np.nan), lowest), grid.gsd, largest_object, shares)
        relief = lowest - trend
    if crowded:
        objects = objects_of(relief, grid.gsd, largest_object, slope, wall_height)
    cells = objects.cells.copy()
    ground = fill_unknown(np.where(cells, np.float32(np.nan), relief))
    # Cut hill tops and the feet of shrubs come back; what they add lets the next round reach a little further.
    for _ in range(2):
        again = cells & ~objects.feet & (np.abs(relief - ground) < tolerance)
        if not again.any():
            break
        cells &= ~again
        ground = fill_unknown(np.where(cells, np.float32(np.nan), relief))
    surface = Elevation(ground + trend, grid)
    # The lowest point is biased by the noise: the mean of the points near the ground is not.
    near = mean_above(x, y, z, surface, tolerance=tolerance)
    near[objects.feet] = np.nan
    seen = np.isfinite(near)
    if seen.any():
        surface = Elevation(surface.values + np.nan_to_num(fill_unknown(near)), grid)
    return surface, doubtful_ground(surface, seen, np.isfinite(lowest), objects.low, smooth=objects.smooth)


def elevation_from_points(
    points: PointCloud, extent: Sequence[float], *, cell: float | None = None, classes: Sequence[int] | None = None
) -> Elevation:
    """Return the mean height of points per cell, with cells without points interpolated.

    Made for points that are known to be ground; a cloud without a finite point gives NaN everywhere.

    Parameters
    ----------
    points : PointCloud
    extent : sequence of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    cell : float, optional
        Cell size in metres; by default as in `ground_surface`.
    classes : sequence of int, optional
        Use only points of these ASPRS classes; all when not given.
    """
    grid = Grid.covering(extent, cell or default_cell(points.x, points.y, extent))
    size = grid.rows * grid.columns
    count, total = np.zeros(size, dtype=np.int64), np.zeros(size)
    # Heights above sea are large against the spread in a cell.
    base = float(points.z[np.isfinite(points.z).argmax()]) if np.isfinite(points.z).any() else 0.0
    for start in range(0, len(points), _CHUNK):
        part = points.take(slice(start, start + _CHUNK))
        if classes is not None and part.classification is not None:
            part = part.take(np.isin(part.classification, classes))
        x, y, z = _finite(part)
        index, inside = grid.cells(x, y)
        index = index[inside]
        count += np.bincount(index, minlength=size)
        total += np.bincount(index, weights=z[inside] - base, minlength=size)
    mean = np.full(size, np.nan)
    np.divide(total, count, out=mean, where=count > 0)
    return Elevation(fill_unknown((mean + base).astype(np.float32).reshape(grid.shape)), grid)


def _finite(points: PointCloud) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    finite = np.isfinite(points.x) & np.isfinite(points.y) & np.isfinite(points.z)
    if finite.all():
        return points.x, points.y, points.z
    return points.x[finite], points.y[finite], points.z[finite]


def _trend(surface: _Floats, cell: float, largest: float, shares: Sequence[float] = _SHARES) -> _Floats:
    """Return the coarse trend of the terrain: local planes, fitted to the low parts of a surface, on its grid.

    Locally weighted regression over ever smaller neighbourhoods; what lies above the trend counts less each round, so
    that an object narrower than `largest` (metres) does not lift it. A hill does: its flanks lead up to its top.
    """
    block = max(1, round(_TREND_BLOCK / cell))
    rows, columns = (-(-size // block) for size in surface.shape)
    padded = np.full((rows * block, columns * block), np.inf, dtype=np.float32)
    padded[: surface.shape[0], : surface.shape[1]] = np.where(np.isnan(surface), np.float32(np.inf), surface)
    low = padded.reshape(rows, block, columns, block).min(axis=(1, 3)).astype(np.float64)
    known = np.isfinite(low)
    base = low[known].min()
    height = np.where(known, low - base, 0)
    weight = known.astype(np.float64)
    trend = coarse = np.zeros(low.shape)
    for share in shares:
        trend = _local_planes(height, weight, share * largest / (cell * block))
        coarse = trend if share == 1.0 else coarse
        above = height - trend
        spread = 1.4826 * np.median(np.abs(above[known])) + 0.1
        weight = known / (1 + (np.where(above > 0, 2, 0.5) * above / spread) ** 2)
    # Planes of small neighbourhoods are unstable where no data are near; those of the largest go on below a hall.
    trend = coarse + fill_unknown(np.where(known, trend - coarse, np.nan).astype(np.float32))
    # Samples at the border lie beyond the centres of the outer blocks.
    outer = np.pad(trend, 1, mode="reflect", reflect_type="odd") if min(trend.shape) > 1 else np.pad(trend, 1, "edge")
    blocks = Elevation(outer.astype(np.float32), Grid(-block, block, block, rows + 2, columns + 2))
    lie = np.empty(surface.shape, dtype=np.float32)
    column = np.arange(surface.shape[1])
    for row in range(len(lie)):
        lie[row] = blocks.sample(column + 0.5, -row - 0.5) + base
    return lie


def _local_planes(height: NDArray[np.float64], weight: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Return at each cell the value of the weighted least-squares plane of its Gaussian neighbourhood."""
    import cv2

    place: NDArray[np.float64] = np.indices(height.shape, dtype=np.float64)
    y, x = place[0], place[1]

    def blurred(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT))

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return blurred(weight * values) / total

    total = np.maximum(blurred(weight), 1e-12)
    mx, my, mz = mean(x), mean(y), mean(height)
    # A little of the neighbourhood's own spread keeps the slope defined where all weight is on one line.
    ridge = 1e-3 * sigma**2
    xx, yy, xy = mean(x * x) - mx * mx + ridge, mean(y * y) - my * my + ridge, mean(x * y) - mx * my
    xz, yz = mean(x * height) - mx * mz, mean(y * height) - my * mz
    determinant = xx * yy - xy * xy
    across, down = (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant
    return np.asarray(mz + across * (x - mx) + down * (y - my))
