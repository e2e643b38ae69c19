"""Isolation: one process per worker, so that a run that crashes, hangs or exhausts memory fails alone.

An *isolated process* is a new Python interpreter that receives one task after the other as length-prefixed messages
over its standard streams. Numeric libraries in it use one thread each, because the cores belong to the workers. The
caller watches time and memory. When a limit is exceeded or the process ends, the task fails with that reason and the
next task gets a new process. When the caller ends, even by ``kill -9``, the stream closes and the process exits.
"""

from __future__ import annotations

import os
import queue
import selectors
import struct
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
    clean_environment,
    death_reason,
    end_children,
    end_tree,
    memory_reason,
    time_reason,
)
from ..store.outcomes import Cost, Outcome, ScoreFailure
from .tasks import Task

__all__ = ["IsolatedProcess", "call_isolated", "close_isolated", "serve"]

_PACKAGE = __package__
_START = f"from {_PACKAGE}.isolation import serve; serve()"
_WATCH_EVERY = 0.05  # seconds between two checks of a worker with a memory limit
_LOOK_EVERY = 0.5  # seconds between two checks of any other worker


class IsolatedProcess:
    """One worker process, started by the first `call`."""

    def __init__(self, *, python_path: str | None = None) -> None:
        self._python_path = python_path
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: IO[bytes] | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._detected: bytes | None = None

    def call(self, task: str, limits: Limits) -> bytes:
        """Run a task and return its outcome as bytes; a crash or an exceeded limit is a failed outcome."""
        process = self._running()
        errors = self._errors
        assert errors is not None
        errors.seek(0)
        errors.truncate()
        if limits.memory is not None:
            bound_allocations(process.pid, limits.memory)
        started = time.monotonic()
        peak = 0
        self._detected = None
        try:
            _send(process.stdin, task.encode())
            deadline = None if limits.seconds is None else started + limits.seconds
            receiver = _Receiver(process.stdout)
            while (message := receiver.poll(_pause(limits, deadline))) is None:
                self._detected = receiver.preliminary
                peak = highest_memory(process.pid) if limits.memory is None else tree_memory(process.pid)
                if deadline is not None and time.monotonic() > deadline:
                    return self._failed(process, task, time_reason(limits.seconds or 0.0), started=started, peak=peak)
                if limits.memory is not None and peak > limits.memory:
                    return self._failed(process, task, memory_reason(peak, limits.memory), started=started, peak=peak)
            peak = highest_memory(process.pid)
            if limits.memory is not None and peak > limits.memory:  # a peak between two checks
                return self._failed(process, task, memory_reason(peak, limits.memory), started=started, peak=peak)
            return message
        except (EOFError, OSError, ValueError):  # ValueError: the stream was closed
            return self._failed(process, task, None, started=started, peak=peak)

    def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            end_tree(process.pid)
            with suppress(OSError):
                process.kill()
            process.wait()
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
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter with our own code
                # -P: the working directory must not come before the given path, which may hold older code.
                [sys.executable, "-P", "-X", "faulthandler", "-c", _START],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                env=clean_environment({"PYTHONPATH": path}),
                # The folder of the caller holds stores and suites, which are nothing for a detector.
                cwd=self._folder.name,
                start_new_session=True,  # Ctrl-C reaches the caller only, which ends its workers
            )
        return self._process


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
    while _every:
        _every.pop().close()


def serve() -> None:
    """Run tasks from standard input until it closes: the main function of an isolated process."""
    inward, outward = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of a detector must not mix with the messages
    tasks: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def listen() -> None:
        while True:
            try:
                tasks.put(_receive(inward))
            except (EOFError, OSError):
                end_children()
                os._exit(0)  # the caller has ended, so nobody needs the result

    threading.Thread(target=listen, daemon=True).start()
    from .worker import execute_text

    while True:
        message = execute_text(tasks.get().decode(), lambda detected: _send(outward, detected, preliminary=True))
        _send(outward, message)


#: Bit of a message's size that marks an outcome before its evaluation.
_PRELIMINARY = 1 << 63


def _send(stream: IO[bytes] | None, message: bytes, *, preliminary: bool = False) -> None:
    assert stream is not None
    stream.write(struct.pack("<Q", len(message) | (_PRELIMINARY if preliminary else 0)))
    stream.write(message)
    stream.flush()


def _receive(stream: IO[bytes]) -> bytes:
    (size,) = struct.unpack("<Q", _exactly(stream, 8))
    return _exactly(stream, size)


def _exactly(stream: IO[bytes], size: int) -> bytes:
    data = stream.read(size)
    if len(data) < size:
        raise EOFError
    return data


class _Receiver:
    """A message that arrives in pieces, and the preliminary one before it."""

    def __init__(self, stream: IO[bytes] | None) -> None:
        assert stream is not None
        self._descriptor = stream.fileno()
        self._data = bytearray()
        self._size: int | None = None
        self.preliminary: bytes | None = None

    def poll(self, seconds: float) -> bytes | None:
        """Wait for at most this time; return the message when it is complete."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._descriptor, selectors.EVENT_READ)
            if not selector.select(seconds):
                return None
        piece = os.read(self._descriptor, 1 << 20)
        if not piece:
            raise EOFError
        self._data += piece
        while True:
            if self._size is None and len(self._data) >= 8:
                (self._size,) = struct.unpack("<Q", self._data[:8])
                del self._data[:8]
            if self._size is None or len(self._data) < self._size & ~_PRELIMINARY:
                return None
            size = self._size & ~_PRELIMINARY
            message = bytes(self._data[:size])
            if self._size == size:
                return message
            self.preliminary = message
            del self._data[:size]
            self._size = None
