"""Whether an image of three bands is grey: scans and old orthoimages are often stored as red, green and blue."""

from __future__ import annotations

import numpy as np

from .raster import Image

__all__ = ["is_grey"]

#: Largest difference of the bands, as a share of white, and share of the pixels in which they may differ more: JPEG.
_EQUAL, _OTHERS = 2 / 255, 0.001


def is_grey(image: Image) -> bool:
    """Return whether red, green and blue are equal where an image has data; a black image is not grey.

    Examples
    --------
    >>> from roofbench.scenes.geodata.raster import Grid
    >>> grid = Grid(0.0, 2.0, 1.0, 2, 2)
    >>> one = np.uint8([[90, 12], [33, 200]])
    >>> is_grey(Image(np.stack([one, one, one]), ("red", "green", "blue"), grid))
    True
    >>> is_grey(Image(np.stack([one, one, 255 - one]), ("red", "green", "blue"), grid))
    False
    """
    red, green, blue = (image.values[image.bands.index(name)] for name in ("red", "green", "blue"))
    limit = int(_EQUAL * np.iinfo(red.dtype).max)
    top, low = np.maximum(np.maximum(red, green), blue), np.minimum(np.minimum(red, green), blue)
    differ = top - low > limit
    if image.valid is not None:
        differ &= image.valid
    return bool(top.any() and np.count_nonzero(differ) <= _OTHERS * differ.size)
