"""Where the commands print: tables to standard output, messages and progress to standard error."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["messages", "print_next", "print_result", "printable", "say", "table_console"]


def printable(text: str) -> str:
    """Return text without control characters other than line ends: in names, they could change the terminal."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else " " for c in text)


def say(text: str) -> None:
    """Print a message to standard error."""
    typer.echo(printable(text), err=True)


def print_result(text: str | os.PathLike[str], *, nl: bool = True, err: bool = False) -> None:
    """Print to standard output; to a terminal without control characters, elsewhere as it is."""
    shown = os.fspath(text)
    if (sys.stderr if err else sys.stdout).isatty():
        shown = printable(shown)
    typer.echo(shown, nl=nl, err=err)


def print_next(console: Console, command: str) -> None:
    """Print the command that usually follows."""
    console.print(f"next: {command}", markup=False, soft_wrap=True)


def messages(quiet: bool = False) -> Console:
    """Return the console for messages and progress: standard error, plain when it is no terminal."""
    return _console(stderr=True, quiet=quiet)


def table_console() -> Console:
    """Return the console for tables: standard output, wide where neither a terminal nor COLUMNS sets its width."""
    known = sys.stdout.isatty() or "COLUMNS" in os.environ
    return _console(width=None if known else 160)


def _console(**options: Any) -> Console:
    from rich.console import Console
    from rich.text import Text

    def cleaned(item: Any) -> Any:
        if isinstance(item, Text):
            item.plain = printable(item.plain)
        return printable(item) if isinstance(item, str) else item

    class Printable(Console):
        def print(self, *objects: Any, **more: Any) -> None:
            super().print(*map(cleaned, objects), **more)

    return Printable(highlight=False, **options)
