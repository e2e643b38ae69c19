"""Where the commands print: tables to standard output, messages and progress to standard error."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["messages", "table_console"]


def messages(quiet: bool = False) -> Console:
    """Return the console for messages and progress: standard error, plain when it is no terminal."""
    from rich.console import Console

    return Console(stderr=True, quiet=quiet, highlight=False)


def table_console() -> Console:
    """Return the console for tables: standard output, wide where neither a terminal nor COLUMNS sets its width."""
    from rich.console import Console

    known = sys.stdout.isatty() or "COLUMNS" in os.environ
    return Console(highlight=False, width=None if known else 160)
