"""Heights above ground: the one ground that every detector starts from.

Nouns
-----
ground
    Elevation of the bare earth, known everywhere in the extent of a scene: the DEM where it is known, elsewhere the
    surface that the ground filter estimates from the points.
void
    A place of the extent where the DEM is not known: outside its raster, NaN, or a height where there is no land.
seam
    Border between DEM and filter. DEM and filter differ by some decimetres, so their difference at the border is
    carried into the void and fades to zero over `SEAM` metres: the ground has no step there.
height
    Metres of a point above the ground. A *plausible* height is finite, not far below the ground and not higher than
    anything that stands on it.

Axis order of grids: (row, column), row 0 northernmost.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geodata.points import PointCloud
from ..geodata.raster import Elevation, Grid
from .filling import fill_unknown
from .filter import filtered_ground

__all__ = ["HIGHEST_LAND", "LOWEST_LAND", "SEAM", "Heights", "fill_voids", "heights_of"]

#: Elevations outside these, metres, are not land but markers of missing data, other units or errors: the shore of the
#: Dead Sea and Mount Everest, with room for any zero.
LOWEST_LAND, HIGHEST_LAND = -1000.0, 10000.0
#: Width of the seam, metres.
SEAM = 20.0
#: A DEM whose border lies less than so many cells inside the extent does not stop short.
_SHORT = 1.0


@dataclass(frozen=True, eq=False)
class Heights:
    """The ground of a scene, and heights above it.

    Attributes
    ----------
    ground : Elevation
        Known everywhere in the extent; sampling clamps beyond it.
    notes : tuple of str
        One sentence for each thing that was estimated because the DEM does not show it.
    doubtful : Elevation, optional
        1 where the filtered ground is unsure (`doubt`), else 0; None where no ground was filtered.
    """

    ground: Elevation
    notes: tuple[str, ...] = ()
    doubtful: Elevation | None = None

    def above(self, points: PointCloud, *, highest: float = 500.0) -> NDArray[np.float32]:
        """Return the height of each point above the ground, metres, shape (n,); NaN where it is not plausible.

        Parameters
        ----------
        points : PointCloud
        highest : float
            Heights of this many metres or more, and those 10 m or more below the ground, are errors.
        """
        finite = np.isfinite(points.x) & np.isfinite(points.y) & np.isfinite(points.z)
        x, y, z = points.x, points.y, points.z
        if not finite.all():
            x, y, z = x[finite], y[finite], z[finite]
        above = z - self.ground.sample(x, y)
        above[~((above > -10) & (above < highest))] = np.nan
        if len(above) == len(points):
            return above.astype(np.float32)
        heights = np.full(len(points), np.nan, dtype=np.float32)
        heights[finite] = above
        return heights


def heights_of(
    points: PointCloud | None, dem: Elevation | None, extent: Sequence[float], *, cell: float | None = None
) -> Heights:
    """Return the heights above ground of a place.

    A DEM that is known in the whole extent is the ground itself, not a copy of it. Without a finite point the voids of
    a DEM are interpolated; without any DEM, too, the ground is at 0 m.

    Parameters
    ----------
    points : PointCloud, optional
    dem : Elevation, optional
        Bare earth; None to filter all of it from the points.
    extent : sequence of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    cell : float, optional
        Cell size of the ground filter, metres; by default from the density of the points.
    """
    if dem is not None and _is_complete(dem, extent):
        return Heights(dem)
    filtered, doubt, doubtful, doubts = None, None, None, []
    if points is not None:
        filtered, doubt = filtered_ground(points, extent, cell=cell)
        doubtful, words = Elevation(doubt.cells.astype(np.float32), filtered.grid), doubt.note()
        doubts = [words] if words else []
    if filtered is not None and np.isnan(filtered.values).all():
        filtered = doubtful = None
    if dem is None:
        if filtered is not None:
            return Heights(filtered, ("there is no DEM: the ground was filtered from the points", *doubts), doubtful)
        grid = Grid.covering(extent, 1.0)
        level = Elevation(np.zeros(grid.shape, dtype=np.float32), grid)
        return Heights(level, ("there is neither a DEM nor a point: the ground was set to 0 m",))
    # Cells of the DEM, unless they would coarsen what the filter shows in the voids.
    grid = _extended(dem.grid, extent)
    if filtered is not None and grid.gsd > filtered.grid.gsd:
        grid = filtered.grid
    ground = _on_grid(dem, grid)
    known = np.isfinite(ground)
    if filtered is None:
        return Heights(
            Elevation(fill_unknown(ground) if known.any() else np.zeros_like(ground), grid),
            (f"the DEM covers {_share(known)} of the scene, which has no points: the rest was interpolated",),
        )
    if not known.any():
        none = "the DEM has no value in the scene: the ground was filtered from the points"
        return Heights(filtered, (none, *doubts), doubtful)
    fill_voids(ground, known, filtered, grid)
    notes: tuple[str, ...] = (
        f"the DEM covers {_share(known)} of the scene: the ground of the rest was filtered from the points",
    )
    if doubt is not None:
        left = doubt.in_voids_of(Elevation(np.where(known, ground, np.float32(np.nan)), grid))
        doubtful, words = Elevation(left.cells.astype(np.float32), left.grid), left.note()
        notes = (*notes, words) if words else notes
    return Heights(Elevation(ground, grid), notes, doubtful)


def _is_complete(dem: Elevation, extent: Sequence[float]) -> bool:
    """Return whether sampling at any place of the extent is known."""
    xmin, ymin, xmax, ymax = extent
    west, south, east, north = dem.grid.extent
    short = _SHORT * dem.grid.gsd
    if xmin < west - short or ymin < south - short or xmax > east + short or ymax > north + short:
        return False
    top, left, bottom, right = _neighbours(dem.grid, extent)
    window = dem.values[max(top, 0) : max(bottom, 1), max(left, 0) : max(right, 1)]
    # NaN fails both comparisons, and nothing of the size of the raster is made.
    return bool(window.size and window.min() >= LOWEST_LAND and window.max() <= HIGHEST_LAND)


def _neighbours(grid: Grid, extent: Sequence[float]) -> tuple[int, int, int, int]:
    """Return the cells that sampling in the extent reads, also beyond the grid: first and end rows and columns."""
    xmin, ymin, xmax, ymax = extent
    top, left = math.floor((grid.north - ymax) / grid.gsd - 0.5), math.floor((xmin - grid.west) / grid.gsd - 0.5)
    bottom, right = math.floor((grid.north - ymin) / grid.gsd - 0.5), math.floor((xmax - grid.west) / grid.gsd - 0.5)
    return top, left, bottom + 2, right + 2


def _extended(grid: Grid, extent: Sequence[float]) -> Grid:
    """Return the same cells, continued or cut to the extent."""
    top, left, bottom, right = _neighbours(grid, extent)
    west, north = grid.west + left * grid.gsd, grid.north - top * grid.gsd
    return Grid(west, north, grid.gsd, bottom - top, right - left)


def _on_grid(dem: Elevation, grid: Grid) -> NDArray[np.float32]:
    """Return a DEM on another grid, bilinear between its cells; NaN where it is not known."""
    land = (dem.values >= LOWEST_LAND) & (dem.values <= HIGHEST_LAND)
    values = dem.values if land.all() else np.where(land, dem.values, np.float32(np.nan))
    west, south, east, north = dem.grid.extent
    x, _ = grid.to_world(0, np.arange(grid.columns) + 0.5)
    _, y = grid.to_world(np.arange(grid.rows) + 0.5, 0)
    found = np.full(grid.shape, np.nan, dtype=np.float32)
    if grid.gsd == dem.grid.gsd:
        # The same cells: copied, so that a void does not grow by the cells beside it.
        top = round((dem.grid.north - grid.north) / grid.gsd)
        left = round((grid.west - dem.grid.west) / grid.gsd)
        shared = values[max(top, 0) : max(top + grid.rows, 0), max(left, 0) : max(left + grid.columns, 0)]
        row, column = max(-top, 0), max(-left, 0)
        found[row : row + shared.shape[0], column : column + shared.shape[1]] = shared
        return found
    inside = (x >= west) & (x <= east)
    surface = Elevation(values, dem.grid)
    for row in np.flatnonzero((y >= south) & (y <= north)).tolist():
        found[row, inside] = surface.sample(x[inside], y[row])
    return found


def fill_voids(ground: NDArray[np.float32], known: NDArray[np.bool_], filtered: Elevation, grid: Grid) -> None:
    """Fill the voids of a DEM in place with another ground plus the difference that fades along the seam.

    Parameters
    ----------
    ground : ndarray of float32, shape (rows, columns)
        Metres.
    known : ndarray of bool, shape (rows, columns)
        False in voids.
    filtered : Elevation
        The other ground, known everywhere in the grid.
    grid : Grid
    """
    import cv2

    x, _ = grid.to_world(0, np.arange(grid.columns) + 0.5)
    _, y = grid.to_world(np.arange(grid.rows) + 0.5, 0)
    below = np.empty_like(ground)
    for row in range(grid.rows):
        below[row] = filtered.sample(x, y[row])
    difference = fill_unknown(ground - below)
    distance = cv2.distanceTransform((~known).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    along = np.clip(1 - distance * np.float32(grid.gsd / SEAM), 0, 1)
    # Smooth step: without a bend at either side of the seam.
    below += difference * along * along * (3 - 2 * along)
    np.copyto(ground, below, where=~known)


def _share(known: NDArray[np.bool_]) -> str:
    """Return the known share in words; never 0 % or 100 % of what is a part."""
    share = float(known.mean())
    return "less than 1 %" if share < 0.01 else f"{min(math.floor(100 * share), 99)} %"
