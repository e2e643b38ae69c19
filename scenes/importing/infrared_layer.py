"""Near infrared from a file of its own: the band that an orthoimage of red, green and blue lacks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.errors import InputError
from ..geodata.infrared_values import unlike_infrared
from ..geodata.raster import Image
from ..geodata.raster_headers import RasterHeader
from ..geodata.raster_mosaic import mosaic_image
from .place import Place, extent_text, file_names, file_paths
from .raster_layer import note_resampling

__all__ = ["with_infrared"]


def with_infrared(
    place: Place, image: Image, infrared: Sequence[RasterHeader], depths: Sequence[int] | None = None
) -> Image:
    """Return an image with near infrared as a further band, on the cells of the image.

    `depths` are the bits of the values of each file; those below 16 are scaled to 16.

    Raises
    ------
    InputError
        The image has infrared already or no red; the file has several bands, other numbers than the image, no data in
        the place, the values of a mask, or those of another band.
    """
    files = [header.path for header in infrared]
    named = file_paths(files)
    if "nir" in image.bands:
        raise InputError(f"the orthoimage has a band nir already, and nir= names another, {named}: give one of them")
    if "red" not in image.bands:
        raise InputError(
            f"infrared is compared with red, and the orthoimage has only {', '.join(image.bands)}: give RGB"
        )
    for header in infrared:
        if header.band_count != 1:
            raise InputError(
                f"{header.path} has {header.band_count} bands, expected near infrared alone: take that band out, for "
                "instance with gdal_translate -b 1, or give all bands as one image and name them by bands="
            )
        if header.dtype != image.values.dtype.name:
            raise InputError(
                f"{header.path} is {header.dtype} but the orthoimage {image.values.dtype.name}: convert one of them, "
                "for instance with gdal_translate -ot"
            )
    note_resampling(place, infrared, image.grid)
    band = mosaic_image(infrared, image.grid, crs=place.crs, bands=("nir",), depths=depths)
    valid = np.ones(image.grid.shape, dtype=bool) if image.valid is None else image.valid
    both = valid if band.valid is None else valid & band.valid
    if not both.any():
        raise InputError(f"{named} has no data where the orthoimage has, {extent_text(place.extent)}: check its CRS")
    colours = {name: other[both] for name, other in zip(image.bands, image.values, strict=True)}
    reason = unlike_infrared(band.values[0][both], colours)
    if reason:
        raise InputError(f"{named} {reason}: give near infrared")
    if both.sum() < valid.sum():
        place.log.note(
            f"{file_names(files)} covers {both.sum() / valid.sum():.1%} of the orthoimage; the rest is left out"
        )
    return Image(
        np.concatenate([image.values, band.values]), (*image.bands, "nir"), image.grid, None if both.all() else both
    )
