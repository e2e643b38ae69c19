"""Morphology: opening, closing and filling of masks on a grid. All lengths are in cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["closed", "closed_heights", "opened", "without_holes"]

_Mask = NDArray[np.bool_]

#: Rows processed at a time.
_BAND = 256


def without_holes(mask: _Mask, largest: float) -> _Mask:
    """Return the mask with its holes of up to `largest` cells filled."""
    import cv2

    _, labels = cv2.connectedComponents((~mask).view(np.uint8), connectivity=4)
    # Counting takes a fifth of the time that the library takes for its statistics.
    small = np.bincount(labels.ravel()) <= largest
    small[0] = False
    return np.asarray(mask | small.take(labels))


def closed(mask: _Mask, radius: float) -> _Mask:
    """Return the morphological closing with a disc of a radius."""
    import cv2

    reach = int(radius) + 2
    solid = np.pad(mask.astype(np.uint8), reach)
    filled = cv2.morphologyEx(solid, cv2.MORPH_CLOSE, _disc(radius))
    return np.asarray(filled[reach:-reach, reach:-reach] > 0)


def closed_heights(heights: NDArray[np.uint16], radius: float) -> NDArray[np.uint16]:
    """Return the grey closing of heights, 0 where there are none, with a disc of a radius.

    It is positive where `closed` holds, and there at most the greatest height within any disc that contains the cell.
    """
    import cv2

    reach = int(radius) + 2
    filled = cv2.morphologyEx(np.pad(heights, reach), cv2.MORPH_CLOSE, _disc(radius))
    return np.asarray(filled[reach:-reach, reach:-reach])


def opened(mask: _Mask, radius: float) -> _Mask:
    """Return the morphological opening with a disc of a radius; square corners are restored."""
    import cv2

    solid = mask.astype(np.uint8)
    return _with_corners(cv2.morphologyEx(solid, cv2.MORPH_OPEN, _disc(radius)), solid, 0.5 * radius)


def _disc(radius: float) -> NDArray[np.uint8]:
    """Return a disc of a radius in cells; a single cell below three quarters."""
    reach = int(radius + 0.25)
    row, column = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc: NDArray[np.uint8] = (row**2 + column**2 <= max(radius, reach) ** 2 + 0.5).astype(np.uint8)
    return disc


def _with_corners(opened: NDArray[np.uint8], mask: NDArray[np.uint8], radius: float) -> _Mask:
    """Return the opened mask with the cells of the mask within a radius of it; no two regions are joined.

    Opening with a disc of radius r removes a square corner up to 0.41 r from its vertex. Rows are processed in bands
    with an overlap, so that only one array of labels is kept.
    """
    import cv2

    count, labels = cv2.connectedComponents(opened, connectivity=4)
    window = _disc(radius)
    reach = len(window) // 2 + 1
    result = np.empty(mask.shape, dtype=np.bool_)
    for first in range(0, len(mask), _BAND):
        top = max(first - reach, 0)
        rows = slice(top, first + _BAND + reach)
        label = labels[rows].astype(np.float32)
        found = _restored(opened[rows], mask[rows], label, count, window)
        result[first : first + _BAND] = found[first - top : first - top + _BAND]
    return result


def _restored(
    opened: NDArray[np.uint8],
    mask: NDArray[np.uint8],
    label: NDArray[np.float32],
    count: int,
    window: NDArray[np.uint8],
) -> _Mask:
    import cv2

    highest = cv2.dilate(label, window)
    lowest = cv2.erode(np.where(label > 0, label, np.float32(count)), window)
    restored = (opened > 0) | ((mask > 0) & (highest == lowest))
    # Restored cells of two regions may still touch.
    owner = np.where(restored, np.maximum(highest, label), np.float32(0))
    ring = np.ones((3, 3), np.uint8)
    apart = cv2.dilate(owner, ring) == cv2.erode(np.where(owner > 0, owner, np.float32(count)), ring)
    return np.asarray((opened > 0) | (restored & apart))
