"""Points of a surface model: a raster of heights (DSM) takes the place of a point cloud.

A *surface model* holds the height of what is seen from above: ground, roofs and crowns. Each of its cells that has a
height becomes a point at its centre, without return numbers: a raster does not tell what a pulse passed through.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.errors import InputError
from ...core.wording import counted
from ..geodata.points import PointCloud
from ..geodata.raster_headers import RasterHeader
from ..geodata.raster_mosaic import mosaic_elevation
from ..ground.heights import HIGHEST_LAND, LOWEST_LAND
from .place import Place, extent_text, file_names, file_paths
from .raster_layer import check_size, grid_of, note_resampling

__all__ = ["points_of_surface"]

#: Cells larger than this many metres show no walls.
_COARSE = 2.0


def points_of_surface(place: Place, surfaces: Sequence[RasterHeader]) -> PointCloud:
    """Return the points of the cells of surface models on the cells of the first.

    Raises
    ------
    InputError
        No cell has a height of land.
    CRSError
        The heights are not in metres.
    """
    files = [header.path for header in surfaces]
    grid = grid_of(place, surfaces[0], None)
    check_size(place, grid.gsd, "extent")
    note_resampling(place, surfaces, grid)
    heights = mosaic_elevation(surfaces, grid, crs=place.crs).values
    known = np.isfinite(heights)
    land = known & (heights >= LOWEST_LAND) & (heights <= HIGHEST_LAND)
    if not land.any():
        what = f"no plausible heights, but values such as {heights[known][0]:g} m" if known.any() else "no height"
        raise InputError(f"{file_paths(files)} holds {what} in {extent_text(place.extent)}: give another surface model")
    wild = int(np.count_nonzero(known & ~land))
    if wild:
        value = float(heights[known & ~land][0])
        dropped = counted(wild, "cell was", "cells were")
        place.log.note(f"{dropped} left out: heights such as {value:g} m are beyond those of land")
    row, column = np.nonzero(land)
    x, y = grid.to_world(row + 0.5, column + 0.5)
    xmin, ymin, xmax, ymax = place.extent
    inside = (x >= xmin) & (x <= xmax) & (y >= ymin) & (y <= ymax)
    cloud = PointCloud(x=x[inside], y=y[inside], z=heights[row[inside], column[inside]].astype(np.float64))
    how = place.log.derived["points"] = f"taken from the cells of a surface model, one every {grid.gsd:g} m"
    taken = counted(len(cloud), "point was", "points were")
    place.log.note(f"{file_names(files)}: {taken} {how}; {1 - land.mean():.1%} of the cells have none")
    scaled = any(header.scale != 1 or header.offset != 0 for header in surfaces)
    if not scaled and np.array_equal(cloud.z, np.round(cloud.z)):
        place.log.note(
            f"warning: {file_names(files)} has whole numbers as heights, which were taken for metres: if they are "
            "decimetres or centimetres, set the scale, for instance with gdal_edit.py -scale 0.01"
        )
    if grid.gsd > _COARSE:
        place.log.note(f"warning: cells of {grid.gsd:g} m are too large to show the walls of houses")
    return cloud
