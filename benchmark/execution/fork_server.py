"""The fork server: a process that has imported what detectors need, and forks a detector process when it is asked to.

A worker imports what detectors and evaluators need, and forks its fork server before it reads its first task. So the
fork server and the processes that it forks have these modules, and never held a scene, a reference or a task. A process
that it forks is fresh: no code of a plugin runs in the fork server.

Forking is used on Linux alone. On macOS system libraries that are loaded may have threads, which a fork does not
survive; Windows cannot fork. There a detector process is a new interpreter (`detector_process`).
"""

from __future__ import annotations

import importlib
import json
import os
import select
import socket
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from ...core.processes import end_children, end_tree

__all__ = ["CAN_FORK", "ForkServer", "ForkedProcess"]

CAN_FORK = sys.platform == "linux"
#: Large modules that detectors import when they first need them, and numba when it loads a kernel.
_MODULES = ("cv2", "numba.np.arraymath", "rasterio.features", "scipy.linalg", "scipy.ndimage")
_LONGEST = 1 << 16  # bytes of a request
_PATIENCE = 5.0  # seconds for a process that closed its streams to end
_LOOK_EVERY = 0.01  # seconds between two looks at a process that ends


class ForkServer:
    """The fork server as its worker sees it.

    Parameters
    ----------
    main : callable
        What a forked process runs; its standard input and output are pipes of the worker.
    """

    def __init__(self, main: Callable[[], None]) -> None:
        for name in _MODULES:
            importlib.import_module(name)
        self._control, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._pid = os.fork()
        if self._pid == 0:
            self._control.close()
            _serve(other, main)
        other.close()

    def fork(self, folder: str) -> ForkedProcess:
        """Return a new process that works in a folder.

        Raises
        ------
        OSError, EOFError
            The fork server has ended.
        """
        read_inward, write_inward = os.pipe()
        read_outward, write_outward = os.pipe()
        try:
            pid = self._ask({"folder": folder}, [read_inward, write_outward])["pid"]
        except BaseException:
            os.close(write_inward)
            os.close(read_outward)
            raise
        finally:
            os.close(read_inward)
            os.close(write_outward)
        return ForkedProcess(self, pid, write_inward, read_outward)

    def ended(self, pid: int) -> tuple[int | None, int]:
        """Return the exit code and the highest memory, bytes, of a process; None where it does not end."""
        with suppress(OSError, EOFError):
            answer = self._ask({"pid": pid}, [])
            return answer["code"], answer["peak"]
        return None, 0

    def close(self) -> None:
        """Let the fork server end its processes and itself, and wait for it; any thread may call this."""
        with suppress(OSError):
            self._control.shutdown(socket.SHUT_RDWR)
        deadline = time.monotonic() + _PATIENCE
        with suppress(ChildProcessError):
            while not os.waitpid(self._pid, os.WNOHANG)[0] and time.monotonic() < deadline:
                time.sleep(_LOOK_EVERY)

    def _ask(self, request: dict[str, Any], descriptors: list[int]) -> dict[str, Any]:
        socket.send_fds(self._control, [json.dumps(request).encode()], descriptors)
        answer = self._control.recv(_LONGEST)
        if not answer:
            raise EOFError
        return dict(json.loads(answer))


class ForkedProcess:
    """A process that the fork server forked.

    Attributes
    ----------
    pid : int
    stdin, stdout : file
        Ends of the pipes to it and from it.
    """

    def __init__(self, server: ForkServer, pid: int, inward: int, outward: int) -> None:
        self._server = server
        self.pid = pid
        self.stdin, self.stdout = os.fdopen(inward, "wb"), os.fdopen(outward, "rb")

    def ended(self) -> tuple[int | None, int]:
        """Return the exit code of a process that closed its streams and its highest memory; None while it runs."""
        return self._server.ended(self.pid)

    def end(self) -> None:
        """Kill it with the programs that it runs, and wait for it."""
        end_tree(self.pid)
        self._server.ended(self.pid)


def _serve(control: socket.socket, main: Callable[[], None]) -> None:
    """Answer the requests of the worker until it closes the connection; does not return."""
    _without_tasks()
    while True:
        try:
            message, descriptors, _, _ = socket.recv_fds(control, _LONGEST, 2)
            if not message:
                break
            request = json.loads(message)
            answer = _wait(control, request["pid"]) if "pid" in request else _fork(main, request["folder"], descriptors)
            control.send(json.dumps(answer).encode())
        except OSError:  # the worker has ended
            break
    end_children()
    os._exit(0)


def _without_tasks() -> None:
    """Let go of the streams of the worker, through which tasks and outcomes go."""
    nothing = os.open(os.devnull, os.O_RDWR)
    os.dup2(nothing, 0)
    os.dup2(nothing, 1)
    os.close(nothing)


def _fork(main: Callable[[], None], folder: str, descriptors: list[int]) -> dict[str, Any]:
    pid = os.fork()
    if pid == 0:
        _run(main, folder, *descriptors)
    for descriptor in descriptors:
        os.close(descriptor)
    return {"pid": pid}


def _run(main: Callable[[], None], folder: str, inward: int, outward: int) -> None:
    """Run the main function of a forked process; does not return."""
    code: Any = 1
    try:
        os.dup2(inward, 0)
        os.dup2(outward, 1)
        _close_inherited()
        os.chdir(folder)
        np.random.seed()  # noqa: NPY002 - a fork has the state of its parent; that of `random` is renewed by Python
        main()
    except SystemExit as leaving:
        code = 0 if leaving.code is None else leaving.code
    except BaseException:
        traceback.print_exc()
    finally:
        with suppress(Exception):
            sys.stderr.flush()
        os._exit(code if isinstance(code, int) else 1)


def _close_inherited() -> None:
    """Close all but the standard streams. Up to a thousand million may be allowed, so only the open ones are closed."""
    for name in os.listdir("/proc/self/fd"):
        with suppress(OSError):
            if int(name) > 2:
                os.close(int(name))


def _wait(control: socket.socket, pid: int) -> dict[str, Any]:
    """Return how a process ended; also when it does not end in time, or when the worker ends meanwhile."""
    deadline = time.monotonic() + _PATIENCE
    with suppress(ChildProcessError):
        while time.monotonic() < deadline:
            number, status, usage = os.wait4(pid, os.WNOHANG)
            if number:
                return {"code": os.waitstatus_to_exitcode(status), "peak": usage.ru_maxrss * 1024}
            if select.select([control], [], [], _LOOK_EVERY)[0]:
                break
    return {"code": None, "peak": 0}
