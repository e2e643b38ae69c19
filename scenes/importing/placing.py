"""Decide the place of a scene: its CRS and its extent.

The CRS is the one that was given, else that of the points, else that of the first surface model, else of the first
image. The extent is what points or surface models and images have in common, cut to the extent that was asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...core.errors import CRSError, InputError
from ..geodata.crs import crs_label, named_crs, require_metric, same_crs, scale_warning
from ..geodata.las_files import LasHeader
from ..geodata.raster_headers import RasterHeader
from ..geodata.raster_mosaic import warped_extent
from .place import Extent, ImportLog, Place, common_extent, extent_text, file_names, file_paths
from .request import ImportRequest

__all__ = ["assign_crs", "decide_place"]


def decide_place(
    request: ImportRequest,
    clouds: Sequence[LasHeader],
    surfaces: Sequence[RasterHeader],
    images: Sequence[RasterHeader],
    log: ImportLog,
) -> tuple[Place, list[RasterHeader], list[RasterHeader]]:
    """Return the place, and surface models and images with a CRS each.

    Raises
    ------
    CRSError
        No CRS, several, or one that is not in metres.
    InputError
        The inputs have no place in common.
    """
    crs = _decide_crs(request.crs, clouds, [*surfaces, *images], log)
    models, assigned = assign_crs(surfaces, crs, log), assign_crs(images, crs, log)
    parts = [*_extent_of_points(clouds), *_extent_of_rasters(models, crs, "surface model")]
    parts += _extent_of_rasters(assigned, crs, "image")
    place = Place(crs, _decide_extent(request.wanted_extent, parts, log), log)
    xmin, ymin, xmax, ymax = place.extent
    stretched = scale_warning(crs, (xmin + xmax) / 2, (ymin + ymax) / 2)
    if stretched:
        log.note(stretched)
    return place, models, assigned


def assign_crs(headers: Sequence[RasterHeader], crs: str, log: ImportLog) -> list[RasterHeader]:
    """Return the headers with a CRS each: rasters without one are taken to be in the scene's, with a note."""
    nameless = [header.path for header in headers if header.crs is None]
    if nameless:
        log.note(_assumed(nameless, crs))
    return [replace(header, crs=header.crs or crs) for header in headers]


def _decide_crs(given: str | None, clouds: Sequence[LasHeader], images: Sequence[RasterHeader], log: ImportLog) -> str:
    if given is not None:
        require_metric(given, "crs", remedy="name a projected one, such as EPSG:25832")
        given = named_crs(given)
    named = [cloud for cloud in clouds if cloud.crs is not None]
    for cloud in named:
        other = given if given is not None else named[0].crs
        assert cloud.crs is not None
        if other is not None and not same_crs(cloud.crs, other):
            whose = "crs= says" if given is not None else f"{named[0].path} is in"
            raise CRSError(
                f"{cloud.path} is in {crs_label(cloud.crs)} but {whose} {crs_label(other)}: point files must share "
                "one CRS, reproject this one, for instance with pdal's filters.reprojection"
            )
    crs = given or (named[0].crs if named else None)
    nameless = [cloud.path for cloud in clouds if cloud.crs is None]
    if nameless and given is None and named:
        raise CRSError(
            f"{nameless[0]} has no CRS while {named[0].path} is in {crs_label(crs)}: if it is in the same, "
            "say so by crs="
        )
    if crs is None:
        crs = next((image.crs for image in images if image.crs is not None), None) if not clouds else None
    if crs is None:
        first = nameless[0] if nameless else images[0].path
        raise CRSError(f"{first} has no coordinate reference system: set it by crs=, for instance EPSG:25832")
    if nameless:
        log.note(_assumed(nameless, crs))
    require_metric(crs, str(images[0].path) if images and not clouds else "the scene")
    return crs


def _extent_of_points(clouds: Sequence[LasHeader]) -> list[tuple[str, Extent]]:
    """Return the bounds of all point files, rounded outwards to metres, with their name; empty without any."""
    if not clouds:
        return []
    corners = np.array([cloud.bounds for cloud in clouds])
    low, high = np.floor(corners[:, :2].min(axis=0)), np.ceil(corners[:, 3:5].max(axis=0))
    high = np.maximum(high, low + 1)
    return [(f"{file_paths([cloud.path for cloud in clouds])} (points)", (*low.tolist(), *high.tolist()))]


def _extent_of_rasters(headers: Sequence[RasterHeader], crs: str, what: str) -> list[tuple[str, Extent]]:
    """Return the bounds of all rasters of a layer with their name; empty without any."""
    if not headers:
        return []
    corners = np.array([warped_extent(header, crs) for header in headers])
    bounds = (*corners[:, :2].min(axis=0).tolist(), *corners[:, 2:].max(axis=0).tolist())
    return [(f"{file_paths([header.path for header in headers])} ({what})", bounds)]


def _decide_extent(wanted: Extent | None, parts: list[tuple[str, Extent]], log: ImportLog) -> Extent:
    """Return what all parts and the extent that was asked for have in common."""
    layers = len(parts)
    named = parts if wanted is None else [*parts, ("the extent asked for", wanted)]
    where, extent = named[0]
    for other, bounds in named[1:]:
        common = common_extent(extent, bounds)
        if common is None:
            raise InputError(
                f"{other} covers {extent_text(bounds)} and does not overlap {where}, "
                f"which covers {extent_text(extent)}: check that they show the same place in the CRS that they name"
            )
        extent = common
    if wanted is not None and extent != wanted:
        log.note(f"the extent asked for was cut to {extent_text(extent)}, where there are data")
    elif layers == 2 and wanted is None and extent != parts[0][1]:
        heights = "points" if parts[0][0].endswith("(points)") else "surface model"
        log.note(f"{heights} and image have {extent_text(extent)} in common; what lies outside was left out")
    return extent


def _assumed(nameless: Sequence[Path], crs: str) -> str:
    were = "was" if len(nameless) == 1 else "were"
    return f"{file_names(nameless)} had no CRS and {were} taken to be in {crs_label(crs)}"
