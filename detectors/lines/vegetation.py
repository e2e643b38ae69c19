"""Vegetation indices of an orthoimage, scaled to 0..255.

With a near-infrared band the index is NDVI, 255 max(0, (NIR - R) / (NIR + R)). Without one there are two stand-ins: the
paper's *pseudo-NDVI*, which takes red, green, blue for infrared, red, green and so is (R - G) / (R + G): high on red
roofs, low on green leaves; and *green-red*, (G - R) / (G + R), which is high on green leaves.
Source: Awrangjeb, Ravanbakhsh & Fraser (2010), sections 3.3.1 and 4.3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...scenes.raster import Image

__all__ = ["vegetation_prefix"]

#: Bands (plus, minus) of (plus - minus) / (plus + minus) on images without near infrared.
_WITHOUT_NIR = {"green-red": ("green", "red"), "pseudo-ndvi": ("red", "green")}


@njit(cache=True)
def _index_prefix(plus: NDArray[Any], minus: NDArray[Any]) -> NDArray[np.int32]:
    rows, columns = plus.shape
    prefix = np.empty((rows, columns + 1), dtype=np.int32)
    for row in range(rows):
        total = np.int64(0)
        prefix[row, 0] = 0
        for column in range(columns):
            high, low = np.int64(plus[row, column]), np.int64(minus[row, column])
            if high > low:
                total += (510 * (high - low) + high + low) // (2 * (high + low))
            prefix[row, column + 1] = total
    return prefix


def vegetation_prefix(image: Image, without_nir: str) -> NDArray[np.int32]:
    """Return the row prefix sums (see `boxes`) of the index, rounded to whole numbers 0..255.

    Parameters
    ----------
    without_nir : {"green-red", "pseudo-ndvi"}
        Index of an image that has no near-infrared band.
    """
    plus, minus = ("nir", "red") if "nir" in image.bands else _WITHOUT_NIR[without_nir]
    values = image.values
    prefix: NDArray[np.int32] = _index_prefix(values[image.bands.index(plus)], values[image.bands.index(minus)])
    return prefix
