"""Dominant colours of a rectangle: the ranges of Y, I and Q that its roof has.

Nouns
-----
YIQ
    Intensity Y in [0, 1], hue I in [-0.5957, 0.5957] and saturation Q in [-0.5226, 0.5226] of a colour (NTSC), as the
    paper names them; their histograms have 10, 20 and 20 bins, or bins of 0.1 each.
part
    Run of histogram bins around one peak, from minimum to minimum; a minimum belongs to the part to its left.
range
    The bins that contain at least 97 % of a part, from its peak outwards, the larger neighbour first.
dominant
    The ranges of the largest parts, until these parts contain 90 % of the rectangle. Their union is a lookup table.

Source: Awrangjeb, Ravanbakhsh & Fraser (2010), section 3.4.1.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .boxes import column_range, row_range

__all__ = ["BINS", "TENTHS", "Colours", "dominant_bins", "dominant_ranges", "yiq_bins"]

#: Bins of Y, I and Q, as printed and where all are 0.1 wide.
BINS, TENTHS = (10, 20, 20), (10, 12, 12)
_I_RANGE = 0.5957
_Q_RANGE = 0.5226


class Colours(NamedTuple):
    """Red, green and blue of the orthoimage.

    Attributes
    ----------
    values : ndarray of uint8 or uint16, shape (3, rows, columns)
    levels : ndarray of float64, shape (levels,)
        Brightness of each value, 0..1.
    tenths : bool
        Whether the bins of all three histograms are 0.1 wide.
    """

    values: NDArray[np.uint8] | NDArray[np.uint16]
    levels: NDArray[np.float64]
    tenths: bool = False

    @classmethod
    def of(cls, values: NDArray[np.uint8] | NDArray[np.uint16], *, tenths: bool = False) -> Colours:
        """Return the colours of an image whose largest value is that of its type."""
        full = int(np.iinfo(values.dtype).max)
        return cls(values, np.arange(full + 1) / full, tenths)


@kernel
def yiq_bins(colours: Colours, row: int, column: int) -> tuple[int, int, int]:
    """Return the histogram bins of Y, I and Q of one cell."""
    at, across = np.uintp(row), np.uintp(column)  # unsigned: no index from the end
    r = colours.levels[colours.values[0, at, across]]
    g = colours.levels[colours.values[1, at, across]]
    b = colours.levels[colours.values[2, at, across]]
    y = 0.299 * r + 0.587 * g + 0.114 * b
    i = 0.595716 * r - 0.274453 * g - 0.321263 * b
    q = 0.211456 * r - 0.522591 * g + 0.311135 * b
    if colours.tenths:
        return min(max(int(y * 10), 0), 9), math.floor(i * 10) + 6, math.floor(q * 10) + 6
    return (
        min(max(int(y * 10), 0), 9),
        min(max(int((i + _I_RANGE) / (2 * _I_RANGE) * 20), 0), 19),
        min(max(int((q + _Q_RANGE) / (2 * _Q_RANGE) * 20), 0), 19),
    )


@kernel
def split_parts(histogram: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the first bin of each part and, at the end, the number of bins; parts are cut after minima."""
    bins = len(histogram)
    cuts = [0]
    lowest = 0
    falling = False
    for k in range(1, bins):
        if histogram[k] < histogram[k - 1]:
            falling, lowest = True, k
        elif histogram[k] > histogram[k - 1]:
            if falling:
                cuts.append(lowest + 1)
            falling = False
    cuts.append(bins)
    return np.array(cuts, dtype=np.int64)


@kernel
def dominant_bins(histogram: NDArray[np.int64], part_share: float, total_share: float) -> NDArray[np.bool_]:
    """Return which bins of a histogram belong to its dominant ranges."""
    cuts = split_parts(histogram)
    parts = len(cuts) - 1
    totals = np.zeros(parts, dtype=np.int64)
    everything = 0
    for p in range(parts):
        for k in range(cuts[p], cuts[p + 1]):
            totals[p] += histogram[k]
        everything += totals[p]
    within = np.zeros(len(histogram), dtype=np.bool_)
    wanted, used = total_share * everything, 0
    while used == 0 or used < wanted:
        largest = 0
        for p in range(1, parts):
            if totals[p] > totals[largest]:
                largest = p
        total = totals[largest]
        if total == 0:
            break
        totals[largest] = 0
        first, end = cuts[largest], cuts[largest + 1]
        low = first
        for k in range(first + 1, end):
            if histogram[k] > histogram[low]:
                low = k
        high = low
        held = histogram[low]
        while held < part_share * total:
            left = histogram[low - 1] if low > first else -1
            right = histogram[high + 1] if high + 1 < end else -1
            if left > right:
                low -= 1
                held += left
            else:
                high += 1
                held += right
        for k in range(low, high + 1):
            within[k] = True
        used += total
    return within


@kernel
def dominant_ranges(
    colours: Colours, box: NDArray[np.float64], part_share: float, total_share: float
) -> NDArray[np.bool_]:
    """Return the lookup table of the colours that dominate a box, shape (3, 20): Y, I, Q by bin."""
    rows, columns = colours.values.shape[1], colours.values.shape[2]
    histograms = np.zeros((3, 20), dtype=np.int64)
    first_row, last_row = row_range(box)
    for row in range(max(first_row, 0), min(last_row, rows)):
        first, last = column_range(box, row)
        for column in range(max(first, 0), min(last, columns)):
            y, i, q = yiq_bins(colours, row, column)
            histograms[0, y] += 1
            histograms[1, i] += 1
            histograms[2, q] += 1
    within = np.zeros((3, 20), dtype=np.bool_)
    for band in range(3):
        bins = (TENTHS if colours.tenths else BINS)[band]
        of_band = dominant_bins(histograms[band, :bins], part_share, total_share)
        for k in range(bins):
            within[band, k] = of_band[k]
    return within
