"""The command ``roofbench``: its commands, exit codes and how errors are reported.

Exit codes: 0 good; 1 regression; 2 usage or bad input; 3 some runs failed; 4 nothing measured or not comparable.
Data goes to standard output, messages and progress to standard error. Commands are imported when they are called
(`lazy_group`), and import what they need when they run, so that none waits for libraries that it does not use.
"""

from __future__ import annotations

import gc
import io
import os
import sys
from typing import Annotated

import typer

from ..core.errors import RoofbenchError
from .console import print_result, printable, say
from .lazy_group import LazyGroup

__all__ = ["app", "main"]

#: Exit code after Ctrl-C, as shells have it: 128 and the number of the signal.
_INTERRUPTED = 130

app = typer.Typer(
    name="roofbench",
    cls=LazyGroup,
    help="Evaluation-first benchmark for building detection from airborne LiDAR and orthoimagery.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    # Plain help: markup would swallow the brackets of name[parameter=value].
    rich_markup_mode=None,
    # Inherited by every command.
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(asked: bool) -> None:
    if asked:
        from ..core.package import VERSION

        print_result(f"roofbench {VERSION}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command line; errors of roofbench and of the file system end with one sentence and exit code 2."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        # File names that are not UTF-8, and terminals that have few letters: what cannot be shown is escaped.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        try:
            app(prog_name="roofbench")
        finally:
            # Searching all objects for cycles at the exit of the process would take a fifth of a small comparison.
            gc.freeze()
            if sys.stdout is not None and not sys.stdout.closed:
                sys.stdout.flush()
    except RoofbenchError as error:
        _print_error(str(error))
        sys.exit(2)
    except SystemExit as leaving:
        if leaving.code == _INTERRUPTED:
            say("Stopped: no partial file is left; 'roofbench run --resume' continues a run")
        raise
    except BrokenPipeError:
        # The reader of a pipe (head, less) has gone: not an error.
        _close_stdout()
        sys.exit(0)
    except OSError as error:
        _print_error(f"{error.filename or 'the output'}: {error.strerror or error}")
        _close_stdout()
        sys.exit(2)
    except MemoryError as error:
        _print_error(f"out of memory: {error or 'a file is too large for this machine'}")
        sys.exit(2)
    except Exception as error:
        import sqlite3  # here, since evaluate has no store

        if not isinstance(error, sqlite3.Error):
            raise
        _print_error(f"the results store cannot be written or read: {error}")
        sys.exit(2)


def _print_error(sentence: str) -> None:
    typer.secho(f"Error: {printable(sentence)}", err=True, fg=typer.colors.RED if sys.stderr.isatty() else None)


def _close_stdout() -> None:
    """Keep Python from flushing into a pipe that is closed or a disk that is full."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
