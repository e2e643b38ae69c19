"""Child processes: their limits, their environment, how they are ended, and the sentences that say how they ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import IO

__all__ = [
    "THREAD_LIMITS",
    "Limits",
    "clean_environment",
    "death_reason",
    "end_children",
    "end_marked",
    "end_tree",
    "memory_reason",
    "start_python",
    "time_reason",
]

#: One thread per numeric library and process.
THREAD_LIMITS = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "NUMEXPR_NUM_THREADS": "1",
    "VECLIB_MAXIMUM_THREADS": "1",
}
_ROUNDS = 10  # of looking for marked processes: those that are found may just have started others
_PATIENCE = 5.0  # seconds for killed processes to end
#: Variables that say where and by which command line this process was started.
_TRACES = ("PWD", "OLDPWD", "_", "PYTEST_CURRENT_TEST")


@dataclass(frozen=True)
class Limits:
    """Limits of one run or one program.

    Attributes
    ----------
    seconds : float, optional
        Wall clock time, including everything that is done for the run: reading, starting a process, evaluation.
    memory : int, optional
        Highest resident memory of the process and its children, bytes.
    """

    seconds: float | None = None
    memory: int | None = None


def clean_environment(more: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return the environment for a child process: without the folder and the command line of this process."""
    kept = {name: value for name, value in os.environ.items() if name not in _TRACES}
    return {**kept, **THREAD_LIMITS, **(more or {})}


def start_python(
    code: str,
    *,
    path: str,
    folder: str,
    errors: IO[bytes] | int | None,
    own_session: bool = False,
    environment: Mapping[str, str] | None = None,
) -> subprocess.Popen[bytes]:
    """Start this Python with a clean environment; messages go through its standard input and output.

    Parameters
    ----------
    code : str
        What it runs.
    path : str
        Where it finds modules (PYTHONPATH).
    folder : str
        Working folder. The one of the caller holds stores and suites, which are nothing for a detector.
    errors : file, int or None
        Where its standard error goes.
    own_session : bool, default False
        Whether Ctrl-C in the terminal does not reach it.
    environment : mapping, optional
        Variables beside those of `clean_environment`.
    """
    return subprocess.Popen(  # noqa: S603 - our own interpreter with our own code
        # -P: the working directory must not come before the given path, which may hold older code.
        [sys.executable, "-P", "-X", "faulthandler", "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=errors,
        env=clean_environment({**(environment or {}), "PYTHONPATH": path}),
        cwd=folder,
        start_new_session=own_session,
    )


def end_tree(process: int) -> None:
    """Kill a process with everything that it started and that is still its descendant."""
    import psutil

    with suppress(psutil.Error):
        doomed = psutil.Process(process)
        _kill([*doomed.children(recursive=True), doomed])


def end_children() -> None:
    """Kill every descendant of this process, and wait for its children, whose processor time then counts as its own."""
    import psutil

    with suppress(psutil.Error):
        _kill(psutil.Process().children(recursive=True))
    deadline = time.monotonic() + _PATIENCE
    with suppress(OSError):  # there are no more children; a system that cannot wait for any
        while time.monotonic() < deadline:
            if os.waitpid(-1, getattr(os, "WNOHANG", 0))[0] == 0:
                time.sleep(0.01)


def end_marked(variable: str, value: str) -> None:
    """Kill every process of this user with a value of an environment variable, whoever its parent is now."""
    import psutil

    for _ in range(_ROUNDS):
        marked = []
        for process in psutil.process_iter():
            with suppress(psutil.Error, OSError):
                if process.environ().get(variable) == value and process.status() != psutil.STATUS_ZOMBIE:
                    marked.append(process)
        if not marked:
            break
        _kill([*marked])


def _kill(processes: list[object]) -> None:
    import psutil

    for process in processes:
        with suppress(psutil.Error):
            process.kill()  # type: ignore[attr-defined]


def time_reason(seconds: float) -> str:
    """Return the sentence for an exceeded time limit."""
    return f"time limit of {seconds:g} s exceeded"


def memory_reason(peak: int, limit: int) -> str:
    """Return the sentence for an exceeded memory limit, both in bytes."""
    return f"memory limit of {limit / 1e6:.0f} MB exceeded: {peak / 1e6:.0f} MB used"


def death_reason(code: int | None, who: str) -> str:
    """Return how a process ended that should not have: `who` is its name in the sentence.

    >>> death_reason(-9, "the program"), death_reason(3, "the program")
    ('the program was killed by signal 9 (SIGKILL)', 'the program exited with code 3')
    """
    if code is None:
        return f"{who} stopped answering"
    if code < 0:
        with suppress(ValueError):
            return f"{who} was killed by signal {-code} ({signal.Signals(-code).name})"
        return f"{who} was killed by signal {-code}"
    return f"{who} exited with code {code}"
