"""Threads: how the work of one run is shared out.

Kernels are compiled and hold no lock (`nogil`), so threads of one process compute at the same time. Work is cut into
bands of rows or into jobs; each writes what no other reads, so the result has the same bits for any number of threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

__all__ = ["ALONE", "Workers", "some_workers"]

_Job = TypeVar("_Job")
_Result = TypeVar("_Result")


@dataclass(frozen=True, eq=False)
class Workers:
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

    def bands(self, function: Callable[[int, int], None], rows: int) -> None:
        """Call ``function(first, last)`` for bands of rows that make up the whole."""
        edges = [rows * band // self.count for band in range(self.count + 1)]
        self.map(lambda band: function(edges[band], edges[band + 1]), range(self.count))


#: The calling thread.
ALONE = Workers(1, None)


@contextmanager
def some_workers(count: int) -> Iterator[Workers]:
    """Yield that many threads; they end with the block."""
    if count == 1:
        yield ALONE
    else:
        with ThreadPoolExecutor(count, thread_name_prefix="mpp") as pool:
            yield Workers(count, pool)
