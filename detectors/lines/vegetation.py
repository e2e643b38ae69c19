"""Vegetation indices of an orthoimage, scaled to 0..255.

With a near-infrared band the index is NDVI, 255 max(0, (NIR - R) / (NIR + R)). Without one there are two substitutes:
the paper's *pseudo-NDVI*, which assumes that red, green, blue are infrared, red, green, is (R - G) / (R + G): high on
red roofs and low on green leaves; *green-red*, 2 (G - R) / (G + R), is high on green leaves. Leaves differ less between
green and red than between infrared and red (in images with all four bands their NDVI is two to four times (G - R) / (G
+ R)); the factor 2 allows one threshold for both.
The authors' own program tests the standard deviation of the pseudo-NDVI instead (`pseudo_ndvi_sigma`).
Source: Awrangjeb, Ravanbakhsh & Fraser (2010), sections 3.3.1 and 4.3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.raster import Image

__all__ = ["noise_variance", "pseudo_ndvi_sigma", "vegetation_prefix"]

#: Side of the tiles in which the noise of an image is estimated, pixels.
_NOISE_TILE = 512
#: Median of the chi-squared distribution with one degree of freedom.
_MEDIAN_CHI_SQUARED = 0.4549
#: Bands and factor of factor * (plus - minus) / (plus + minus) on images without near infrared.
_WITHOUT_NIR = {"green-red": ("green", "red", 2), "pseudo-ndvi": ("red", "green", 1)}


@kernel
def _index_prefix(plus: NDArray[Any], minus: NDArray[Any], factor: int) -> NDArray[np.int32]:
    rows, columns = plus.shape
    prefix = np.empty((rows, columns + 1), dtype=np.int32)
    for row in range(rows):
        index = prefix[row, 1:]
        for column in range(columns):
            high, low = np.float64(plus[row, column]), np.float64(minus[row, column])
            # Whole numbers this small are divided exactly enough, and without a test for zero, to be rounded down.
            rounded = np.divide(510.0 * factor * (high - low) + high + low, max(2.0 * (high + low), 1.0))
            index[column] = np.int32(min(rounded, 255.0)) if high > low else np.int32(0)
        total = 0
        prefix[row, 0] = 0
        for column in range(columns):
            total += index[column]
            index[column] = total
    return prefix


def vegetation_prefix(image: Image, without_nir: str) -> NDArray[np.int32]:
    """Return the row prefix sums (see `boxes`) of the index, rounded to whole numbers 0..255.

    Parameters
    ----------
    without_nir : {"green-red", "pseudo-ndvi", "sigma"}
        Index of an image that has no near-infrared band.
    """
    if "nir" not in image.bands and without_nir == "sigma":
        index = pseudo_ndvi_sigma(image.band("red"), image.band("green"))
        return np.pad(np.cumsum(np.rint(index), axis=1, dtype=np.int32), ((0, 0), (1, 0)))
    plus, minus, factor = ("nir", "red", 1) if "nir" in image.bands else _WITHOUT_NIR[without_nir]
    high, low = (image.values[image.bands.index(name)] for name in (plus, minus))
    prefix: NDArray[np.int32] = _index_prefix(high, low, factor)
    return prefix


def noise_variance(band: NDArray[np.floating]) -> float:
    """Return the largest noise variance over tiles of 512 pixels.

    The median of the squared differences of diagonal neighbours is that of twice the variance times chi-squared; edges,
    which are few, do not move it.
    """
    squares = (band[1:, 1:] - band[:-1, :-1]).astype(np.float64) ** 2
    tiles = [
        squares[row : row + _NOISE_TILE, column : column + _NOISE_TILE]
        for row in range(0, max(len(squares), 1), _NOISE_TILE)
        for column in range(0, max(squares.shape[1], 1), _NOISE_TILE)
    ]
    return max((float(np.median(tile)) for tile in tiles if tile.size), default=0.0) / (2 * _MEDIAN_CHI_SQUARED)


def pseudo_ndvi_sigma(first: NDArray[np.floating], second: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the standard deviation of the pseudo-NDVI of two bands, P and N, per cent, at most 100.

    200 / (P + N)^2 sqrt(P^2 varP + N^2 varN), with both bands stretched to 0..255 and varP and varN their noise
    variances: large where the image is dark. Strict error propagation exchanges P and N under the root.
    """
    p, n = _stretched(first), _stretched(second)
    spread = 200 * np.sqrt(p**2 * noise_variance(p) + n**2 * noise_variance(n))
    total = p + n
    return np.where(total > 0, np.minimum(spread / np.maximum(total, 1e-6) ** 2, 100.0), 100.0)


def _stretched(band: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return a band stretched from its least and greatest value to 0..255."""
    low, high = float(band.min()), float(band.max())
    return np.asarray(255.0 * (band - low) / max(high - low, 1e-12), dtype=np.float64)
