"""Depth of colours of points: LAS has 16 bit, and many programs write 8 bit as they are, in whole files or in part.

A point of at most 255 is nearly black in 16 bit. Images of 16 bit have few of them, and as many that are a little
brighter; among colours of 8 bit there is a gap above 255.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["stretch_to_16_bit"]

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
