"""Vegetation indices of an orthoimage, scaled to 0..255.

With a near-infrared band the index is NDVI, 255 max(0, (NIR - R) / (NIR + R)). Without one there are two substitutes:
the paper's *pseudo-NDVI*, which assumes that red, green, blue are infrared, red, green, is (R - G) / (R + G): high on
red roofs and low on green leaves; *green-red*, 2 (G - R) / (G + R), is high on green leaves. Leaves differ less between
green and red than between infrared and red (in images with all four bands their NDVI is two to four times (G - R) / (G
+ R)); the factor 2 allows one threshold for both. Source: Awrangjeb, Ravanbakhsh & Fraser (2010), sections 3.3.1 and
4.3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.raster import Image

__all__ = ["vegetation_prefix"]

#: Bands and factor of factor * (plus - minus) / (plus + minus) on images without near infrared.
_WITHOUT_NIR = {"green-red": ("green", "red", 2), "pseudo-ndvi": ("red", "green", 1)}


@kernel
def _index_prefix(plus: NDArray[Any], minus: NDArray[Any], factor: int) -> NDArray[np.int32]:
    rows, columns = plus.shape
    prefix = np.empty((rows, columns + 1), dtype=np.int32)
    for row in range(rows):
        total = 0
        prefix[row, 0] = 0
        for column in range(columns):
            high, low = int(plus[row, column]), int(minus[row, column])
            if high > low:
                total += min((510 * factor * (high - low) + high + low) // (2 * (high + low)), 255)
            prefix[row, column + 1] = total
    return prefix


def vegetation_prefix(image: Image, without_nir: str) -> NDArray[np.int32]:
    """Return the row prefix sums (see `boxes`) of the index, rounded to whole numbers 0..255.

    Parameters
    ----------
    without_nir : {"green-red", "pseudo-ndvi"}
        Index of an image that has no near-infrared band.
    """
    plus, minus, factor = ("nir", "red", 1) if "nir" in image.bands else _WITHOUT_NIR[without_nir]
    high, low = (image.values[image.bands.index(name)] for name in (plus, minus))
    prefix: NDArray[np.int32] = _index_prefix(high, low, factor)
    return prefix
