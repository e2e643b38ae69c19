"""Direction of the brightness around candidate rectangles, and the score that separates buildings from trees.

Nouns
-----
alignment
    Mean of cos 4 (t - t0) over the cells in a rectangle, weighted by the gradient of the brightness; t is the direction
    of the gradient and t0 that of the rectangle. 1 where every edge is parallel or perpendicular to its sides, 0 where
    edges have all directions, as those of a crown.
concentration
    The same for the direction t0 that makes it largest, 0 to 1: also a roof whose rectangle is turned has it.
independent directions
    Number of directions in a rectangle that differ by more than blur: its area divided by 4.4 squared scales, the area
    over which the gradient is correlated in crowns of every kind of image. The concentration of n directions without a
    preferred one is 1/sqrt(n) on average, so that both measures are multiplied by sqrt(n): a coarse image, or a small
    rectangle, has few edges, which agree by chance.
score
    Weighted sum of alignment and concentration, both in units of chance, scaled entropy (see `entropy_scale`), relative
    vegetation index and smoothness of the laser points (see `box_smoothness`); above zero the candidate
    is a building. The weights are those of a logistic regression on candidates of synthetic scenes
    (`tests/performance/study_texture.py fit`), rounded.

The six tests of the 2011 paper (`texture`) follow linked edges of three metres. Where an image was made of the colours
of points, resampled or blurred, edges are ragged or missing and few chains of that length remain. The gradient at a
scale in metres, or that of the image's own pixels where they are wider, is there in every image, and it needs no
threshold of contrast. Where one or two points per square metre have a colour, no measure of the image separates a tree
from a roof any more (area under the curve 0.6 to 0.7 in woods); the smoothness of the points does.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .boxes import UX, UY, Boxes, rescaled, sum_in_box

__all__ = [
    "WEIGHTS",
    "Gradients",
    "Oriented",
    "clipped_measures",
    "directions",
    "gradient_sums",
    "score_candidates",
]

#: Standard deviation of the Gaussian before the gradient is taken, metres; at least a pixel of the image.
_SCALE = 0.35
#: Largest pixel of the gradients, metres.
_PIXEL = 0.25
#: Area in which the gradients of a crown are correlated, squared scales (median of synthetic scenes: 2.7 to 5).
_CORRELATED = 4.4
#: Weights of alignment, concentration, scaled entropy, vegetation index and smoothness, and the constant.
WEIGHTS: Final = (0.4, 0.6, -1.0, -1.3, 8.9, -3.7)
#: Ranges that the first four are clipped to: beyond them they say no more.
_RANGES: Final = ((-1.0, 3.0), (0.0, 4.0), (-0.5, 1.5), (0.0, 2.0))
#: Smoothness where it is unknown.
_UNKNOWN = 0.5


class Gradients(NamedTuple):
    """Row prefix sums (see `boxes`) of the gradient of the brightness.

    Attributes
    ----------
    strength : ndarray of int32, shape (rows, columns + 1)
        Its length m.
    cosine, sine : ndarray of int32, shape (rows, columns + 1)
        m cos 4t and m sin 4t, where t is its direction.
    pixel : int
        Pixels of the image along a side of one cell.
    scale : float
        Standard deviation of the Gaussian that smoothed the image, metres.
    """

    strength: NDArray[np.int32]
    cosine: NDArray[np.int32]
    sine: NDArray[np.int32]
    pixel: int
    scale: float

    def independent(self, areas: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the number of independent directions in areas, square metres."""
        return areas / (_CORRELATED * self.scale**2)


@dataclass(frozen=True, eq=False)
class Oriented:
    """What decides whether candidate rectangles have the texture of a building.

    Attributes
    ----------
    alignment, concentration, entropy, vegetation, smoothness, independent, score : ndarray, shape (k,)
        See `orientation`, `entropy_scale`, `box_smoothness`; the vegetation index is a multiple of its threshold.
    """

    alignment: NDArray[np.float64]
    concentration: NDArray[np.float64]
    entropy: NDArray[np.float64]
    vegetation: NDArray[np.float64]
    smoothness: NDArray[np.float64]
    independent: NDArray[np.float64]
    score: NDArray[np.float64]

    @property
    def buildings(self) -> NDArray[np.bool_]:
        """Which candidates have a score above zero."""
        return np.asarray(self.score > 0)


