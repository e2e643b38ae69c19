"""Texture: how rough and how open the surface around a cell is.

Nouns
-----
window
    3 x 3 cells, all of them high.
roughness
    Root mean square distance of the heights of a window from their best plane, metres.
openness
    Mean share of points that a closed surface would not give (see `cells`), of a window.
texture
    Roughness and openness of the smoothest window that holds a cell, so that cells at the edge of a roof are described
    by the roof and not by the edge.
bin
    Number of a texture: ``roughness bin * OPENNESS_BINS + openness bin``; -1 where no window holds the cell.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .arrays import Heights, States
from .cells import HIGH
from .threads import ONE_THREAD, Threads

__all__ = ["LOG_HIGH", "LOG_LOW", "OPENNESS_BINS", "ROUGHNESS_BINS", "Bins", "textures"]

Bins = NDArray[np.int16]

#: Number of bins of the logarithm of roughness, from 1 cm to 4 m, and of openness, from 0 to 1.
ROUGHNESS_BINS, OPENNESS_BINS = 24, 8
LOG_LOW, LOG_HIGH = math.log(0.01), math.log(4.0)
#: Bin of what is no window.
_NONE = np.int16(ROUGHNESS_BINS * OPENNESS_BINS)


def textures(height: Heights, state: States, openness: States, *, threads: Threads = ONE_THREAD) -> Bins:
    """Return the bin of the texture of each cell, -1 where no window holds it: shape (rows, columns)."""
    rows = state.shape[0]
    windows, bins = np.empty(state.shape, dtype=np.int16), np.empty(state.shape, dtype=np.int16)
    threads.bands(lambda first, last: _describe_windows(height, state, openness, first, last, windows), rows)
    threads.bands(lambda first, last: _choose_windows(windows, state, first, last, bins), rows)
    return bins


@kernel
def _describe_windows(height: Heights, state: States, openness: States, first: int, last: int, windows: Bins) -> None:
    """Fill the bin of the window around each cell of some rows."""
    rows, columns = state.shape
    for r in range(first, last):
        for c in range(columns):
            windows[r, c] = _NONE
            if state[r, c] != HIGH or r == 0 or r == rows - 1 or c == 0 or c == columns - 1:
                continue
            total, squares, east, south, openly = 0, 0, 0, 0, 0
            whole = True
            for i in range(-1, 2):
                for j in range(-1, 2):
                    if state[r + i, c + j] != HIGH:
                        whole = False
                    h = height[r + i, c + j] - height[r, c]
                    total += h
                    squares += h * h
                    east += j * h
                    south += i * h
                    openly += openness[r + i, c + j]
            if not whole:
                continue
            residual = squares - total * total / 9.0 - (east * east + south * south) / 6.0
            roughness = 0.01 * math.sqrt(max(residual, 0.0) / 6.0)
            share = (math.log(max(roughness, 0.01)) - LOG_LOW) / (LOG_HIGH - LOG_LOW)
            a = min(int(share * ROUGHNESS_BINS), ROUGHNESS_BINS - 1)
            b = min(int(openly / 9.0 / 255.0 * OPENNESS_BINS), OPENNESS_BINS - 1)
            windows[r, c] = a * OPENNESS_BINS + b


@kernel
def _choose_windows(windows: Bins, state: States, first: int, last: int, bins: Bins) -> None:
    """Fill for each cell of some rows the bin of the smoothest window that holds it."""
    rows, columns = windows.shape
    for r in range(first, last):
        for c in range(columns):
            bins[r, c] = -1
            if state[r, c] != HIGH:
                continue
            least = _NONE
            for i in range(max(r - 1, 0), min(r + 2, rows)):
                for j in range(max(c - 1, 0), min(c + 2, columns)):
                    least = min(least, windows[i, j])
            if least < _NONE:
                bins[r, c] = least
