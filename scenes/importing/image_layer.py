"""The orthoimage of a scene: a mosaic of files, or rastered from coloured points."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...core.errors import InputError
from ..geodata.grey_colours import is_grey
from ..geodata.image_bands import assumed_bands, looks_like_values, require_infrared
from ..geodata.points import PointCloud
from ..geodata.raster import Image
from ..geodata.raster_headers import RasterHeader
from ..geodata.raster_mosaic import mosaic_image
from .image_depth import image_depths
from .infrared_files import separated_by_values
from .infrared_layer import with_infrared
from .place import Place, extent_text, file_names, file_paths
from .raster_layer import check_size, grid_of, note_resampling

__all__ = ["image_of", "image_of_points"]


def image_of(
    place: Place,
    images: Sequence[RasterHeader],
    gsd: float | None,
    bands: Sequence[str] | None,
    infrared: Sequence[RasterHeader] = (),
) -> Image:
    """Return the mosaic of orthoimages on the cells of the first, or on cells of `gsd` metres.

    Near infrared of files of its own, if there is any, becomes a further band.
    """
    if bands is None and not infrared:
        images, infrared = separated_by_values(place, images)
    grid = grid_of(place, images[0], gsd)
    check_size(place, grid.gsd, "gsd")
    note_resampling(place, images, grid)
    for header in images:
        require_infrared(header, bands)
        sentence = assumed_bands(header, bands)
        if sentence:
            place.log.note(sentence)
    depths, infrared_depths = image_depths(place, images, infrared, grid, bands)
    image = mosaic_image(images, grid, crs=place.crs, bands=bands, depths=depths, note=place.log.note)
    if bands is None and (marked := [header.path for header in images if looks_like_values(header)]):
        place.log.note(
            f"{file_names(marked)}: the last band is marked as alpha and was taken for the mask, but holds many "
            "values: if it is near infrared, name the bands: red,green,blue,nir"
        )
    if bands is None and (masked := [header.path for header in images if header.mask_band and not header.mask_named]):
        place.log.note(
            f"{file_names(masked)}: the fourth band holds 0 and one other value and was taken for the mask: if it is "
            "near infrared, name the bands: red,green,blue,nir"
        )
    if image.valid is not None and not image.valid.any():
        raise InputError(
            f"{file_paths([header.path for header in images])} has no data in {extent_text(place.extent)}: image and "
            "points do not overlap"
        )
    image = _as_shown(place, image, [header.path for header in images])
    return with_infrared(place, image, infrared, infrared_depths) if infrared else image


def image_of_points(place: Place, points: PointCloud, gsd: float | None, files: Sequence[Path]) -> Image:
    """Return the orthoimage that coloured points give."""
    from ..geodata.coloured_points import image_from_points

    check_size(place, gsd or 0.1, "gsd")
    image = image_from_points(points, place.extent, gsd=gsd, source=file_paths(files))
    how = place.log.derived["image"] = f"rastered from the colours of the points, at {image.grid.gsd:g} m"
    place.log.note(f"the orthoimage was {how}")
    return _as_shown(place, image, files)


def _as_shown(place: Place, image: Image, files: Sequence[Path]) -> Image:
    """Return an image, as grey where its red, green and blue are equal, and note that and its gaps."""
    if image.is_colour and is_grey(image):
        place.log.note(f"{file_names(files)}: red, green and blue are equal, so that the image is grey")
        kept = [image.bands.index(name) for name in ("red", "nir") if name in image.bands]
        image = Image(image.values[kept], ("grey", "nir")[: len(kept)], image.grid, image.valid)
    return _with_gaps_noted(place, image)


def _with_gaps_noted(place: Place, image: Image) -> Image:
    if image.valid is not None:
        place.log.note(f"{1 - image.valid.mean():.1%} of the orthoimage has no data")
    return image