@kernel
def _prefixes(
    dx: NDArray[np.float32], dy: NDArray[np.float32]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    rows, columns = dx.shape
    strength = np.zeros((rows, columns + 1), dtype=np.int32)
    cosine, sine = np.zeros_like(strength), np.zeros_like(strength)
    for row in range(rows):
        for column in range(columns):
            x, y = float(dx[row, column]), float(dy[row, column])
            squared = x * x + y * y
            length = np.sqrt(squared)
            twice, cross = x * x - y * y, 2 * x * y
            whole = 1.0 / max(squared * length, 1e-9)  # m cos 4t = Re (x + iy)^4 / m^3
            strength[row, column + 1] = strength[row, column] + round(length)
            cosine[row, column + 1] = cosine[row, column] + round((twice * twice - cross * cross) * whole)
            sine[row, column + 1] = sine[row, column] + round(2 * twice * cross * whole)
    return strength, cosine, sine


def gradient_sums(grey: NDArray[np.uint8], gsd: float, *, own_pixel: float = 0.0) -> Gradients:
    """Return the gradients of a grey image.

    Parameters
    ----------
    grey : ndarray, shape (rows, columns)
    gsd : float
        Width of its pixels, metres.
    own_pixel : float
        Width of the pixels that it was interpolated from, metres.
    """
    pixel = max(1, int(_PIXEL / gsd + 1e-9))
    rows, columns = grey.shape[0] // pixel * pixel, grey.shape[1] // pixel * pixel
    if rows == 0 or columns == 0:
        pixel, (rows, columns) = 1, grey.shape
    coarse = grey[:rows, :columns]
    if pixel > 1:
        coarse = cv2.resize(coarse, (columns // pixel, rows // pixel), interpolation=cv2.INTER_AREA)
    scale = max(_SCALE, own_pixel)
    smooth = cv2.GaussianBlur(coarse.astype(np.float32), (0, 0), scale / (gsd * pixel))
    dx, dy = cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)
    strength, cosine, sine = _prefixes(dx, dy)
    return Gradients(strength, cosine, sine, pixel, scale)


@kernel
def _directions(
    strength: NDArray[np.int32], cosine: NDArray[np.int32], sine: NDArray[np.int32], boxes: NDArray[np.float64]
) -> NDArray[np.float64]:
    out = np.zeros((len(boxes), 2))
    for i in range(len(boxes)):
        box = boxes[i]
        total = sum_in_box(strength, box)[0]
        if total > 0:
            x, y = sum_in_box(cosine, box)[0] / total, sum_in_box(sine, box)[0] / total
            twice, cross = box[UX] * box[UX] - box[UY] * box[UY], 2 * box[UX] * box[UY]
            out[i, 0] = x * (twice * twice - cross * cross) + y * 2 * twice * cross
            out[i, 1] = math.hypot(x, y)
    return out


def directions(gradients: Gradients, boxes: Boxes) -> NDArray[np.float64]:
    """Return alignment (-1 to 1) and concentration (0 to 1) in each box, shape (k, 2); both 0 in a uniform area."""
    cells = rescaled(boxes, gradients.pixel)
    found: NDArray[np.float64] = _directions(gradients.strength, gradients.cosine, gradients.sine, cells)
    return found


def score_candidates(
    directed: NDArray[np.float64],
    entropy: NDArray[np.float64],
    vegetation: NDArray[np.float64],
    smoothness: NDArray[np.float64],
    independent: NDArray[np.float64],
) -> Oriented:
    """Return the scores of candidates.

    Parameters
    ----------
    directed : ndarray, shape (k, 2)
        Alignment and concentration.
    entropy, vegetation : ndarray, shape (k,)
        Scaled entropy, and mean vegetation index as a multiple of its threshold.
    smoothness : ndarray, shape (k,)
        0 to 1, NaN where unknown.
    independent : ndarray, shape (k,)
        Number of independent directions.
    """
    score = np.full(len(directed), WEIGHTS[-1])
    for values, weight in zip(
        clipped_measures(directed, entropy, vegetation, smoothness, independent), WEIGHTS, strict=False
    ):
        score += weight * values
    return Oriented(directed[:, 0], directed[:, 1], entropy, vegetation, smoothness, independent, score)


def clipped_measures(
    directed: NDArray[np.float64],
    entropy: NDArray[np.float64],
    vegetation: NDArray[np.float64],
    smoothness: NDArray[np.float64],
    independent: NDArray[np.float64],
) -> list[NDArray[np.float64]]:
    """Return the five measures of `score_candidates` as they are weighted, the first two in units of chance."""
    chance = np.sqrt(independent)
    measures = (chance * directed[:, 0], chance * directed[:, 1], entropy, vegetation)
    clipped = [np.clip(values, low, high) for values, (low, high) in zip(measures, _RANGES, strict=True)]
    return [*clipped, np.nan_to_num(smoothness, nan=_UNKNOWN)]
