"""Label images: footprints from an image with one id per building, or from a mask whose components are the buildings.

Nouns
-----
label image
    One band of whole numbers; 0 and cells without data are background. Several ids: all cells of an id are one
    building, also where they lie apart.
mask
    A label image with a single value beside the background: each set of cells that are connected by their edges is a
    building. Cells that meet only at a corner are not connected.

Outlines run along the edges of the cells, so areas are numbers of cells times their size.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import InputError

__all__ = ["ENDINGS", "read_labels"]

#: Endings of images.
ENDINGS = (".tif", ".tiff", ".png", ".vrt", ".img", ".jp2")


def read_labels(path: str | os.PathLike[str]) -> tuple[NDArray[np.object_], dict[str, NDArray[Any]], str | None]:
    """Return the outlines of a label image or mask, their ids (attribute ``label``) and the CRS.

    Parameters
    ----------
    path : path
        With an affine transform, as GeoTIFF or with a world file.

    Raises
    ------
    InputError
        Missing or damaged file, no georeference, several bands, or values that are no ids.
    """
    from rasterio import features

    from .opened_rasters import opened
    from .raster_headers import source_crs

    file = Path(path)
    with opened(file) as source:
        if source.transform.is_identity:
            raise InputError(
                f"{file} has no affine transform, so its cells have no size in metres: use a GeoTIFF, or put a world "
                "file beside it"
            )
        if source.count > 1:
            raise InputError(
                f"{file} has {source.count} bands: a label image or mask has one band of whole numbers, 0 where there "
                "is no building"
            )
        values = source.read(1)
        known = source.read_masks(1) > 0
        transform, crs = source.transform, source_crs(file, source) if source.crs else None
    if values.dtype.kind == "f":
        known &= np.isfinite(values)
        if (values[known] != np.round(values[known])).any():
            raise InputError(
                f"{file} holds values that are not whole numbers: a label image has ids and a mask 0 and 1; apply a "
                "threshold to a map of probabilities first"
            )
    elif values.dtype.kind not in "iu":
        raise InputError(f"{file} holds {values.dtype} values: a label image has one band of whole numbers")
    known &= values != 0
    ids, code = np.unique(values[known], return_inverse=True)
    cells = np.zeros(values.shape, dtype=np.int32)
    cells[known] = code + 1
    found = list(features.shapes(cells, mask=known, connectivity=4, transform=transform))
    polygons = np.array(
        [shapely.Polygon(one["coordinates"][0], one["coordinates"][1:]) for one, _ in found], dtype=object
    )
    owner = np.array([int(value) - 1 for _, value in found], dtype=np.int64)
    if len(ids) > 1:
        order = np.argsort(owner, kind="stable")
        groups = np.split(polygons[order], np.flatnonzero(np.diff(owner[order])) + 1)
        polygons = np.empty(len(ids), dtype=object)
        polygons[:] = [group[0] if len(group) == 1 else shapely.MultiPolygon(list(group)) for group in groups]
        owner = np.arange(len(ids))
    return polygons, {"label": ids[owner].astype(np.int64)}, crs
