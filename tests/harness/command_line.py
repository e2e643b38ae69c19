"""The command line, called in this process: what a person types, and what comes back."""

import contextlib
import io
import sys
from dataclasses import dataclass
from unittest import mock

from roofbench.cli.main import main


@dataclass(frozen=True)
class Answer:
    """Standard output, standard error and exit code."""

    stdout: str
    stderr: str
    code: int


def run(*arguments):
    """Return (exit code, standard output, standard error) of ``roofbench ARGUMENTS``."""
    stdout, stderr = io.StringIO(), io.StringIO()
    code = 0
    with (
        contextlib.redirect_stdout(stdout),
        contextlib.redirect_stderr(stderr),
        mock.patch.object(sys, "argv", ["roofbench", *map(str, arguments)]),
    ):
        try:
            main()
        except SystemExit as stop:
            code = stop.code or 0
    return code, stdout.getvalue(), stderr.getvalue()


def roofbench(*arguments, folder, expect=0):
    """Run ``roofbench ARGUMENTS`` in a folder and check its exit code."""
    with contextlib.chdir(folder):
        code, stdout, stderr = run(*arguments)
    assert code == expect, f"exit code {code}\n{stdout}\n{stderr}"
    return Answer(stdout, stderr, code)
