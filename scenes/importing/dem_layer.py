"""The DEM of a scene: a mosaic of files, or derived from the points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.wording import counted
from ..geodata.points import PointCloud
from ..geodata.raster import Elevation
from ..geodata.raster_headers import RasterHeader
from ..geodata.raster_mosaic import mosaic_elevation, warped_extent
from ..ground.doubt import Doubt
from ..ground.filling import fill_unknown
from ..ground.filter import elevation_from_points, filtered_ground
from ..ground.heights import HIGHEST_LAND, LOWEST_LAND, SEAM, fill_voids
from .place import Place, common_extent, extent_text, file_names, file_paths
from .raster_layer import check_size, grid_of, note_resampling

__all__ = ["dem_of", "dem_of_points"]

#: ASPRS classes whose points lie on the bare earth: ground and water.
_GROUND, _WATER = 2, 9
#: Metres: nineteen of twenty points are not higher above the bare earth than this where any ground is seen, and three
#: of four not deeper below it.
_ABOVE, _BELOW = 1.5, 0.75


def dem_of(
    place: Place,
    models: Sequence[RasterHeader],
    cell: float | None,
    points: PointCloud | None,
    ground_filter: str | None = None,
) -> Elevation:
    """Return the mosaic of elevation models with its gaps filled, compared with the points.

    Narrow gaps are interpolated; gaps that reach beyond `SEAM` take the ground that the points give (`dem_of_points`).
    """
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
    if points is not None:
        _compare_heights(place, points, dem, file_names(files))
    if unknown.any():
        values, how = _filled(place, dem, points, ground_filter)
        dem = Elevation(values, grid)
        how = place.log.derived["dem"] = f"{unknown.mean():.1%} of its cells had no height and {how}"
        place.log.note(f"{file_names(files)}: {how}")
    return dem


def _filled(
    place: Place, dem: Elevation, points: PointCloud | None, ground_filter: str | None
) -> tuple[NDArray[np.float32], str]:
    """Return the values of a DEM with its gaps filled, and how."""
    import cv2

    known = np.isfinite(dem.values)
    away = cv2.distanceTransform((~known).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    if points is not None and float(away.max()) * dem.grid.gsd > SEAM:
        ground, how, doubt = _ground_of_points(place, points, None, ground_filter)
        if np.isfinite(ground.values).any():
            values = dem.values.copy()
            fill_voids(values, known, ground, dem.grid)
            words = doubt.in_voids_of(dem).note() if doubt is not None else None
            if words:
                place.log.note(words)
            return values, f"were derived {how}"
    return fill_unknown(dem.values), "were interpolated"


def dem_of_points(place: Place, points: PointCloud, cell: float | None, ground_filter: str | None) -> Elevation | None:
    """Return the bare earth that the points give: of those classified as ground, else by a ground filter.

    None where so few points give no height at all.
    """
    check_size(place, cell or 1.0, "dem_cell")
    dem, how, doubt = _ground_of_points(place, points, cell, ground_filter)
    if not np.isfinite(dem.values).any():
        place.log.note(
            f"no DEM was derived: {counted(len(points), 'point is', 'points are')} too few or too close to each other"
        )
        return None
    how = place.log.derived["dem"] = f"{how}, at {dem.grid.gsd:g} m"
    place.log.note(f"the DEM was derived {how}")
    words = doubt.note() if doubt is not None else None
    if words:
        place.log.note(words)
    return dem


def _ground_of_points(
    place: Place, points: PointCloud, cell: float | None, ground_filter: str | None
) -> tuple[Elevation, str, Doubt | None]:
    """Return the bare earth that the points give, how it was derived, and where it is unsure."""
    classes = points.classification
    if ground_filter == "cloth":
        from ..ground.cloth import cloth_surface

        return cloth_surface(points, place.extent, cell=cell), "by a cloth simulation filter", None
    if ground_filter is None and classes is not None and np.any(classes == _GROUND):
        dem = elevation_from_points(points, place.extent, cell=cell or 1.0, classes=(_GROUND, _WATER))
        return dem, "from the points of classes 2 (ground) and 9 (water), gaps interpolated", None
    dem, doubt = filtered_ground(points, place.extent, cell=cell)
    why = ", since no point is classified as ground" if ground_filter is None else ""
    return dem, f"by a ground filter (progressive opening){why}", doubt


def _compare_heights(place: Place, points: PointCloud, dem: Elevation, file: str) -> None:
    """Warn of heights above different zeros: the lowest points should lie on the bare earth, and few below it."""
    every = slice(None, None, max(1, len(points) // 200_000))
    gaps = points.z[every] - dem.sample(points.x[every], points.y[every])
    gaps = gaps[np.isfinite(gaps)]
    if not len(gaps):
        return
    low, lower = np.percentile(gaps, [5, 25]).tolist()
    gap = low if low > _ABOVE else lower if lower < -_BELOW else 0.0
    if gap:
        where = f"{abs(gap):.1f} m {'above' if gap > 0 else 'below'}"
        place.log.note(
            f"warning: the lower points lie {where} {file}: if these are not the same heights (ellipsoid and sea "
            "level, feet and metres), convert one of them"
        )
