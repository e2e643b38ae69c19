"""Tasks of one kind, run by an executor: threads of this process by default, or whatever the caller hands over."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from typing import TypeVar

from .errors import OutputError, RoofbenchError

__all__ = ["run_tasks"]

T = TypeVar("T")


def run_tasks(function: Callable[[T], None], tasks: Sequence[T], executor: Executor | None = None) -> Iterator[int]:
    """Run a function for each task and yield the number of finished tasks whenever one ends.

    Tasks that have not begun are cancelled when one fails or the iteration ends early.

    Parameters
    ----------
    function : callable
        Of a module, so that other processes find it.
    tasks : sequence
    executor : Executor, optional
        By default threads of this process.

    Raises
    ------
    OutputError
        A given executor lost a task: a worker was killed, or has other versions of the libraries.

    Examples
    --------
    >>> done = []
    >>> list(run_tasks(done.append, [3, 5])), sorted(done)
    ([1, 2], [3, 5])
    """
    own = ThreadPoolExecutor(os.cpu_count() or 1) if executor is None else None
    runner = executor or own
    assert runner is not None
    running: list[Future[None]] = []
    try:
        running += [runner.submit(function, task) for task in tasks]
        for done, future in enumerate(as_completed(running), 1):
            _require(future, own is None)
            yield done
    finally:
        for future in running:
            future.cancel()
        if own is not None:
            own.shutdown(wait=True, cancel_futures=True)


def _require(future: Future[None], elsewhere: bool) -> None:
    try:
        future.result()
    except (RoofbenchError, OSError):
        raise
    except Exception as error:
        if not elsewhere:
            raise
        raise OutputError(
            f"a task was lost on the cluster ({type(error).__name__}: {error}): run the same command again to continue"
        ) from error
