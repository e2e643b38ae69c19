"""Executors: where tasks are done, all behind ``concurrent.futures.Executor``.

`local_executor` is N threads, each with an isolated process. `cluster_executor` is a Dask cluster; its workers do each
task in an isolated process of theirs, so limits and crashes are handled the same way there. `InProcess` does tasks at
once in the calling process: for objects that no other process can make, and for debuggers.
"""

from __future__ import annotations

import concurrent.futures
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

from ..scenes.errors import InputError, UnsupportedError
from .isolation import close_isolated

__all__ = ["InProcess", "cluster_executor", "local_executor"]

T = TypeVar("T")


class InProcess(Executor):
    """An executor that does a task when it is submitted."""

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """Do it now and return the finished future."""
        future: Future[T] = concurrent.futures.Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@contextmanager
def local_executor(workers: int) -> Iterator[Executor]:
    """Yield an executor of that many isolated processes on this machine; they end with the block."""
    executor = ThreadPoolExecutor(max_workers=workers, thread_name_prefix="roofbench")
    try:
        yield executor
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        close_isolated()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)
        close_isolated()


@contextmanager
def cluster_executor(address: str) -> Iterator[tuple[Executor, int]]:
    """Yield an executor on the Dask cluster at `address` and its number of worker threads."""
    try:
        from distributed import Client
    except ImportError as error:
        raise UnsupportedError("--scheduler needs Dask: pip install 'roofbench[dask]'") from error
    try:
        client = Client(address, timeout="15s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at {address}: {error}") from error
    with client:
        threads = sum(client.nthreads().values())
        if not threads:
            raise InputError(f"the Dask scheduler at {address} has no workers: start one with 'dask worker {address}'")
        yield client.get_executor(pure=False), threads
