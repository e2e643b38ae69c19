"""Run ``roofbench ARGUMENTS`` in a process of its own, with limits, some hundred times a minute.

A server imports roofbench once and forks for every call. A call that crashes, hangs or takes too much memory ends alone
and is reported: with its exit code or signal, both streams, its duration and its peak memory.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Outcome", "Sandbox"]

#: A call that takes more processor time hangs, s; so does one that waits as long, whatever for. One that takes more
#: memory is not bounded, bytes.
MOST_SECONDS = 10.0
MOST_MEMORY = 6 << 30


@dataclass(frozen=True)
class Outcome:
    """How a call ended: `code` is negative for a signal; `hung` when it was stopped for its time."""

    code: int
    hung: bool
    stdout: str
    stderr: str
    seconds: float
    peak_memory: int


class Sandbox:
    """A server process and the folder of its calls."""

    def __init__(self) -> None:
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "NUMBA_NUM_THREADS": "1"}
        self._server = subprocess.Popen(
            [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )

    def run(self, *arguments: object, folder: Path, plain: bool = False, seconds: float = MOST_SECONDS) -> Outcome:
        """Run a call; if `plain`, permissions bind even root. After `seconds` it counts as hung."""
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        request = {"arguments": [str(argument) for argument in arguments], "folder": str(folder)}
        request |= {"plain": plain, "seconds": seconds}
        self._server.stdin.write(json.dumps(request) + "\n")
        self._server.stdin.flush()
        return Outcome(**json.loads(self._server.stdout.readline()))

    def close(self) -> None:
        assert self._server.stdin is not None
        assert self._server.stdout is not None
        self._server.stdin.close()
        self._server.wait(timeout=30)
        self._server.stdout.close()


def _call(arguments: list[str], streams: list[int], plain: bool) -> None:
    """Become a process that runs the command line; never returns."""
    import gc
    import resource
    import traceback

    from roofbench.cli.main import main

    code = 70
    try:
        os.setpgid(0, 0)
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
        if plain:
            _obey_permissions()
        for number, stream in enumerate(streams, start=1):
            os.dup2(stream, number)
        sys.stdout, sys.stderr = (os.fdopen(os.dup(number), "w", errors="backslashreplace") for number in (1, 2))
        sys.argv = ["roofbench", *arguments]
        try:
            main()
            code = 0
        except SystemExit as leaving:
            code = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
        gc.collect()  # closes what the end of the interpreter would close
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            try:
                stream.flush()
            except (OSError, ValueError):
                code = code or 70
        os._exit(code)


def _obey_permissions() -> None:
    """Give up what lets root read and write everything (capabilities 1 and 2 of Linux); raise OSError if impossible."""
    import ctypes

    library = ctypes.CDLL(None, use_errno=True)
    header = (ctypes.c_uint32 * 2)(0x20080522, 0)  # version 3, this process
    sets = (ctypes.c_uint32 * 6)()  # effective, permitted, inheritable; twice 32 bits
    if library.capget(header, sets):
        raise OSError(ctypes.get_errno(), "capget")
    for place in range(3):
        sets[place] &= ~0b110
    if library.capset(header, sets):
        raise OSError(ctypes.get_errno(), "capset")


class _Watch:
    """Whether a process has hung: by its processor time, or by the time that it neither ran nor waited to run.

    Time by the clock would count what other processes of a busy machine take.
    """

    def __init__(self, process: int, seconds: float) -> None:
        self._path, self._seconds = f"/proc/{process}/stat", seconds
        self._last = time.monotonic()
        self._idle = 0.0

    def hung(self) -> bool:
        now, last = time.monotonic(), self._last
        self._last = now
        try:
            with open(self._path) as stream:
                facts = stream.read().rpartition(")")[2].split()
        except OSError:
            return False
        if facts[0] != "R":
            self._idle += now - last
        used = sum(map(int, facts[11:15])) / os.sysconf("SC_CLK_TCK")
        return used > self._seconds or self._idle - used > self._seconds


def _serve() -> None:
    import signal
    import tempfile
    import warnings

    import geopandas  # noqa: F401
    import laspy  # noqa: F401
    import pyarrow  # noqa: F401
    import pyogrio  # noqa: F401
    import rasterio  # noqa: F401
    import scipy.ndimage  # noqa: F401

    import roofbench

    for name in roofbench.__all__:
        getattr(roofbench, name)
    warnings.filterwarnings("ignore", message=".*multi-threaded.*fork", category=DeprecationWarning)
    for line in sys.stdin:
        request = json.loads(line)
        with tempfile.TemporaryFile() as stdout, tempfile.TemporaryFile() as stderr:
            os.chdir(request["folder"])
            start = time.monotonic()
            child = os.fork()
            if not child:
                _call(request["arguments"], [stdout.fileno(), stderr.fileno()], request["plain"])
            hung, watch = False, _Watch(child, request["seconds"])
            while True:
                ended, status, usage = os.wait4(child, os.WNOHANG)
                if ended:
                    break
                if not hung and watch.hung():
                    hung = True
                    os.kill(child, signal.SIGKILL)
                time.sleep(0.005)
            seconds = time.monotonic() - start
            texts = []
            for stream in (stdout, stderr):
                stream.seek(0)
                texts.append(stream.read().decode(errors="backslashreplace"))
        code = os.waitstatus_to_exitcode(status)
        memory = usage.ru_maxrss * 1024
        outcome = Outcome(code, hung, texts[0], texts[1], seconds, memory)
        print(json.dumps(outcome.__dict__), flush=True)


if __name__ == "__main__":
    _serve()
