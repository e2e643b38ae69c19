"""The DEM of a scene: a mosaic of files, or derived from the points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.errors import InputError
from ...core.wording import counted
from ..geodata.points import PointCloud
from ..geodata.raster import Elevation
from ..geodata.raster_headers import RasterHeader
from ..geodata.raster_mosaic import mosaic_elevation, warped_extent
from ..ground.heights import HIGHEST_LAND, LOWEST_LAND
from .place import Place, common_extent, extent_text, file_names, file_paths
from .raster_layer import check_size, grid_of, note_resampling

__all__ = ["dem_of", "dem_of_points"]

#: ASPRS classes whose points lie on the bare earth: ground and water.
_GROUND, _WATER = 2, 9


def dem_of(place: Place, models: Sequence[RasterHeader], cell: float | None, points: PointCloud | None) -> Elevation:
    """Return the mosaic of elevation models with its gaps filled, compared with the points."""
    from ..ground.filling import fill_unknown

    files = [header.path for header in models]
    if not any(common_extent(place.extent, warped_extent(model, place.crs)) for model in models):
        raise InputError(
            f"{file_paths(files)} covers {extent_text(warped_extent(models[0], place.crs))} and not the scene, "
            f"{extent_text(place.extent)}: check that they show the same place in the CRS that they name"
        )
    grid = grid_of(place, models[0], cell)
    check_size(place, grid.gsd, "dem_cell")
    note_resampling(place, models, grid)
    dem = mosaic_elevation(models, grid, crs=place.crs)
    unknown = np.isnan(dem.values)
    wild = ~unknown & ((dem.values < LOWEST_LAND) | (dem.values > HIGHEST_LAND))
    if wild.any():
        value = float(dem.values[wild][0])
        raise InputError(
            f"{file_paths(files)} contains heights of {value:g} m, beyond those of land: if this value marks no "
            f"data, declare it with gdal_edit.py -a_nodata {value:g}"
        )
    if unknown.all():
        raise InputError(
            f"{file_paths(files)} holds no height in {extent_text(place.extent)} (all NaN or no data): "
            "give another DEM, or none, and it is derived from the points"
        )
    if unknown.any():
        dem = Elevation(fill_unknown(dem.values), grid)
        how = place.log.derived["dem"] = f"{unknown.mean():.1%} of its cells had no height and were interpolated"
        place.log.note(f"{file_names(files)}: {how}")
    if points is not None:
        _compare_heights(place, points, dem, file_names(files))
    return dem


def dem_of_points(place: Place, points: PointCloud, cell: float | None, ground_filter: str | None) -> Elevation | None:
    """Return the bare earth that the points give: of those classified as ground, else by a ground filter.

    None where so few points give no height at all.
    """
    from ..ground.doubt import doubt_note
    from ..ground.filter import elevation_from_points, filtered_ground

    check_size(place, cell or 1.0, "dem_cell")
    classes, doubt = points.classification, None
    if ground_filter == "cloth":
        from ..ground.cloth import cloth_surface

        dem = cloth_surface(points, place.extent, cell=cell)
        how = "by a cloth simulation filter"
    elif ground_filter is None and classes is not None and np.any(classes == _GROUND):
        dem = elevation_from_points(points, place.extent, cell=cell or 1.0, classes=(_GROUND, _WATER))
        how = "from the points of classes 2 (ground) and 9 (water), gaps interpolated"
    else:
        dem, unsure = filtered_ground(points, place.extent, cell=cell)
        doubt = doubt_note(unsure)
        why = ", since no point is classified as ground" if ground_filter is None else ""
        how = f"by a ground filter (progressive opening){why}"
    if not np.isfinite(dem.values).any():
        place.log.note(
            f"no DEM was derived: {counted(len(points), 'point is', 'points are')} too few or too close to each other"
        )
        return None
    how = place.log.derived["dem"] = f"{how}, at {dem.grid.gsd:g} m"
    place.log.note(f"the DEM was derived {how}")
    if doubt:
        place.log.note(doubt)
    return dem


def _compare_heights(place: Place, points: PointCloud, dem: Elevation, file: str) -> None:
    """Warn of heights above different zeros: the lowest points should lie on the bare earth."""
    every = slice(None, None, max(1, len(points) // 200_000))
    gap = float(np.percentile(points.z[every] - dem.sample(points.x[every], points.y[every]), 10))
    if abs(gap) > 3.0:
        where = f"{abs(gap):.1f} m {'above' if gap > 0 else 'below'}"
        place.log.note(
            f"warning: the lower points lie {where} {file}: if these are not the same heights (ellipsoid and sea "
            "level, feet and metres), convert one of them"
        )
