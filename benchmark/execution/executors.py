"""Executors: where tasks run; all of them are a ``concurrent.futures.Executor``.

A *slot* is an executor with the number of tasks that it receives at once. On this machine each worker is a slot with
one thread and an isolated process, so that the runs of a scene can stay on the worker that has it open. A Dask cluster
is one slot, or one for each of its workers; these run each task in an isolated process, so that limits and crashes are
handled in the same way.
`InProcess` runs tasks immediately in the calling process: for objects that no other process can make, and for
debuggers.
"""

from __future__ import annotations

import concurrent.futures
import re
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

from ...core.errors import InputError, UnsupportedError
from ...core.processes import Limits
from .isolation import close_isolated

if TYPE_CHECKING:
    from distributed import Client

__all__ = ["Execution", "InProcess", "Slot", "cluster_slot", "local_slots", "slots_of"]

T = TypeVar("T")

#: Tasks that a slot receives beyond its workers, so that no worker waits for the store.
_AHEAD = 1
_CONNECT_SECONDS = 15


@dataclass(frozen=True, kw_only=True)
class Execution:
    """How runs are executed.

    Attributes
    ----------
    jobs : int
        Worker processes on this machine; 0 runs in this process, without limits and without isolation.
    scheduler : str, optional
        Address of a Dask scheduler, used instead of processes on this machine.
    limits : Limits
        Of each run.
    """

    jobs: int = 1
    scheduler: str | None = None
    limits: Limits = field(default_factory=Limits)


@dataclass(frozen=True, eq=False)
class Slot:
    """An executor and the number of tasks that it receives at once.

    Attributes
    ----------
    executor : Executor
        Where tasks are submitted.
    capacity : int
        Tasks that it receives at once.
    reads_ahead : bool
        Whether its tasks run in one process in the order of their submission, so that each can name what the next one
        reads.
    """

    executor: Executor
    capacity: int
    reads_ahead: bool = False


class InProcess(Executor):
    """An executor that runs a task when it is submitted."""

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """Run the task and return the finished future."""
        future: Future[T] = concurrent.futures.Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@contextmanager
def local_slots(workers: int) -> Iterator[list[Slot]]:
    """Yield slots for isolated processes on this machine, which end with the block."""
    executors = [ThreadPoolExecutor(max_workers=1, thread_name_prefix=f"roofbench-{n}") for n in range(workers)]
    try:
        yield [Slot(executor, 1 + _AHEAD, reads_ahead=True) for executor in executors]
    finally:
        for executor in executors:
            executor.shutdown(wait=False, cancel_futures=True)
        close_isolated()  # running tasks are abandoned
        for executor in executors:
            executor.shutdown(wait=True)


@contextmanager
def _cluster(address: str) -> Iterator[tuple[Client, dict[str, int]]]:
    """Yield a client of the Dask cluster at `address`, and the number of threads of each worker."""
    try:
        from distributed import Client
    except ImportError as error:
        raise UnsupportedError("scheduler= needs Dask: pip install 'dask[distributed]'") from error
    # Without a port, Client would wait for half a minute before it gives up. Clusters within this process have none.
    if not address.startswith("inproc://") and not re.search(r":\d+/?$", address):
        raise InputError(f"{address!r} is not the address of a Dask scheduler: write tcp://HOST:PORT")
    try:
        client = Client(address, timeout=_CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at {address}: {error}") from error
    with client:
        threads = client.nthreads()
        if not threads:
            raise InputError(f"the Dask scheduler at {address} has no workers: start one with 'dask worker {address}'")
        yield client, threads


@contextmanager
def cluster_slot(address: str) -> Iterator[Slot]:
    """Yield the Dask cluster at `address` as one slot: its scheduler chooses the worker of each task."""
    with _cluster(address) as (client, threads):
        yield Slot(client.get_executor(pure=False), 2 * sum(threads.values()) + _AHEAD)


@contextmanager
def _worker_slots(address: str) -> Iterator[list[Slot]]:
    """Yield a slot for each worker of the Dask cluster at `address`.

    A worker that has nothing to do takes tasks of others, and tasks of a worker that has ended run elsewhere.
    """
    with _cluster(address) as (client, threads):
        yield [
            Slot(
                client.get_executor(pure=False, workers=[worker], allow_other_workers=True),
                count + _AHEAD,
                reads_ahead=count == 1,
            )
            for worker, count in sorted(threads.items())
        ]


@contextmanager
def slots_of(jobs: int, scheduler: str | None, tasks: int, *, by_worker: bool = False) -> Iterator[list[Slot]]:
    """Yield where so many tasks run: a cluster, `jobs` processes, or with 0 jobs this process.

    With `by_worker`, each worker of a cluster is a slot, which suits tasks that take about the same time.
    """
    if scheduler is not None:
        if jobs == 0:
            raise UnsupportedError("jobs=0 runs in this process and cannot be combined with a scheduler")
        if by_worker:
            with _worker_slots(scheduler) as slots:
                yield slots
        else:
            with cluster_slot(scheduler) as slot:
                yield [slot]
    elif jobs == 0:
        yield [Slot(InProcess(), 1, reads_ahead=True)]
    else:
        with local_slots(min(jobs, tasks)) as slots:
            yield slots
