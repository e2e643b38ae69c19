"""Near infrared from files of their own: the band that an orthoimage of red, green and blue lacks.

The files hold near infrared alone or colour infrared (near infrared, red, green), in any type; their values are brought
to the scale of the colours (`infrared_scale`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ..geodata.colour_depth import common_depths
from ..geodata.image_bands import COLOUR_INFRARED, assumed_bands, band_names, infrared_bands, require_infrared
from ..geodata.infrared_scale import (
    band_of_shares,
    gain_of_grey_surfaces,
    gain_of_red,
    shows_red_and_green_of,
    white_of,
)
from ..geodata.infrared_values import unlike_infrared
from ..geodata.raster import Grid, Image
from ..geodata.raster_headers import RasterHeader
from ..geodata.raster_mosaic import largest_value, mosaic_bands, mosaic_image
from .place import Place, extent_text, file_names, file_paths
from .raster_layer import note_resampling

__all__ = ["gain_of", "kind_of_values", "shows_colour_infrared", "with_infrared"]

#: Pixels over which images are averaged before they are compared.
_BLUR = 5


def with_infrared(
    place: Place, image: Image, infrared: Sequence[RasterHeader], depths: Sequence[int] | None = None
) -> Image:
    """Return an image with near infrared as a further band, on the cells of the image.

    `depths` are the bits of the values of each file of the type of the image; those below 16 are scaled to 16.

    Raises
    ------
    InputError
        The image has infrared already or no red; files of different bands, or whose bands have no names; no data in the
        place, the values of a mask, or those of another band.
    """
    files = [header.path for header in infrared]
    named = file_paths(files)
    if "nir" in image.bands:
        raise InputError(f"the orthoimage has a band nir already, and nir= names another, {named}: give one of them")
    if "red" not in image.bands:
        raise InputError(
            f"infrared is compared with red, and the orthoimage has only {', '.join(image.bands)}: give RGB"
        )
    note_resampling(place, infrared, image.grid)
    band, known = _band(place, image, infrared, depths)
    valid = np.ones(image.grid.shape, dtype=bool) if image.valid is None else image.valid
    both = valid if known is None else valid & known
    if not both.any():
        raise InputError(f"{named} has no data where the orthoimage has, {extent_text(place.extent)}: check its CRS")
    colours = {name: other[both] for name, other in zip(image.bands, image.values, strict=True)}
    reason = unlike_infrared(band[both], colours)
    if reason:
        raise InputError(f"{named} {reason}: give near infrared")
    if both.sum() < valid.sum():
        place.log.note(
            f"{file_names(files)} covers {both.sum() / valid.sum():.1%} of the orthoimage; the rest is left out"
        )
    return Image(
        np.concatenate([image.values, band[None]]), (*image.bands, "nir"), image.grid, None if both.all() else both
    )


def _band(
    place: Place, image: Image, infrared: Sequence[RasterHeader], depths: Sequence[int] | None
) -> tuple[NDArray[np.uint8] | NDArray[np.uint16], NDArray[np.bool_] | None]:
    """Return near infrared in the type of the image, and where it is known; None: everywhere."""
    alike = [header.band_count == 1 and header.dtype == image.values.dtype.name for header in infrared]
    if all(alike) and depths is not None:
        found = mosaic_image(infrared, image.grid, crs=place.crs, bands=("nir",), depths=depths)
        return found.values[0], found.valid
    first = infrared[0]
    for header in infrared[1:]:
        if (header.band_count, header.dtype) != (first.band_count, first.dtype):
            raise InputError(
                f"{header.path} has {header.band_count} bands of {header.dtype} but {first.path} {first.band_count} of "
                f"{first.dtype}: give infrared of one kind"
            )
    bands = _names(place, image, infrared)
    red = "red" in bands
    values = mosaic_bands(infrared, ("nir", "red") if red else ("nir",), image.grid, crs=place.crs, bands=bands)
    known = np.isfinite(values[0])
    if image.valid is not None:
        known &= image.valid
    white = white_of(values[:1], kind_of_values(first), _depth(place, infrared, image.grid, bands))
    shares = values / np.float32(white)
    return _scaled(place, image, infrared, shares, known, white), None if known.all() else known


def _scaled(
    place: Place,
    image: Image,
    infrared: Sequence[RasterHeader],
    shares: NDArray[np.float32],
    known: NDArray[np.bool_],
    white: float,
) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Return shares of white, those of near infrared before those of its red, in the type and scale of the image."""
    dtype = image.values.dtype
    names, header = file_names([header.path for header in infrared]), infrared[0]
    gain, why = gain_of(shares[:, known], _colours(image, known))
    if header.dtype != dtype.name:
        place.log.note(f"{names}: {header.dtype} values were converted to {dtype.name}, {white:g} taken for white")
    if gain != 1:
        place.log.note(f"{names}: near infrared was multiplied by {gain:.3g}, so that {why}")
    return band_of_shares(shares[0] * np.float32(gain), dtype.name)


