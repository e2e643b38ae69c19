"""Import of tiles: many files become a scene that is read by window, and none of them is converted.

The files are linked into the scene folder (copied where the folder lies on another disk) under their own names after
``points_``, ``ortho_``, ``nir_`` or ``dem_``, and indexed as `tile_index` does; reference and area are imported as for
any scene.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import InputError, ParameterError
from ...core.output import whole_folder
from ..folder import FILES, SCENE_FILES, open_scene, write_area, write_reference
from ..geodata.image_bands import IMAGE_TYPES
from ..geodata.point_chunks import CHUNK_INDEX
from ..geodata.raster_headers import read_raster_header
from .area_layer import area_of_extent, read_area
from .infrared_files import separated, separated_by_values
from .place import ImportLog, Place
from .reference_layer import blocks_of, read_reference, rectangles_of
from .request import ImportRequest
from .tile_index import IndexedFolder, index_folder

__all__ = ["import_tiles"]

#: Names in such a folder.
_HOLDS = (*SCENE_FILES, CHUNK_INDEX, "points_*", "ortho_*", "nir_*", "dem_*")
#: Options that would need the whole in memory, or other files than those given.
_CHANGING = (
    "dsm", "bands", "gsd", "dem_cell", "ground_filter", "reference_from_class", "ortho_from_points", "extent",
)  # fmt: skip


def import_tiles(
    output: str | os.PathLike[str],
    request: ImportRequest,
    *,
    overwrite: bool = False,
    note: Callable[[str], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> IndexedFolder:
    """Make a scene folder of tiles.

    Parameters
    ----------
    output : path
        Folder to make.
    request : ImportRequest
        Points, images and elevation models are taken as they are: options that change or derive them are refused.
    overwrite : bool
    note : callable, optional
        Called with one sentence for each thing that was repaired or left out of the reference.
    progress : callable, optional
        Called with (files read, files in all).

    Raises
    ------
    InputError, CRSError, ParameterError, OutputError
        One sentence; nothing is left behind.
    """
    for name in _CHANGING:
        if getattr(request, name):
            raise ParameterError(f"tiled=True takes files as they are: leave out {name}=")
    log = ImportLog(note)
    with whole_folder(output, holds=_HOLDS, overwrite=overwrite) as folder:
        given = {"points": request.point_files, **_images(request), "dem": request.dem_files}
        for layer, files in given.items():
            for file in files:
                _require_kind(layer, file)
                _link(file, folder / f"{layer}_{file.name}")
        name = request.name or Path(output).resolve().name
        facts: dict[str, Any] = {key: value for key in ("source", "licence") if (value := getattr(request, key))}
        scene = index_folder(folder, crs=request.crs, name=name, progress=progress).scene
        assert scene.crs is not None
        if request.reference is not None or request.area is not None:
            _write_vectors(request, Place(scene.crs, scene.extent, log), folder)
        if log.notes:
            facts["notes"] = log.notes
        # Once more, with the vectors; the files that were read are known.
        found = index_folder(folder, crs=request.crs, name=name, facts=facts)
    return IndexedFolder(open_scene(output), found.problems, found.notes)


def _images(request: ImportRequest) -> dict[str, tuple[Path, ...]]:
    """Return orthoimages, and files of near infrared beside them, by the beginning of their new names."""
    if request.infrared_files or len(request.image_files) < 2:
        return {"ortho": request.image_files, "nir": request.infrared_files}
    headers = [read_raster_header(file) for file in request.image_files]
    colour, infrared = separated(headers, None, ImportLog())
    crs = request.crs or next((header.crs for header in headers if header.crs is not None), None)
    if not infrared and crs is not None:
        bounds = np.array([header.grid.extent for header in headers])
        extent = (*bounds[:, :2].min(axis=0).tolist(), *bounds[:, 2:].max(axis=0).tolist())
        colour, infrared = separated_by_values(Place(crs, extent, ImportLog()), headers)
    return {"ortho": tuple(header.path for header in colour), "nir": tuple(header.path for header in infrared)}


def _require_kind(layer: str, file: Path) -> None:
    """Refuse a raster that the index would take for another layer."""
    if layer in ("points", "nir"):
        return
    is_image = read_raster_header(file).dtype in IMAGE_TYPES
    if layer == "dem" and is_image:
        raise InputError(f"{file} has cells without sign, as images have: convert the elevations to Int16 or Float32")
    if layer == "ortho" and not is_image:
        raise InputError(f"{file} has cells of {read_raster_header(file).dtype}, an orthoimage has uint8 or uint16")


def _link(file: Path, target: Path) -> None:
    if file.suffix.lower() == ".vrt":
        raise InputError(f"{file} names other files by their places: index its folder with 'roofbench scenes index'")
    if target.exists():
        raise InputError(f"{file}: another file of this name is given: rename one, they share a folder")
    if not file.is_file():
        raise InputError(f"{file}: no such file")
    try:
        os.link(file.resolve(), target)
    except OSError:
        # Another disk, or a system without links.
        shutil.copyfile(file, target)


def _write_vectors(request: ImportRequest, place: Place, folder: Path) -> None:
    reference = None
    if request.reference is not None:
        reference = read_reference(place, os.fspath(request.reference), request.building_id)
        if request.join_gaps is not None:
            reference = blocks_of(place, reference, request.join_gaps)
        if request.as_rectangles:
            reference = rectangles_of(place, reference)
        write_reference(reference, folder / FILES["reference"], place.crs)
    area = None if request.area is None else read_area(place, os.fspath(request.area))
    if reference is not None and area is None:
        area = area_of_extent(place, reference)
    if area is not None:
        write_area(area, folder / FILES["area"], place.crs)
