"""Import: a scene folder from what people have.

Point files, orthoimages, an elevation model, footprints and an evaluation area, each in its own file format, cell size
and perhaps CRS, are brought to one CRS and one extent. What is absent can be derived, and is then *said to be derived*:
the DEM from ground points or by a ground filter, the orthoimage from coloured points, the reference from building
points.

Everything that was assigned, resampled, mended, left out or derived is a *note*: one sentence, reported as it happens
and kept in the manifest of the scene.

Order of decisions: the points name the CRS (else the first image); the extent is what points and images have in common,
cut to the one asked for.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...core.errors import CRSError, InputError, ParameterError
from ...core.output import check_folder
from ..folder import HOLDS, open_scene, save_scene
from ..geodata.crs import crs_label, named_crs, require_metric, same_crs, scale_warning
from ..geodata.las_files import LasHeader, read_las_header
from ..geodata.raster_files import RasterHeader, band_names, read_raster_header
from ..geodata.raster_mosaic import warped_extent
from ..scene import Scene
from . import layers as layers
from .layers import Extent, ImportLog, Place

__all__ = ["import_scene"]

_Path = str | os.PathLike[str]


def import_scene(
    output: _Path,
    *,
    points: Sequence[_Path] | _Path = (),
    ortho: Sequence[_Path] | _Path = (),
    dem: Sequence[_Path] | _Path = (),
    reference: _Path | None = None,
    area: _Path | None = None,
    crs: str | None = None,
    bands: Sequence[str] | None = None,
    gsd: float | None = None,
    dem_cell: float | None = None,
    ground_filter: str | None = None,
    building_id: str | None = None,
    reference_from_class: bool = False,
    ortho_from_points: bool = False,
    as_rectangles: bool = False,
    join_gaps: float | None = None,
    extent: Sequence[float] | None = None,
    name: str | None = None,
    source: str | None = None,
    licence: str | None = None,
    overwrite: bool = False,
    note: Callable[[str], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Scene:
    """Make a scene folder and open it.

    Parameters
    ----------
    output : path
        Folder to make.
    points : path or sequence of path
        LAS, LAZ or COPC files in one projected CRS in metres.
    ortho : path or sequence of path
        Orthoimages (GeoTIFF), mosaicked; those in another CRS or of another cell size are resampled.
    dem : path or sequence of path
        Bare-earth elevation (GeoTIFF), its gaps interpolated. Without it, it is derived: from points of classes 2
        (ground) and 9 (water), else by a ground filter.
    reference : path
        Footprints in any vector format; transformed when in another CRS.
    area : path
        Polygons inside which the reference is complete.
    crs : str, optional
        CRS of what names none.
    bands : sequence of str, optional
        Names of the image's bands in order: ``red``, ``green``, ``blue``, ``nir``, ``grey``, ``-`` to skip one.
    gsd : float, optional
        Cell size of the orthoimage, metres; by default that of the first file, or one that suits the points.
    dem_cell : float, optional
        Cell size of the DEM, metres; by default that of the file, 1 m when derived (more for sparse points).
    ground_filter : str, optional
        ``"opening"`` or ``"cloth"`` (extra ``ground``): derive the DEM by this filter even from classified points.
    building_id : str, optional
        Column of the reference that tells which footprints are one building.
    reference_from_class : bool
        Derive the reference from the points of class 6 (building).
    ortho_from_points : bool
        Derive the orthoimage from coloured points.
    as_rectangles : bool
        Decompose the reference into rectangles that share a building id.
    join_gaps : float, optional
        Join footprints of the reference over gaps below this, metres: the houses of a row become blocks.
    extent : sequence of float, optional
        ``(xmin, ymin, xmax, ymax)``, metres: what to keep.
    name, source, licence : str, optional
        For the manifest; the name is that of the folder when not given.
    overwrite : bool
        Replace the folder if it exists.
    note : callable, optional
        Called with one sentence for each thing that was assigned, resampled, mended, left out or derived.
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
    """
    point_files, image_files, dem_files = _paths(points), _paths(ortho), _paths(dem)
    _check_choices(
        {"points": point_files, "ortho": image_files, "reference": reference, "building_id": building_id},
        {
            "reference_from_class": reference_from_class,
            "ortho_from_points": ortho_from_points,
            "as_rectangles": as_rectangles,
            "join_gaps": join_gaps is not None,
        },
        {"gsd": gsd, "dem_cell": dem_cell},
    )
    if ground_filter not in (None, "opening", "cloth"):
        raise ParameterError(f"ground_filter= must be opening or cloth, not {ground_filter!r}")
    if ground_filter is not None and dem_files:
        raise ParameterError("give dem= or ground_filter=, not both")
    if bands is not None and not image_files:
        raise ParameterError("bands= names the bands of an image: give ortho=")
    if name is not None and not name.strip():
        raise ParameterError("name= must not be empty: leave it out for the name of the folder")
    wanted = None if extent is None else _checked_extent(extent)
    target = Path(output)
    check_folder(target, overwrite, holds=HOLDS)
    log = ImportLog(note)

    clouds = [read_las_header(file) for file in point_files]
    images = [read_raster_header(file) for file in image_files]
    models = [read_raster_header(file) for file in dem_files]
    for image in images:
        band_names(image, bands)
    scene_crs = _decide_crs(crs, clouds, images, log)
    images, models = _assigned(images, scene_crs, log), _assigned(models, scene_crs, log)
    place = Place(scene_crs, _decide_extent(wanted, scene_crs, clouds, images, log), log)
    stretched = scale_warning(
        scene_crs, (place.extent[0] + place.extent[2]) / 2, (place.extent[1] + place.extent[3]) / 2
    )
    if stretched:
        log.note(stretched)

    # Small files first: what is wrong with them is told before the long reading of points.
    footprints = None if reference is None else layers.read_reference(place, os.fspath(reference), building_id)
    complete = None if area is None else layers.read_area(place, os.fspath(area))
    cloud = layers.points_of(place, clouds, progress) if clouds else None
    picture = None
    if cloud is not None and ortho_from_points:
        picture = layers.image_of_points(place, cloud, gsd, point_files)
    elif images:
        picture = layers.image_of(place, images, gsd, bands)
    ground = None
    if models:
        ground = layers.dem_of(place, models, dem_cell, cloud)
    elif cloud is not None:
        ground = layers.dem_of_points(place, cloud, dem_cell, ground_filter)
    if cloud is not None and reference_from_class:
        footprints = layers.reference_of_class(place, cloud, point_files)
    if footprints is not None and join_gaps is not None:
        footprints = layers.blocks_of(place, footprints, join_gaps)
    if footprints is not None and as_rectangles:
        footprints = layers.rectangles_of(place, footprints)
    if footprints is not None and complete is None:
        complete = layers.area_of_extent(place, footprints)

    facts = {"source": source, "licence": licence, "derived": log.derived, "notes": log.notes}
    scene = Scene(
        name if name is not None else target.resolve().name,
        place.extent,
        crs=place.crs,
        points=cloud,
        image=picture,
        dem=ground,
        reference=footprints,
        area=complete,
        facts={key: value for key, value in facts.items() if value},
    )
    save_scene(scene, target, overwrite=overwrite)
    return open_scene(target)


def _check_choices(given: dict[str, object], asked: dict[str, bool], lengths: dict[str, float | None]) -> None:
    """Raise `ParameterError` when what was asked for excludes or lacks something."""
    if not given["points"] and not given["ortho"]:
        raise ParameterError("a scene needs points or an orthoimage: give points= or ortho=")
    for one, other in (("reference", "reference_from_class"), ("ortho", "ortho_from_points")):
        if given[one] and asked[other]:
            raise ParameterError(f"give {one}= or {other}=, not both")
    for other in ("reference_from_class", "ortho_from_points"):
        if asked[other] and not given["points"]:
            raise ParameterError(f"{other}= needs points: give points=")
    for option in ("as_rectangles", "join_gaps"):
        if asked[option] and not (given["reference"] or asked["reference_from_class"]):
            raise ParameterError(f"{option}= needs a reference: give reference= or reference_from_class=")
    if given["building_id"] and not given["reference"]:
        raise ParameterError("building_id= names a column of the reference: give reference=")
    for name, value in lengths.items():
        if value is not None and not 0.01 <= value <= 100:
            raise ParameterError(f"{name}= must be from 0.01 to 100 m, not {value:g}")


def _checked_extent(extent: Sequence[float]) -> Extent:
    if len(extent) != 4 or not np.isfinite(extent).all() or extent[2] <= extent[0] or extent[3] <= extent[1]:
        raise ParameterError(f"extent={tuple(extent)} must be xmin ymin xmax ymax, metres, of an area")
    xmin, ymin, xmax, ymax = map(float, extent)
    return xmin, ymin, xmax, ymax


def _decide_crs(given: str | None, clouds: list[LasHeader], images: list[RasterHeader], log: ImportLog) -> str:
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
            f"{nameless[0]} names no CRS while {named[0].path} is in {crs_label(crs)}: if it is in the same, "
            "say so by crs="
        )
    if crs is None:
        crs = next((image.crs for image in images if image.crs is not None), None) if not clouds else None
    if crs is None:
        first = nameless[0] if nameless else images[0].path
        raise CRSError(f"{first} names no coordinate reference system: set it by crs=, for instance EPSG:25832")
    if nameless:
        log.note(_assumed(nameless, crs))
    require_metric(crs, str(images[0].path) if images and not clouds else "the scene")
    return crs


def _assigned(headers: list[RasterHeader], crs: str, log: ImportLog) -> list[RasterHeader]:
    """Give rasters without a CRS the scene's, and say so."""
    nameless = [header.path for header in headers if header.crs is None]
    if nameless:
        log.note(_assumed(nameless, crs))
    return [replace(header, crs=header.crs or crs) for header in headers]


