"""Isolation: one process per worker, so that a run that crashes, hangs or exhausts memory fails alone.

An *isolated process* is a new Python interpreter that receives one task after the other as length-prefixed messages
over its standard streams. It makes or reads the scene and evaluates; the detector runs in another process, which never
held anything but measurements (`detection`), so that a detector cannot reach the reference, the seed or the suite.
Numeric libraries in them use one thread each, because the cores belong to the workers. The caller watches time and
memory. When a limit is exceeded or the process ends, the task fails with that reason and the next task gets a new
process. When the caller ends, even by ``kill -9``, the stream closes and the process exits. Before, it waits for the
processes that it started, so that their processor time counts as that of the caller's children.
"""

from __future__ import annotations

import faulthandler
import os
import secrets
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import IO

from ...core.memory import bound_allocations, highest_memory, tree_memory
from ...core.package import FOLDER
from ...core.processes import (
    Limits,
    death_reason,
    end_children,
    end_marked,
    end_tree,
    memory_reason,
    start_python,
    time_reason,
)
from ..store.outcomes import Cost, Outcome, ScoreFailure
from .fork_server import CAN_FORK, ForkServer
from .messages import Receiver, listen, receive, send
from .tasks import Task

__all__ = ["IsolatedProcess", "call_isolated", "close_isolated", "serve"]

_PACKAGE = __package__
_START = f"from {_PACKAGE}.isolation import serve; serve()"
#: Variable that a worker and all that it starts have in their environment, with a random value.
_MARK = "ROOFBENCH_WORKER"
_WATCH_EVERY = 0.05  # seconds between two checks of a worker with a memory limit
_LOOK_EVERY = 0.5  # seconds between two checks of any other worker
_PATIENCE = 5.0  # seconds for a worker to end itself


class IsolatedProcess:
    """One worker process, started by the first `call`."""

    def __init__(self, *, python_path: str | None = None) -> None:
        self._python_path = python_path
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: IO[bytes] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._detected: bytes | None = None
        self._mark = secrets.token_hex(16)

    def call(self, task: str, limits: Limits) -> bytes:
        """Run a task and return its outcome as bytes; a crash or an exceeded limit is a failed outcome."""
        process = self._running()
        errors = self._errors
        assert errors is not None
        errors.seek(0)
        errors.truncate()
        if limits.memory is not None:
            for number in [process.pid, *_children(process.pid, all_of_them=True)]:
                bound_allocations(number, limits.memory)
        started = time.monotonic()
        peak = 0
        self._detected = None
        try:
            send(process.stdin, task.encode())
            deadline = None if limits.seconds is None else started + limits.seconds
            receiver = Receiver(process.stdout)
            while (message := receiver.poll(_pause(limits, deadline))) is None:
                self._detected = receiver.preliminary
                peak = 0 if limits.memory is None else _peak(process.pid)
                if deadline is not None and time.monotonic() > deadline:
                    peak = _peak(process.pid)
                    return self._failed(process, task, time_reason(limits.seconds or 0.0), started=started, peak=peak)
                if limits.memory is not None and peak > limits.memory:
                    return self._failed(process, task, memory_reason(peak, limits.memory), started=started, peak=peak)
            peak = 0 if limits.memory is None else _peak(process.pid)
            if limits.memory is not None and peak > limits.memory:  # a peak between two checks
                return self._failed(process, task, memory_reason(peak, limits.memory), started=started, peak=peak)
            return message
        except (EOFError, OSError, ValueError):  # ValueError: the stream was closed
            return self._failed(process, task, None, started=started, peak=peak)

    def let_end(self) -> None:
        """Let the process end itself and what it started; `close` waits for it."""
        if self._process is not None and self._process.stdin is not None:
            with suppress(OSError):
                self._process.stdin.close()

    def close(self) -> None:
        """End the process."""
        self.let_end()
        process, self._process = self._process, None
        if process is not None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(timeout=_PATIENCE)
            end_tree(process.pid)
            with suppress(OSError):
                process.kill()
            process.wait()
            end_marked(_MARK, self._mark)  # daemons that programs of detectors started are nobody's children
            if self._folder is not None:
                self._folder.cleanup()
            for stream in (process.stdin, process.stdout, self._errors):
                if stream is not None:
                    with suppress(OSError):
                        stream.close()

    def _failed(
        self, process: subprocess.Popen[bytes], task: str, reason: str | None, *, started: float, peak: int
    ) -> bytes:
        if reason is None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(timeout=5)
            reason = death_reason(process.returncode, "the worker process")
        written = ""
        if self._errors is not None:
            with suppress(OSError, ValueError):  # closed when the caller was interrupted
                self._errors.seek(0)
                written = self._errors.read()[-4000:].decode(errors="replace")
        self.close()
        if self._detected is not None:
            return _unevaluated(self._detected, task, reason).to_bytes()
        cost = Cost(seconds=time.monotonic() - started, peak_memory=peak)
        return Outcome(status="failed", reason=reason, traceback=written, cost=cost).to_bytes()

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is not None and self._process.poll() is not None:
            self.close()
        if self._process is None:
            path = self._python_path
            if path is None:
                path = _search_path()
            self._folder = tempfile.TemporaryDirectory(prefix="roofbench-")
            self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - it lives as long as the process
            # Ctrl-C reaches the caller only, which ends its workers.
            self._process = start_python(
                _START,
                path=path,
                folder=self._folder.name,
                errors=self._errors,
                own_session=True,
                environment={_MARK: self._mark},
            )
        return self._process


