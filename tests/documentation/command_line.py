"""The page of the command line: the help of every command, as ``--help`` prints it."""

from __future__ import annotations

import contextlib
import io
import os
from typing import Any
from unittest import mock

import typer

from roofbench.cli.main import app

__all__ = ["page"]

_WIDTH = 80


def _help(command: Any, names: tuple[str, ...], parent: Any) -> list[str]:
    context = command.make_context(names[-1], [], parent=parent, resilient_parsing=True)
    context.terminal_width = context.max_content_width = _WIDTH
    with contextlib.redirect_stdout(io.StringIO()):
        text = command.get_help(context)
    usage = " ".join(names)
    text = "\n".join(line.rstrip() for line in text.splitlines())
    parts = [f"{'##' if len(names) < 3 else '###'} {usage}", f"```text\n{text}\n```"]
    # By its methods: typer may bring click under a name of its own.
    if hasattr(command, "list_commands"):
        for name in command.list_commands(context):
            found = command.get_command(context, name)
            if found is not None and not found.hidden:
                parts += _help(found, (*names, name), context)
    return parts


def page() -> str:
    """Return the page in Markdown."""
    with mock.patch.dict(os.environ, {"COLUMNS": str(_WIDTH), "TERMINAL_WIDTH": str(_WIDTH)}):
        parts = _help(typer.main.get_command(app), ("roofbench",), None)
    return (
        "\n\n".join(
            [
                "# Command line",
                "<!-- Written by python -m tests.documentation.reference from the commands. -->",
                "The help of every command. Data goes to standard output, messages and progress to standard error. "
                "Exit codes: 0 good; 1 regression; 2 usage or bad input; 3 some runs failed; 4 nothing measured or not "
                "comparable; 130 interrupted.",
                *parts,
            ]
        )
        + "\n"
    )
