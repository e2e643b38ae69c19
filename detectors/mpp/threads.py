"""Threads: how the work of one run is divided.

Kernels are compiled and hold no lock (`nogil`), so threads of one process compute at the same time. Work is cut into
bands of rows or into jobs; each writes what no other reads, so the result has the same bits for any number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["ONE_THREAD", "Threads", "started_threads"]

_Job = TypeVar("_Job")
_Result = TypeVar("_Result")


@dataclass(frozen=True, eq=False)
class Threads:
    """Some threads.

    Attributes
    ----------
    count : int
    pool : Executor or None
        Absent where there is one: the calling thread does the work.
    """

    count: int
    pool: Executor | None

    def map(self, function: Callable[[_Job], _Result], jobs: Iterable[_Job]) -> list[_Result]:
        """Return the results of all jobs, in their order."""
        return [function(job) for job in jobs] if self.pool is None else list(self.pool.map(function, jobs))

    def bands(self, function: Callable[[int, int], _Result], rows: int, *, each: int = 2) -> list[_Result]:
        """Return ``function(first, last)`` of bands of rows that make up the whole, none of them empty.

        Of several threads each has `each` bands, so that one with more to do does not keep the others waiting.
        """
        count = 1 if self.count == 1 else each * self.count
        edges = sorted({rows * band // count for band in range(count + 1)})
        return self.map(lambda band: function(*band), pairwise(edges))

    def ranges(self, sizes: NDArray[Any], *, each: int = 8) -> list[tuple[int, int]]:
        """Return ranges of jobs of these sizes, ``(first, last)``, of about the same sum: `each` for each thread."""
        parts = 1 if self.count == 1 else each * self.count
        ends = np.cumsum(sizes)
        edges = np.searchsorted(ends, ends[-1:] * np.arange(1, parts) / parts)
        return list(pairwise(sorted({0, *edges.tolist(), len(sizes)})))


#: The calling thread.
ONE_THREAD = Threads(1, None)


@contextmanager
def started_threads(count: int) -> Iterator[Threads]:
    """Yield that many threads; they end with the block."""
    if count == 1:
        yield ONE_THREAD
    else:
        with ThreadPoolExecutor(count, thread_name_prefix="mpp") as pool:
            yield Threads(count, pool)
