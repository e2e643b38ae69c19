"""Import: a scene folder from files in common formats.

Point files, orthoimages, an elevation model, footprints and an evaluation area, each in its own file format, cell size
and perhaps CRS, are brought to one CRS and one extent (`placing`). A layer that is absent can be derived: the DEM from
ground points or by a ground filter, the orthoimage from coloured points, the reference from building points.

Everything that was assumed, resampled, repaired, left out or derived is a *note*: one sentence, reported as it happens
and kept in the manifest of the scene.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import shapely

from ...core.output import check_folder
from ..folder import SCENE_FILES, open_scene, save_scene
from ..geodata.footprints import Footprints
from ..geodata.image_bands import band_names
from ..geodata.las_files import LasHeader, read_las_header
from ..geodata.points import PointCloud
from ..geodata.raster import Elevation, Image
from ..geodata.raster_headers import RasterHeader, read_raster_header
from ..scene import Scene
from .area_layer import area_of_extent, read_area
from .dem_layer import dem_of, dem_of_points
from .image_layer import image_of, image_of_points
from .infrared_files import separated
from .place import ImportLog, Place
from .placing import assign_crs, decide_place
from .point_layer import points_of
from .reference_layer import blocks_of, read_reference, rectangles_of, reference_of_class
from .request import ImportRequest
from .surface_layer import points_of_surface

__all__ = ["import_scene"]


class _Headers(NamedTuple):
    clouds: list[LasHeader]
    surfaces: list[RasterHeader]
    images: list[RasterHeader]
    infrared: list[RasterHeader]
    models: list[RasterHeader]


def import_scene(
    output: str | os.PathLike[str],
    request: ImportRequest,
    *,
    overwrite: bool = False,
    note: Callable[[str], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Scene:
    """Make a scene folder and open it.

    Parameters
    ----------
    output : path
        Folder to make.
    request : ImportRequest
        Input files and options.
    overwrite : bool
        Replace the folder if it exists.
    note : callable, optional
        Called with one sentence for each thing that was assumed, resampled, repaired, left out or derived.
    progress : callable, optional
        Called with (points read, points in all).

    Returns
    -------
    Scene
        The scene opened from `output`; its notes are in ``scene.facts["notes"]``.

    Raises
    ------
    InputError, CRSError, ParameterError, OutputError
        One sentence on what cannot be used; nothing is left behind.

    Examples
    --------
    >>> request = ImportRequest(points=["tile-1.laz", "tile-2.laz"], crs="EPSG:28992", reference="register.gpkg")
    >>> scene = import_scene("delft", request)  # doctest: +SKIP
    """
    target = Path(output)
    check_folder(target, overwrite, holds=SCENE_FILES)
    log = ImportLog(note)
    clouds = [read_las_header(file, fallback=request.crs) for file in request.point_files]
    images = [read_raster_header(file) for file in request.image_files]
    surfaces, infrared, models = (
        [read_raster_header(file) for file in files]
        for files in (request.surface_files, request.infrared_files, request.dem_files)
    )
    for image in images:
        band_names(image, request.bands)
    if not infrared:
        images, infrared = separated(images, request.bands, log)
    place, surfaces, images = decide_place(request, clouds, surfaces, images, log)
    infrared, models = assign_crs(infrared, place.crs, log), assign_crs(models, place.crs, log)
    headers = _Headers(clouds, surfaces, images, infrared, models)

    # Small files first: an error in them is reported before the long reading of points.
    reference, area = _read_vectors(request, place)
    cloud = points_of(place, clouds, progress) if clouds else None
    if surfaces:
        cloud = points_of_surface(place, surfaces)
    picture = _image(request, place, headers, cloud)
    dem = _dem(request, place, headers, cloud)
    reference = _finished_reference(request, place, cloud, reference)
    if reference is not None and area is None:
        area = area_of_extent(place, reference)

    facts = {"source": request.source, "licence": request.licence, "derived": log.derived, "notes": log.notes}
    scene = Scene(
        request.name if request.name is not None else target.resolve().name,
        place.extent,
        crs=place.crs,
        points=cloud,
        image=picture,
        dem=dem,
        reference=reference,
        area=area,
        facts={key: value for key, value in facts.items() if value},
    )
    save_scene(scene, target, overwrite=overwrite)
    return open_scene(target)


def _read_vectors(request: ImportRequest, place: Place) -> tuple[Footprints | None, shapely.Geometry | None]:
    reference = None
    if request.reference is not None:
        reference = read_reference(place, os.fspath(request.reference), request.building_id)
    return reference, None if request.area is None else read_area(place, os.fspath(request.area))


def _image(request: ImportRequest, place: Place, headers: _Headers, cloud: PointCloud | None) -> Image | None:
    if cloud is not None and request.ortho_from_points:
        return image_of_points(place, cloud, request.gsd, request.point_files)
    if not headers.images:
        return None
    return image_of(place, headers.images, request.gsd, request.bands, headers.infrared)


def _dem(request: ImportRequest, place: Place, headers: _Headers, cloud: PointCloud | None) -> Elevation | None:
    if headers.models:
        return dem_of(place, headers.models, request.dem_cell, cloud, request.ground_filter)
    return None if cloud is None else dem_of_points(place, cloud, request.dem_cell, request.ground_filter)


def _finished_reference(
    request: ImportRequest, place: Place, cloud: PointCloud | None, reference: Footprints | None
) -> Footprints | None:
    """Return the reference, derived where it was asked for, joined and decomposed."""
    if cloud is not None and request.reference_from_class:
        reference = reference_of_class(place, cloud, request.point_files)
    if reference is not None and request.join_gaps is not None:
        reference = blocks_of(place, reference, request.join_gaps)
    if reference is not None and request.as_rectangles:
        reference = rectangles_of(place, reference)
    return reference