def kind_of_values(header: RasterHeader) -> str:
    """Return the type of the values of a file; of scaled ones, such as reflectance, that of any measure."""
    return header.dtype if (header.scale, header.offset) == (1, 0) else "float32"


def gain_of(shares: NDArray[np.float32], colours: Mapping[str, NDArray[np.float32]]) -> tuple[float, str]:
    """Return the gain of near infrared, and why; shares of it and, in a second row, of its red where it has that."""
    found = gain_of_red(shares[1], colours["red"]) if len(shares) > 1 else None
    if found is not None:
        return found, "its red is that of the orthoimage"
    return gain_of_grey_surfaces(shares[0], colours), "grey surfaces are about as bright as in red"


def _colours(image: Image, known: NDArray[np.bool_]) -> Mapping[str, NDArray[np.float32]]:
    """Return the shares of the colours of an image where something is known."""
    return {name: image.band(name)[known] for name in image.bands}


def _depth(place: Place, infrared: Sequence[RasterHeader], grid: Grid, bands: Sequence[str] | None) -> int:
    """Return the bits of the values of files of 16 bit."""
    if infrared[0].dtype != "uint16":
        return 16
    if infrared[0].depth is not None:
        return infrared[0].depth
    largest = [largest_value(header, grid, crs=place.crs, bands=bands) for header in infrared]
    return common_depths([max(largest)])[0]


def _names(place: Place, image: Image, infrared: Sequence[RasterHeader]) -> tuple[str, ...]:
    """Return the bands of infrared files, which need near infrared among them."""
    header = infrared[0]
    if header.band_count == 1:
        return ("nir",)
    own, names, why = band_names(header, None), infrared_bands(header), "by its name"
    if names == own:
        require_infrared(header, None)
        if sentence := assumed_bands(header, None):
            place.log.note(sentence)
        return own
    if header.band_count == 3 and shows_colour_infrared(place, infrared, image):
        names, why = COLOUR_INFRARED, "its second and third band are red and green of the orthoimage"
    if names is not None:
        whose = file_names([one.path for one in infrared])
        place.log.note(f"{whose}: the bands were taken for {', '.join(names)}, {why}")
        return names
    raise InputError(
        f"{header.path} has {header.band_count} bands ({', '.join(own)}), expected near infrared alone or with its "
        "bands named: describe them (nir, red, green), or take that band out, for instance with gdal_translate -b 1"
    )


def shows_colour_infrared(place: Place, files: Sequence[RasterHeader], image: Image) -> bool:
    """Return whether files of three bands show near infrared, red and green of the flight of an image, by their values.

    Both are averaged over a few pixels, since one of them may be resampled.
    """
    import cv2

    values = mosaic_bands(files, band_names(files[0], None), image.grid, crs=place.crs)
    known = np.isfinite(values[0])
    if image.valid is not None:
        known &= image.valid
    if not known.any():
        return False
    inner = cv2.erode(known.astype(np.uint8), np.ones((_BLUR, _BLUR), np.uint8)) > 0
    bands = np.stack([cv2.blur(np.nan_to_num(band), (_BLUR, _BLUR))[inner] for band in values])
    colours = {name: cv2.blur(image.band(name), (_BLUR, _BLUR))[inner] for name in image.bands}
    return shows_red_and_green_of(bands, colours)
