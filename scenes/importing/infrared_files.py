"""Which of the images that are given together are infrared of the place that the others show in colour.

Images of one scene are a mosaic of equal bands. Where some show red, green and blue, and others near infrared without
blue, they are combined (`infrared_layer`). A file says that it holds near infrared by the descriptions or colours of
its bands; a file of one or three bands that are not described says it by its own name (``ir``, ``nir``, ``cir``,
``irc``, ...). Three bands that nothing names are compared with the colours of the other images.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..geodata.image_bands import IMAGE_TYPES, band_names, described_bands, says_infrared
from ..geodata.raster import Grid
from ..geodata.raster_headers import RasterHeader
from ..geodata.raster_mosaic import mosaic_image, warped_extent
from .infrared_layer import shows_colour_infrared
from .place import ImportLog, Place, common_extent, file_names

__all__ = ["separated", "separated_by_values"]

_COLOURS = {"red", "green", "blue"}
#: Share of an image that another one must cover, and cells over which both are compared, at most.
_COVERED, _CELLS = 0.5, 1_000_000


def separated(
    images: Sequence[RasterHeader], bands: Sequence[str] | None, log: ImportLog
) -> tuple[list[RasterHeader], list[RasterHeader]]:
    """Return the images in colour and those that say that they are near infrared; all and none where none are beside.

    `bands` names the bands of all images, which are then alike.
    """
    infrared = [header for header in images if bands is None and says_infrared(header)]
    colour = [header for header in images if header not in infrared]
    if not infrared or not colour or any(set(band_names(header, None)) != _COLOURS for header in colour):
        return list(images), []
    _note(infrared, log)
    return colour, infrared


def separated_by_values(place: Place, images: Sequence[RasterHeader]) -> tuple[list[RasterHeader], list[RasterHeader]]:
    """Return the images in colour and those of three unnamed bands that are colour infrared by their values."""
    if len(images) < 2 or any(set(band_names(header, None)) != _COLOURS for header in images):
        return list(images), []
    infrared = [
        header
        for header in images
        if not any(described_bands(header)) and any(_infrared_of(place, header, other) for other in images)
    ]
    colour = [header for header in images if header not in infrared]
    if not infrared or not colour:
        return list(images), []
    _note(infrared, place.log)
    return colour, infrared


def _note(infrared: Sequence[RasterHeader], log: ImportLog) -> None:
    log.note(f"{file_names([header.path for header in infrared])}: taken for near infrared of the orthoimage")


def _infrared_of(place: Place, header: RasterHeader, other: RasterHeader) -> bool:
    """Return whether an image shows near infrared, red and green of another one that covers it in large part."""
    if header is other or other.dtype not in IMAGE_TYPES:
        return False
    own, beside = warped_extent(header, place.crs), warped_extent(other, place.crs)
    common = common_extent(own, beside)
    if common is None or _area(common) < _COVERED * min(_area(own), _area(beside)):
        return False
    part = common_extent(common, place.extent)
    if part is None:
        return False
    cell = max(2 * header.grid.gsd, 2 * other.grid.gsd, (_area(part) / _CELLS) ** 0.5)
    image = mosaic_image([other], Grid.covering(part, cell), crs=place.crs)
    return shows_colour_infrared(place, [header], image)


def _area(extent: Sequence[float]) -> float:
    return (extent[2] - extent[0]) * (extent[3] - extent[1])
