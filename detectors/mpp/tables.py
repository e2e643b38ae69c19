"""Cell tables: row prefix sums from which the statistics of any rectangle follow in one scan over its rows.

Nouns
-----
small table
    int32, shape (rows, columns + 1, 4): running sums from the west of n (1 for a high cell), n x, n h and the score.
large table
    int64, shape (rows, columns + 1, 3): running sums of n x2, n x h and n h2.
x, h, score
    Column index; height in centimetres; what a cell adds to a rectangle that covers it besides the fit of its roof,
    in thousandths of a nat.

Whole numbers make sums exact: a rectangle has the same statistics by differences of prefixes as cell by cell, and
wherever the grid begins. 16 + 24 = 40 bytes a cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["MILLI", "Tables", "make_tables"]

#: Steps of the score per nat.
MILLI = 1000.0


@dataclass(frozen=True, eq=False)
class Tables:
    """Row prefix sums of one grid; see the module for the columns."""

    small: NDArray[np.int32]
    large: NDArray[np.int64]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of cells."""
        return self.small.shape[0], self.small.shape[1] - 1


def make_tables(height: NDArray[np.int32], high: NDArray[np.bool_], score: NDArray[np.float32]) -> Tables:
    """Sum up the rows.

    Parameters
    ----------
    height : ndarray of int32, shape (rows, columns)
        Centimetres; read where `high`.
    high : ndarray of bool, shape (rows, columns)
    score : ndarray of float32, shape (rows, columns)
        Nats.
    """
    rows, columns = height.shape
    small = np.zeros((rows, columns + 1, 4), dtype=np.int32)
    large = np.zeros((rows, columns + 1, 3), dtype=np.int64)
    _sum_rows(height, high, score, small, large)
    return Tables(small, large)


@njit(cache=True, nogil=True)
def _sum_rows(height, high, score, small, large):  # type: ignore[no-untyped-def]
    rows, columns = height.shape
    one = np.int64(1)
    for r in range(rows):
        n, nx, nh, points = 0, 0, 0, 0
        nxx, nxh, nhh = 0 * one, 0 * one, 0 * one
        for c in range(columns):
            if high[r, c]:
                h = height[r, c] * one
                n += 1
                nx += c
                nh += h
                nxx += c * c
                nxh += c * h
                nhh += h * h
            points += round(score[r, c] * MILLI)
            small[r, c + 1, 0], small[r, c + 1, 1], small[r, c + 1, 2], small[r, c + 1, 3] = n, nx, nh, points
            large[r, c + 1, 0], large[r, c + 1, 1], large[r, c + 1, 2] = nxx, nxh, nhh