def _decide_extent(
    wanted: Extent | None, crs: str, clouds: list[LasHeader], images: list[RasterHeader], log: ImportLog
) -> Extent:
    parts: list[tuple[str, Extent]] = []
    if clouds:
        corners = np.array([cloud.bounds for cloud in clouds])
        low, high = np.floor(corners[:, :2].min(axis=0)), np.ceil(corners[:, 3:5].max(axis=0))
        high = np.maximum(high, low + 1)
        parts.append((f"{layers.some([c.path for c in clouds])} (points)", (*low.tolist(), *high.tolist())))
    if images:
        corners = np.array([warped_extent(image, crs) for image in images])
        shown = (*corners[:, :2].min(axis=0).tolist(), *corners[:, 2:].max(axis=0).tolist())
        parts.append((f"{layers.some([i.path for i in images])} (image)", shown))
    if wanted is not None:
        parts.append(("the extent asked for", wanted))
    where, extent = parts[0]
    for other, bounds in parts[1:]:
        common = layers.common(extent, bounds)
        if common is None:
            raise InputError(
                f"{other} covers {layers.text(bounds)} and does not overlap {where}, "
                f"which covers {layers.text(extent)}: check that they show the same place in the CRS that they name"
            )
        extent = common
    if wanted is not None and extent != wanted:
        log.note(f"the extent asked for was cut to {layers.text(extent)}, where there are data")
    elif len(parts) == 2 and clouds and images and extent != parts[0][1]:
        log.note(f"points and image have {layers.text(extent)} in common; what lies outside was left out")
    return extent


def _paths(value: Sequence[_Path] | _Path) -> tuple[Path, ...]:
    paths = (Path(value),) if isinstance(value, str | os.PathLike) else tuple(map(Path, value))
    seen: set[Path] = set()
    for path in paths:
        if path.resolve() in seen:
            raise ParameterError(f"{path} is given twice: its points or pixels would count double")
        seen.add(path.resolve())
    return paths


def _assumed(nameless: Sequence[Path], crs: str) -> str:
    were = "was" if len(nameless) == 1 else "were"
    return f"{layers.brief(nameless)} named no CRS and {were} taken to be in {crs_label(crs)}"
