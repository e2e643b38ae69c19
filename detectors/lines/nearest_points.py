"""Which of two kinds of points is nearest to each pixel: a chamfer distance to both, in one pass down and one up.

Distances are those of the 5 x 5 chamfer mask with the weights 1, 1.4 and 2.1969 for a step to a side, a diagonal and a
knight's move, within 2 % of the exact ones (Borgefors 1986, "Distance transformations in digital images", CVGIP 34(3)).
They are whole numbers, so that ties do not depend on rounding, in floating point, whose minimum is one instruction.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel

__all__ = ["nearest_kind"]

#: Parts of a pixel that distances are counted in; all weights are whole numbers of them, so that ties are exact.
_PARTS = 10000
#: Weights of the mask.
_SIDE, _DIAGONAL, _KNIGHT = (np.float32(round(_PARTS * weight)) for weight in (1.0, 1.4, 2.1969))
#: Pixels: a distance that is farther than any that is asked for, and columns whose distances are spread along a row at
#: a time: float32 has 24 bits for whole numbers.
_FARTHEST, _COLUMNS = 1200, 400
_FAR = np.float32(_PARTS * _FARTHEST)
#: Rows that are computed at a time: distances take eight times the memory of a mask.
_BAND = 512

_Mask = NDArray[np.uint8]
_Distances = NDArray[np.float32]


def nearest_kind(low: _Mask, high: _Mask, reach: float, bare: float) -> tuple[_Mask, _Mask]:
    """Return where the nearest point is low and where it is high, up to `reach` pixels away; a tie is low.

    Where the nearest high point is farther than `bare` pixels, the place is low at any distance.

    Parameters
    ----------
    low, high : ndarray of uint8, shape (rows, columns)
        1 where there is a point of the kind.
    reach, bare : float
        Pixels, `reach` at most `bare`.
    """
    is_low, is_high = np.empty_like(low), np.empty_like(high)
    reach, bare = min(reach, _FARTHEST - 1), min(bare, _FARTHEST - 1)
    halo = math.ceil(bare) + 1
    limits = np.float32(math.floor(_PARTS * reach)), np.float32(math.floor(_PARTS * bare))
    for top in range(0, len(low), _BAND):
        first, bottom = max(top - halo, 0), min(top + _BAND, len(low))
        part = slice(first, bottom + halo)
        results = is_low[top:bottom], is_high[top:bottom]
        _compare(low[part], high[part], limits, top - first, results)
    return is_low, is_high


@kernel
def _compare(
    low: _Mask, high: _Mask, limits: tuple[np.float32, np.float32], first: int, results: tuple[_Mask, _Mask]
) -> None:
    """Fill the results for the rows of a band that begin at row `first`; `limits` are reach and bare in parts."""
    rows, columns = low.shape
    is_low, is_high = results
    # Two rows and columns more at each border, which are far from everything.
    distances = np.full((rows + 4, 2, columns + 4), _FAR, dtype=np.float32)
    spread, ramp = np.empty((2, columns), dtype=np.float32), _SIDE * np.arange(_COLUMNS).astype(np.float32)
    falling = -ramp
    for r in range(rows):
        for kind in range(2):
            points, here = (low[r], distances[r + 2, 0, 2:-2]) if kind == 0 else (high[r], distances[r + 2, 1, 2:-2])
            for c in range(columns):
                here[c] = np.float32(0) if points[c] else _FAR
            _spread_down(distances[r + 1, kind], distances[r, kind], spread[kind])
        _spread_along(distances[r + 2], spread, ramp, False)
    for r in range(rows - 1, first - 1, -1):
        for kind in range(2):
            _spread_down(distances[r + 3, kind], distances[r + 4, kind], spread[kind])
        _spread_along(distances[r + 2], spread, falling, True)
        if r - first < len(is_low):
            to_low, to_high = distances[r + 2, 0, 2:-2], distances[r + 2, 1, 2:-2]
            lows, highs = is_low[r - first], is_high[r - first]
            for c in range(columns):
                lows[c] = ((to_low[c] <= to_high[c]) & (to_low[c] <= limits[0])) | (to_high[c] > limits[1])
                highs[c] = (to_high[c] < to_low[c]) & (to_high[c] <= limits[0])


@kernel
def _spread_down(beside: _Distances, beyond: _Distances, least: _Distances) -> None:
    """Fill the least distances of a row by way of the row beside it and the row beyond that, which have margins."""
    # Slices, not offsets: indices that are seen to be in range make a loop that is vectorised.
    a, b, c, d, e = beside[:-4], beside[1:-3], beside[2:-2], beside[3:-1], beside[4:]
    f, g = beyond[1:-3], beyond[3:-1]
    for i in range(len(least)):
        straight = c[i] + _SIDE
        slant = min(b[i], d[i]) + _DIAGONAL
        jump = min(min(a[i], e[i]), min(f[i], g[i])) + _KNIGHT
        least[i] = min(straight, min(slant, jump))


@kernel
def _spread_along(rows: _Distances, spread: _Distances, ramp: _Distances, is_back: bool) -> None:
    """Lower the distances of a row to both kinds, in place, to those of the other rows, and then along it."""
    columns = spread.shape[1]
    for first in range(0, columns, _COLUMNS):
        start = max(columns - first - _COLUMNS, 0) if is_back else first
        end = columns - first if is_back else min(first + _COLUMNS, columns)
        before, length = end if is_back else start - 1, np.float32(end - start if is_back else 1)
        first_row, second_row = rows[0, start + 2 : end + 2], rows[1, start + 2 : end + 2]
        one, other = spread[0, start:end], spread[1, start:end]
        # Less what a distance grows by along the row, so that its least value so far is that of all columns.
        for c in range(len(one)):
            one[c] = min(first_row[c], one[c]) - ramp[c]
            other[c] = min(second_row[c], other[c]) - ramp[c]
        least, lowest = rows[0, before + 2] + _SIDE * length, rows[1, before + 2] + _SIDE * length
        for i in range(len(one)):
            at = np.uintp(len(one) - 1 - i if is_back else i)
            least, lowest = min(least, one[at]), min(lowest, other[at])
            one[at], other[at] = least, lowest
        for c in range(len(one)):
            first_row[c], second_row[c] = one[c] + ramp[c], other[c] + ramp[c]
