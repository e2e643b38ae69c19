"""The local entropy of an area on the scale of its own image.

Nouns
-----
ground level
    Median entropy of the ground that is not green: streets, soil, dry grass.
foliage level
    Median entropy of what is green and stands above the ground: mostly trees.
scaled entropy
    (H - ground) / (foliage - ground) of a mean entropy H: 0 as smooth as the ground, 1 as varied as foliage.

Entropy depends on the size of the pixels, blur, compression, sharpening and noise of an image, so that no absolute
threshold serves two of them. Both levels change with it.
Source: reading of Awrangjeb, Zhang & Fraser (2011), section 3.2. The authors' own program relates the entropy to its
least and greatest value in the image, which single pixels decide.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["EntropyScale", "entropy_scale"]

#: Rows and columns that are looked at: one in so many.
_STRIDE = 4
#: Least area of a sample, square metres.
_LEAST_AREA = 50.0
#: Distance of the two levels, 0..255, in undisturbed images. It stands for a measured one below the least: there what
#: is green and stands is no more varied than the ground, so that it is not foliage but roofs.
_USUAL_STEP, _LEAST_STEP = 30.0, 12.0
#: Ground level where no ground is seen, 0..255.
_USUAL_GROUND = 175.0


class EntropyScale(NamedTuple):
    """Ground level, and distance of the foliage level from it, both 0..255."""

    ground: float
    step: float

    def absolute(self, scaled: float) -> float:
        """Return the mean entropy, 0..255, of an area by its scaled entropy."""
        return self.ground + scaled * self.step

    def scaled(self, entropy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the scaled entropy of areas by their mean entropy, 0..255."""
        return (entropy - self.ground) / self.step


def _median(values: NDArray[np.uint8]) -> float:
    counts = np.cumsum(np.bincount(values, minlength=256))
    return float(np.searchsorted(counts, counts[-1] / 2))


def entropy_scale(
    entropy: NDArray[np.uint8],
    vegetation: NDArray[np.int32],
    black: NDArray[np.uint8],
    *,
    threshold: float,
    gsd: float,
) -> EntropyScale:
    """Return the scale of an image.

    Parameters
    ----------
    entropy : ndarray, shape (rows, columns)
        0..255.
    vegetation : ndarray of int32, shape (rows, columns + 1)
        Row prefix sums of the vegetation index.
    black : ndarray, shape (rows, columns)
        Primary mask.
    threshold : float
        Vegetation index above which a cell is green.
    gsd : float
        Metres.
    """
    levels = entropy[::_STRIDE, ::_STRIDE]
    lines = vegetation[::_STRIDE]
    columns = np.arange(0, entropy.shape[1], _STRIDE)
    green = lines[:, columns + 1] - lines[:, columns] > threshold
    standing = black[::_STRIDE, ::_STRIDE] > 0
    least = _LEAST_AREA / (_STRIDE * gsd) ** 2
    ground, foliage = levels[~standing & ~green], levels[standing & green]
    low = _median(ground) if len(ground) >= least else _USUAL_GROUND
    step = _median(foliage) - low if len(foliage) >= least else _USUAL_STEP
    return EntropyScale(low, step if step >= _LEAST_STEP else _USUAL_STEP)
