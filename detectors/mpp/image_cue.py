"""The image as a cue on clouds without numbers of returns: vegetation is green, most roofs are not.

Numbers of returns separate roofs from crowns better than colours do, and images lean and are displaced. So the image is
read only where the cloud does not give them (rasters, single-return scanners, image matching; `return_numbers`).

Nouns
-----
rating
    -1 (not green) to +1 (green) of each cell; NaN without colours and in the dark. See `shared.pixel_cues`.
tally
    Number of high cells with evidence for a roof and the sum of their ratings, and the same of those with evidence
    against one; whole numbers, so that the parts of a city add up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.raster import Grid, Image
from ..shared.cue_information import silence_of
from ..shared.cues import rated
from ..shared.pixel_cues import DARKEST, LEAST_GREEN_RED, LEAST_NDVI, greenness
from .arrays import Integers, Scores, States
from .cells import HIGH
from .tables import MILLI

__all__ = ["add_image", "image_silence", "rate_image", "tally_image"]

_Ratings = NDArray[np.float32]

#: Greenness from the threshold to a rating of 1, and nats of a rating of 1.
_WIDTH, _WEIGHT = 0.05, 0.5
#: Ratings are added up in thousandths.
_PARTS = 1000


def rate_image(image: Image | None, grid: Grid) -> _Ratings | None:
    """Return the rating of each cell of a grid, shape (rows, columns); None without an image in colours."""
    index = None if image is None else greenness(image, grid, darkest=DARKEST)
    if image is None or index is None:
        return None
    return rated(index, LEAST_NDVI if "nir" in image.bands else LEAST_GREEN_RED, _WIDTH)


def tally_image(ratings: _Ratings, state: States, score: Scores) -> Integers:
    """Return the tally of ratings, shape (4,): number and sum (thousandths) in trees, then in roofs."""
    known = (state == HIGH) & np.isfinite(ratings)
    parts = np.rint(np.where(known, ratings, np.float32(0)) * _PARTS).astype(np.int64)
    trees, roofs = known & (score < 0), known & (score > 0)
    return np.array([np.count_nonzero(trees), parts[trees].sum(), np.count_nonzero(roofs), parts[roofs].sum()])


def image_silence(tally: Integers) -> str | None:
    """Return why the image is not used; None where it separates what the points take for roofs and for trees."""
    trees, of_trees, roofs, of_roofs = tally.tolist()
    return silence_of(trees, of_trees / _PARTS, roofs, of_roofs / _PARTS)


def add_image(score: Scores, state: States, ratings: _Ratings, weight: float) -> Scores:
    """Return scores (thousandths of a nat) less the ratings of high cells, times `_WEIGHT` and a weight."""
    known = (state == HIGH) & np.isfinite(ratings)
    nats = np.where(known, ratings, np.float32(0)) * np.float32(_WEIGHT * weight * MILLI)
    added: Scores = np.clip(score - np.rint(nats), -32767, 32767).astype(np.int16)
    return added