def _children(process: int, *, all_of_them: bool = False) -> list[int]:
    """Return the processes that a process started itself, or all its descendants."""
    import psutil

    with suppress(psutil.Error):
        return [child.pid for child in psutil.Process(process).children(recursive=all_of_them)]
    return []


def _peak(process: int) -> int:
    """Return the highest memory of an isolated process, or of a detector process with the programs of that, bytes."""
    detectors = _children(process)
    if CAN_FORK:
        detectors = [child for server in detectors for child in _children(server)]
    return max(highest_memory(process), *map(tree_memory, detectors), 0)


def _search_path() -> str:
    """Return where modules are found, without the working folder (unless roofbench lies there, or it is asked for)."""
    here = Path.cwd().resolve()
    asked = [Path(entry).resolve() for entry in os.environ.get("PYTHONPATH", "").split(os.pathsep) if entry]
    is_kept = here == FOLDER.parent or here in asked
    kept = [entry for entry in sys.path if entry and (is_kept or Path(entry).resolve() != here)]
    return os.pathsep.join(map(os.path.abspath, kept))


def _unevaluated(detected: bytes, task: str, reason: str) -> Outcome:
    """Return the outcome of a process that ended during the evaluation: the detections, and no score."""
    done, asked = Outcome.from_bytes(detected), Task.from_json(task)
    codes = asked.codes or ("",) * len(asked.evaluators)
    failures = (
        ScoreFailure(evaluator=recipe, code=code, reason=reason)
        for recipe, code in zip(asked.evaluators, codes, strict=True)
    )
    return replace(done, score_failures=tuple(failures))


def _pause(limits: Limits, deadline: float | None) -> float:
    """Return how long to wait for an answer until the next check, seconds."""
    pause = _LOOK_EVERY if limits.memory is None else _WATCH_EVERY
    return pause if deadline is None else max(0.0, min(pause, deadline - time.monotonic()))


_local = threading.local()
_every: list[IsolatedProcess] = []


def call_isolated(task: str, limits: Limits) -> bytes:
    """Run a task in the isolated process of the calling thread; the function that executors of every kind receive."""
    process: IsolatedProcess | None = getattr(_local, "process", None)
    if process is None:
        process = _local.process = IsolatedProcess()
        _every.append(process)
    return process.call(task, limits)


def close_isolated() -> None:
    """End the isolated processes of all threads of this process."""
    for process in _every:
        process.let_end()
    while _every:
        _every.pop().close()


def serve() -> None:
    """Run tasks from standard input until it closes: the main function of an isolated process.

    It opens scenes and evaluates; detectors run in processes that its fork server starts, or that it starts itself
    where the system cannot fork (`detection`).
    """
    from .detection import serve_detectors
    from .detector_process import DetectorProcesses
    from .worker import execute_text

    # Before the first task is read: nothing that is forked later can know a task.
    server = ForkServer(serve_detectors) if CAN_FORK else None
    inward, outward = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # The caller reads the errors of the detector. Those of this process can name scenes, so they go elsewhere.
    errors = os.dup(2)
    faulthandler.enable(errors)
    with tempfile.TemporaryFile() as own:
        os.dup2(own.fileno(), 1)
        os.dup2(own.fileno(), 2)

    def end() -> None:
        if server is not None:
            server.close()
        end_children()

    tasks = listen(inward, receive, ending=end)
    apart = DetectorProcesses(server, errors, str(Path.cwd()))
    while True:
        message = execute_text(
            tasks.get().decode(), detected=lambda detected: send(outward, detected, preliminary=True), apart=apart
        )
        send(outward, message)
