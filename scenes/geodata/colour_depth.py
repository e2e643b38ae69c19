"""Depth of colours: files have 8 or 16 bit, cameras and programs 8, 10, 11, 12, 14 or 16.

Values of fewer bits are often stored as they are, and would be dark. The depth is that which the file names, else the
smallest that holds all values of a set of files.

Points: LAS has 16 bit, and many programs write 8 bit as they are, in whole files or in part. A point of at most 255 is
nearly black in 16 bit. Images of 16 bit have few of them, and as many that are a little brighter; among colours of 8
bit there is a gap above 255.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["UNDOUBTED", "common_depths", "depth_note", "scaled_to_16_bit", "stretch_to_16_bit"]

#: Largest value of 16 bit, and the largest that may be one of fewer.
_FULL, UNDOUBTED = 65535, (1 << 14) - 1
#: Depths of cameras, bits.
_DEPTHS = (8, 10, 11, 12, 14)
#: Largest value of files that are of fewer bits beside files of 16: a scene as dark as this is none.
_LARGEST_BESIDE_16 = (1 << 12) - 1

_LARGEST_BYTE = 255
#: Upper end of the range, from 256 on, that is nearly empty when colours of 8 and of 16 bit are mixed.
_GAP_END = 1023
#: Points of 8 bit for each point in the gap, and their share of the coloured points, at least.
_PER_POINT_IN_GAP, _LEAST_SHARE = 4, 0.01


def stretch_to_16_bit(colours: NDArray[np.uint16]) -> None:
    """Multiply, in place, colours of 8 bit by 257, where a file or a part of its points has such.

    Parameters
    ----------
    colours : ndarray of uint16, shape (n, bands)
        Of one file.

    Examples
    --------
    >>> mixed = np.array([[200, 100, 50], [51400, 25700, 12850]], dtype=np.uint16)
    >>> stretch_to_16_bit(mixed)
    >>> mixed.tolist()
    [[51400, 25700, 12850], [51400, 25700, 12850]]
    """
    if not colours.size:
        return
    brightest = colours.max(axis=1)
    few = (brightest > 0) & (brightest <= _LARGEST_BYTE)
    count, coloured = np.count_nonzero(few), np.count_nonzero(brightest)
    in_gap = np.count_nonzero((brightest > _LARGEST_BYTE) & (brightest <= _GAP_END))
    if count and count >= _LEAST_SHARE * coloured and count > _PER_POINT_IN_GAP * in_gap:
        colours[few] *= 257


def common_depths(largest: Sequence[int]) -> list[int]:
    """Return the depth in bits of each file of a set, from the largest value of each.

    A dark tile has the depth of its neighbours: files of fewer than 16 bit share the depth of the brightest of them.

    Examples
    --------
    >>> common_depths([3900, 700]), common_depths([3900, 65535, 700]), common_depths([9000, 65535]), common_depths([0])
    ([12, 12], [12, 16, 12], [16, 16], [16])
    """
    limit = UNDOUBTED if max(largest, default=0) <= UNDOUBTED else _LARGEST_BESIDE_16
    top = max((value for value in largest if value <= limit), default=0)
    shared = next((depth for depth in _DEPTHS if top < 1 << depth), 16) if top else 16
    return [shared if value <= limit else 16 for value in largest]


def scaled_to_16_bit(values: NDArray[np.uint16], depth: int) -> NDArray[np.uint16]:
    """Return values of so many bits as values of 16; larger ones become the largest.

    >>> scaled_to_16_bit(np.array([0, 2048, 4095], dtype=np.uint16), 12).tolist()
    [0, 32776, 65535]
    """
    if depth == 16:
        return values
    top = (1 << depth) - 1
    return ((np.minimum(values, top).astype(np.uint32) * _FULL + top // 2) // top).astype(np.uint16)


def depth_note(depth: int) -> str:
    """Return in words that values were scaled from a depth to 16 bit."""
    return (
        f"the values reach at most {(1 << depth) - 1} of {_FULL}, so they were taken for values of {depth} bit and "
        "scaled to 16 bit"
    )
