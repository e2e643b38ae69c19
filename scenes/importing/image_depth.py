"""The depth of images that are imported: values of fewer bits than 16 in 16-bit files are scaled, with a note."""

from __future__ import annotations

from collections.abc import Sequence

from ..geodata.colour_depth import common_depths, depth_note
from ..geodata.raster import Grid
from ..geodata.raster_headers import RasterHeader
from ..geodata.raster_mosaic import largest_value
from .place import Place, file_names

__all__ = ["image_depths"]


def image_depths(
    place: Place,
    images: Sequence[RasterHeader],
    infrared: Sequence[RasterHeader],
    grid: Grid,
    bands: Sequence[str] | None,
) -> tuple[list[int], list[int]]:
    """Return the bits of the values of images and of infrared beside them, and note those below 16.

    Infrared is compared with red, so that both have one depth where both are of one band and type; else that of
    infrared is decided with its scale (`infrared_layer`).
    """
    headers = [(header, bands) for header in images]
    if all((header.band_count, header.dtype) == (1, "uint16") for header in infrared):
        headers += [(header, ("nir",)) for header in infrared]
    if any(header.dtype != "uint16" for header in images):
        return [16] * len(images), [16] * len(infrared)
    unnamed = [(header, names) for header, names in headers if header.depth is None]
    largest = [largest_value(header, grid, crs=place.crs, bands=names) for header, names in unnamed]
    found = dict(zip((header.path for header, _ in unnamed), common_depths(largest), strict=True))
    depths = [header.depth or found[header.path] for header, _ in headers]
    for depth in sorted(set(depths) - {16}):
        files = [header.path for (header, _), own in zip(headers, depths, strict=True) if own == depth]
        place.log.note(f"{file_names(files)}: {depth_note(depth)}")
    return depths[: len(images)], depths[len(images) :] or [16] * len(infrared)
