"""Near infrared in tile files beside tiles of red, green and blue: which files it is in, and its scale.

The scale is measured once, on a sample of the files, so that all windows of a city have the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..geodata.colour_depth import common_depths
from ..geodata.image_bands import IMAGE_TYPES, described_bands, infrared_bands, sampled_largest, says_infrared
from ..geodata.infrared_scale import white_of
from ..geodata.raster import Grid
from ..geodata.raster_headers import RasterHeader
from ..geodata.raster_mosaic import mosaic_bands, mosaic_image
from .infrared_layer import gain_of, kind_of_values
from .place import common_extent

__all__ = ["infrared_entry", "measured_gain"]

#: Files that are sampled, and cells of each along one side.
_SAMPLE, _CELLS = 16, 200


def infrared_entry(header: RasterHeader) -> dict[str, Any] | None:
    """Return layer and bands of a file that says that it is near infrared; None of others.

    Rasters that are no images need more than a word in their name, since most of them are elevation models.
    """
    sure = header.dtype in IMAGE_TYPES or "nir" in described_bands(header) or header.path.name.startswith("nir_")
    bands = infrared_bands(header) if sure and says_infrared(header) else None
    return None if bands is None else {"layer": "infrared", "bands": list(bands)}


def measured_gain(
    infrared: Sequence[RasterHeader], bands: Sequence[str], images: Sequence[tuple[RasterHeader, int]], crs: str
) -> tuple[float, str]:
    """Return the factor from values of infrared to shares of the white of the images, and a note on it.

    Parameters
    ----------
    infrared : sequence of RasterHeader
        Of one type.
    bands : sequence of str
        Their bands.
    images : sequence of tuple
        Header and depth in bits of each image in colour.
    crs : str
        That of all files.
    """
    names = ("nir", "red") if "red" in bands else ("nir",)
    own, colours = [], []
    for header in infrared[:: max(1, len(infrared) // _SAMPLE)]:
        beside = [(image, depth) for image, depth in images if common_extent(image.grid.extent, header.grid.extent)]
        if not beside:
            continue
        side = max(header.grid.extent[2] - header.grid.extent[0], header.grid.extent[3] - header.grid.extent[1])
        grid = Grid.covering(header.grid.extent, max(side / _CELLS, header.grid.gsd))
        values = mosaic_bands([header], names, grid, crs=crs, bands=bands)
        files, depths = zip(*beside, strict=True)
        image = mosaic_image(files, grid, crs=crs, depths=depths)
        known = np.isfinite(values).all(axis=0)
        if image.valid is not None:
            known &= image.valid
        own.append(values[:, known])
        colours.append({name: image.band(name)[known] for name in image.bands})
    first = infrared[0]
    values = np.concatenate(own, axis=1) if own else np.empty((1, 0), dtype=np.float32)
    white = white_of(values[:1], kind_of_values(first), _depth(infrared, bands))
    if not own or not values.size:
        return 1 / white, f"{white:g} taken for the white of near infrared"
    both = {name: np.concatenate([part[name] for part in colours]) for name in colours[0]}
    gain, why = gain_of(values / np.float32(white), both)
    said = f"{white:g} taken for the white of near infrared"
    return gain / white, said if gain == 1 else f"{said}, which was multiplied by {gain:.3g}, so that {why}"


def _depth(infrared: Sequence[RasterHeader], bands: Sequence[str]) -> int:
    """Return the bits of the values of files of 16 bit."""
    if infrared[0].dtype != "uint16":
        return 16
    named = [header.depth for header in infrared if header.depth is not None]
    return named[0] if named else common_depths([max(sampled_largest(header, bands) for header in infrared)])[0]
