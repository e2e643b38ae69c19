"""Unknown cells of a raster of heights filled by a smooth surface through the known ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel

__all__ = ["fill_unknown"]

_Floats = NDArray[np.float32]
_Mask = NDArray[np.bool_]


def fill_unknown(values: _Floats) -> _Floats:
    """Return the values with NaN replaced by a smooth surface through the known ones (all NaN stays NaN).

    Pull and push: unknown cells take the bilinear value of the filled grid of half the resolution, and each level is
    then relaxed towards the mean of the four neighbours (membrane), so that a gap in a slope is filled along it.
    """
    known = np.isfinite(values)
    if known.all() or not known.any():
        return values.astype(np.float32)
    # Heights above sea are large against the float32 step of their sums.
    base = np.float32(values[known].mean())
    filled = _pull_push(np.where(known, values - base, 0).astype(np.float32), known)
    filled += base
    filled[known] = values[known]
    return filled


def _pull_push(values: _Floats, known: _Mask) -> _Floats:
    import cv2

    rows, columns = values.shape
    if not known.all() and max(rows, columns) > 1:
        even = ((0, rows % 2), (0, columns % 2))
        weight = _blocks(np.pad(known.astype(np.float32), even))
        total = _blocks(np.pad(values * known, even))
        mean: _Floats = (total / np.maximum(weight, 1)).astype(np.float32)
        coarse = _pull_push(mean, weight > 0)
        finer = cv2.resize(coarse, (columns + columns % 2, rows + rows % 2), interpolation=cv2.INTER_LINEAR)
        values = np.where(known, values, finer[:rows, :columns])
        _relax(values, known, 20)
    return values


def _blocks(values: _Floats) -> _Floats:
    return values[::2, ::2] + values[1::2, ::2] + values[::2, 1::2] + values[1::2, 1::2]


@kernel
def _relax(values: _Floats, known: _Mask, rounds: int) -> None:
    """Move unknown cells to the mean of their neighbours, in place, `rounds` sweeps in alternating order."""
    rows, columns = values.shape
    for sweep in range(rounds):
        for i in range(rows):
            r = i if sweep % 2 == 0 else rows - 1 - i
            for j in range(columns):
                c = j if sweep % 2 == 0 else columns - 1 - j
                if known[r, c]:
                    continue
                total, count = 0.0, 0
                if r > 0:
                    total += values[r - 1, c]
                    count += 1
                if r < rows - 1:
                    total += values[r + 1, c]
                    count += 1
                if c > 0:
                    total += values[r, c - 1]
                    count += 1
                if c < columns - 1:
                    total += values[r, c + 1]
                    count += 1
                values[r, c] = total / count
