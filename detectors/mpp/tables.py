"""Cell tables: row prefix sums from which the statistics of any rectangle follow in one scan over its rows.

Nouns
-----
record
    32 bytes for each cell and one more a row, seen as eight int32 (the *small* table) and as four int64 (the *large*
    table). Small columns 0 to 5: running sums from the west of n (1 for a high cell), x, h, the score, x2 and x h;
    large column 3: that of h2.
x, h, score
    Column index; height in centimetres, at most `TALLEST`; what a cell adds to a rectangle that covers it besides the
    fit of its roof, in thousandths of a nat.

Whole numbers make sums exact: a rectangle has the same statistics by differences of prefixes as cell by cell, and
wherever the grid begins. The int32 sums wrap around at 2^32, which is harmless: differences are taken modulo
2^32 too, x is counted from a column x0 in the rectangle (sum (x - x0) h = sum x h - x0 sum h, which holds modulo 2^32),
and the true value fits 32 bits as long as no rectangle reaches over more than `LONGEST` cells:
|sum (x - x0) h| < 65536 LONGEST^2 / 8 = 2^31.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .arrays import Heights, Mask, Scores
from .threads import ONE_THREAD, Threads

__all__ = ["LONGEST", "MILLI", "NO_TABLES", "TALLEST", "Tables", "make_tables", "part_sums"]

#: Steps of the score per nat.
MILLI = 1000.0
#: Cells that a rectangle may reach over, and the greatest height in centimetres.
LONGEST, TALLEST = 512, 65535


class Tables(NamedTuple):
    """Row prefix sums of one grid; see the module for the columns."""

    small: NDArray[np.int32]
    large: NDArray[np.int64]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of cells."""
        return self.small.shape[0], self.small.shape[1] - 1


#: Tables of no cells, to release those that are no longer needed.
NO_TABLES = Tables(np.empty((0, 1, 8), dtype=np.int32), np.empty((0, 1, 4), dtype=np.int64))


def make_tables(
    height: Heights | NDArray[np.uint16],
    high: Mask,
    score: Scores,
    *,
    threads: Threads = ONE_THREAD,
) -> Tables:
    """Sum up the rows.

    Parameters
    ----------
    height : ndarray of int32 or uint16, shape (rows, columns)
        Centimetres; read where `high`.
    high : ndarray of bool, shape (rows, columns)
    score : ndarray of int16, shape (rows, columns)
        Thousandths of a nat.
    threads : Threads
    """
    rows, columns = height.shape
    large = np.empty((rows, columns + 1, 4), dtype=np.int64)
    tables = Tables(large.view(np.int32), large)
    threads.bands(lambda first, last: _sum_rows(height, high, score, first, last, tables), rows)
    return tables


@kernel(inline="always")
def part_sums(tables: Tables, row: int, first: int, last: int, x0: int) -> tuple[Any, ...]:
    """Return n, sums of x, xx, h, xh, hh of the cells first..last of a row, x counted from column x0."""
    small, large = tables.small, tables.large
    n = np.int64(small[row, last, 0]) - small[row, first, 0]
    x = np.int64(small[row, last, 1]) - small[row, first, 1]
    h = np.int64(small[row, last, 2]) - small[row, first, 2]
    xx = np.int64(small[row, last, 4]) - small[row, first, 4]
    xh = np.int64(small[row, last, 5]) - small[row, first, 5]
    hh = large[row, last, 3] - large[row, first, 3]
    # Truncation to 32 bits takes the difference modulo 2^32.
    return (
        n,
        np.int64(np.int32(x - x0 * n)),
        np.int64(np.int32(xx - x0 * (2 * x - x0 * n))),
        np.int64(np.int32(h)),
        np.int64(np.int32(xh - x0 * h)),
        hh,
    )


@kernel
def _sum_rows(
    height: Heights | NDArray[np.uint16], high: Mask, score: Scores, first: int, last: int, tables: Tables
) -> None:
    """Fill the tables of some rows."""
    small, large = tables.small, tables.large
    columns = height.shape[1]
    for r in range(first, last):
        zero = np.int64(0)
        n, x, h, milli, xx, xh, hh = 0, 0, zero, 0, 0, zero, zero
        large[r, 0, :] = 0
        for c in range(columns):
            if high[r, c]:
                level = np.int64(min(height[r, c], TALLEST))
                n += 1
                x += c
                h += level
                xx += c * c
                xh += c * level
                hh += level * level
            milli += score[r, c]
            small[r, c + 1, 0], small[r, c + 1, 1], small[r, c + 1, 2] = n, np.int32(x), np.int32(h)
            small[r, c + 1, 3], small[r, c + 1, 4], small[r, c + 1, 5] = np.int32(milli), np.int32(xx), np.int32(xh)
            large[r, c + 1, 3] = hh
