"""Programs: an executable of any language, run without a shell and watched until it ends.

A program starts in a folder of its own with nothing on standard input. What it writes to standard output and standard
error goes to a log. When it ends or exceeds a limit, all processes that it started are killed: its descendants, its
session, and processes in sessions of their own (daemons), which are known by a variable of their environment.
"""

from __future__ import annotations

import os
import re
import secrets
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from .errors import ProgramError
from .memory import bound_allocations, count_program_memory, tree_memory
from .processes import Limits, clean_environment, end_marked, end_tree, memory_reason, time_reason

__all__ = ["ProgramEnd", "log_tail", "run_program", "telling_line"]

#: Variable that a program and all that it starts have in their environment, with a random value.
_MARK = "ROOFBENCH_PROGRAM"
_LONGEST_PAUSE = 0.05  # seconds between two checks
_TAIL = 4000  # bytes of a log that are kept
#: How errors begin: of R, node, Java, Python and GDAL.
_ERROR = re.compile(r"(?:[\w.]*(?:Error|Exception)|ERROR|FAILURE|error)\b")


@dataclass(frozen=True)
class ProgramEnd:
    """How a program ended by itself.

    Attributes
    ----------
    code : int
        Exit code; negative: the signal that killed it.
    log : str
        End of what it wrote to standard output and standard error.
    peak_memory : int
        Highest resident memory seen, bytes.
    """

    code: int
    log: str
    peak_memory: int


def run_program(
    command: Sequence[str],
    *,
    folder: Path,
    log: Path,
    limits: Limits,
    largest: Mapping[Path, int] | None = None,
    environment: Mapping[str, str] | None = None,
) -> ProgramEnd:
    """Run a program until it ends.

    Parameters
    ----------
    command : sequence of str
        Executable and arguments.
    folder : Path
        Working folder.
    log : Path
        File for what it prints.
    limits : Limits
    largest : mapping of Path to int, optional
        Files that the program writes, with the bytes that each may have.
    environment : mapping, optional
        Variables beside those of `clean_environment`.

    Raises
    ------
    ProgramError
        It cannot be started, or it exceeded a limit and was killed.
    """
    name, mark = Path(command[0]).name, secrets.token_hex(16)
    started = time.monotonic()
    with log.open("wb") as stream:
        try:
            process = subprocess.Popen(  # noqa: S603 - without a shell; running it is what the user asks for
                list(command),
                cwd=folder,
                env=clean_environment({**(environment or {}), _MARK: mark}),
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # so that it can be killed with everything that it started
            )
        except OSError as error:
            raise ProgramError(f"{name} cannot be started: {_start_problem(error)}") from error
    peak, pause, problem = 0, 0.002, ""
    try:
        if limits.memory is not None:
            bound_allocations(process.pid, limits.memory)
        while not problem:
            peak = max(peak, tree_memory(process.pid))
            problem = _exceeded(limits, time.monotonic() - started, peak) or _too_large(largest or {})
            with suppress(subprocess.TimeoutExpired):
                if not problem:
                    process.wait(timeout=pause)
                    problem = _too_large(largest or {})
                    break
            pause = min(1.5 * pause, _LONGEST_PAUSE)
    finally:
        end_tree(process.pid)
        with suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)  # what it left behind in its session
        end_marked(_MARK, mark)
        process.wait()
        count_program_memory(peak)
    if problem:
        raise ProgramError(f"{name}: {problem}", log=log_tail(log))
    return ProgramEnd(process.returncode, log_tail(log), peak)


def log_tail(log: Path) -> str:
    """Return the end of a log as text; empty where the program removed it."""
    with suppress(FileNotFoundError), log.open("rb") as stream:
        stream.seek(0, os.SEEK_END)
        stream.seek(max(0, stream.tell() - _TAIL))
        return stream.read().decode(errors="replace").strip()
    return ""


def telling_line(log: str) -> str:
    r"""Return the line that says why a program failed: the last that begins as an error, else the last one.

    Interpreters end with something else: R with "Execution halted", node with its version.

    >>> telling_line("Error: no package 'sf'\nExecution halted")
    "Error: no package 'sf'"
    """
    lines = [" ".join(line.split()) for line in log.splitlines() if line.strip()]
    for number in reversed(range(len(lines))):
        if _ERROR.match(lines[number]):
            more = 2 if lines[number].endswith(":") else 1
            return " ".join(lines[number : number + more])
    return lines[-1] if lines else ""


def _exceeded(limits: Limits, seconds: float, peak: int) -> str:
    if limits.seconds is not None and seconds > limits.seconds:
        return time_reason(limits.seconds)
    if limits.memory is not None and peak > limits.memory:
        return memory_reason(peak, limits.memory)
    return ""


def _too_large(largest: Mapping[Path, int]) -> str:
    for path, most in largest.items():
        with suppress(OSError):
            if path.stat().st_size > most:
                return f"{path.name} is larger than {most / 1e6:.0f} MB"
    return ""


def _start_problem(error: OSError) -> str:
    if isinstance(error, FileNotFoundError):
        return "there is no such program, or the interpreter in its first line is missing"
    if isinstance(error, PermissionError):
        return "it is not executable: set the permission with chmod +x"
    if "format" in str(error).lower():
        return "it is not a program: a script needs a first line such as #!/bin/sh"
    return str(error.strerror)
