"""Local entropy: how varied the grey values of a small window are.

H = -sum p log2 p over the histogram of the 9 x 9 cells around a cell in 256 grey levels, divided by its largest
possible value log2(81) and scaled to 0..255. Windows are cut at the border of the image. Source: Awrangjeb, Zhang &
Fraser (2011), section 3.2, which prints neither window nor levels.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.raster import Image

__all__ = ["WINDOW", "coarse_entropy", "grey_levels", "local_entropy"]

#: Side of the window, pixels.
WINDOW = 9


@kernel
def _grey(red: NDArray[Any], green: NDArray[Any], blue: NDArray[Any], unit: int) -> NDArray[np.uint8]:
    rows, columns = red.shape
    grey = np.empty((rows, columns), dtype=np.uint8)
    for row in range(rows):
        for column in range(columns):
            r, g, b = np.int64(red[row, column]), np.int64(green[row, column]), np.int64(blue[row, column])
            grey[row, column] = (299 * r + 587 * g + 114 * b + 500 * unit) // (1000 * unit)
    return grey


def grey_levels(image: Image) -> NDArray[np.uint8]:
    """Return the intensity of a colour image as 256 grey levels, shape (rows, columns)."""
    red, green, blue = (image.values[image.bands.index(name)] for name in ("red", "green", "blue"))
    grey: NDArray[np.uint8] = _grey(red, green, blue, int(np.iinfo(image.values.dtype).max) // 255)
    return grey


@kernel
def local_entropy(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the normalised local entropy, 0..255, shape (rows, columns).

    The histogram slides along each row and sum(c log2 c) over its counts is updated, so each cell costs one column of
    the window that enters and one that leaves.
    """
    rows, columns = grey.shape
    reach = WINDOW // 2
    cells = WINDOW * WINDOW
    weighted = np.zeros(cells + 1, dtype=np.float32)
    for count in range(2, cells + 1):
        weighted[count] = count * np.log2(count)
    gain = weighted[1:] - weighted[:-1]
    scale = 255.0 / np.log2(cells)
    out = np.empty((rows, columns), dtype=np.uint8)
    histogram = np.zeros(256, dtype=np.int32)
    for row in range(rows):
        top, bottom = max(row - reach, 0), min(row + reach + 1, rows)
        histogram[:] = 0
        total = np.float32(0.0)
        for column in range(-reach, columns):
            entering, leaving = column + reach, column - reach - 1
            # First out, then in: with both columns inside, a count could exceed the table.
            if leaving >= 0:
                for r in range(top, bottom):
                    level = grey[r, leaving]
                    histogram[level] -= 1
                    total -= gain[histogram[level]]
            if entering < columns:
                for r in range(top, bottom):
                    level = grey[r, entering]
                    total += gain[histogram[level]]
                    histogram[level] += 1
            if column >= 0:
                held = (bottom - top) * (min(column + reach, columns - 1) - max(column - reach, 0) + 1)
                entropy = np.log2(held) - total / held
                out[row, column] = np.uint8(max(0.0, min(255.0, scale * entropy + 0.5)))
    return out


def coarse_entropy(grey: NDArray[np.uint8], gsd: float, *, largest: float) -> NDArray[np.uint8]:
    """Return the local entropy in pixels of at most `largest` metres, on the cells of the image.

    Averages of several pixels contain less noise, and an image whose pixels repeat coarser ones has the same entropy
    as the coarse image.
    """
    parts = int(largest / gsd + 1e-9)
    rows, columns = grey.shape
    if parts <= 1 or rows < parts or columns < parts:
        return np.asarray(local_entropy(grey))
    size = columns // parts, rows // parts
    averaged = cv2.resize(grey[: size[1] * parts, : size[0] * parts], size, interpolation=cv2.INTER_AREA)
    entropy = local_entropy(np.asarray(averaged, dtype=np.uint8))
    spread = np.empty((rows, columns), dtype=np.uint8)
    inner = cv2.resize(entropy, (size[0] * parts, size[1] * parts), interpolation=cv2.INTER_NEAREST)
    spread[: inner.shape[0], : inner.shape[1]] = inner
    spread[inner.shape[0] :, : inner.shape[1]] = inner[-1]
    spread[:, inner.shape[1] :] = spread[:, inner.shape[1] - 1 : inner.shape[1]]
    return spread
