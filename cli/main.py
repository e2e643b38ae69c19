"""The command ``roofbench``: its commands, exit codes and how errors are told.

Exit codes: 0 good; 1 regression; 2 usage or bad input; 3 some runs failed; 4 nothing measured or not comparable.
Data goes to standard output, messages and progress to standard error. Modules of the commands import what they need
when they run, so that ``roofbench evaluate`` does not wait for libraries that it does not use.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from ..core.errors import RoofbenchError
from . import detect, evaluate, gate, plot, report, run, runs, scenes, sweep

__all__ = ["app", "main"]

#: Exit code after Ctrl-C, as shells have it: 128 and the number of the signal.
_INTERRUPTED = 130

app = typer.Typer(
    name="roofbench",
    help="Evaluation-first benchmark for building detection from airborne LiDAR and orthoimagery.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    # Plain help: markup would swallow the brackets of name[parameter=value].
    rich_markup_mode=None,
)
app.command("evaluate")(evaluate.evaluate)
app.command("run")(run.run)
app.command("detect")(detect.detect)
app.command("sweep")(sweep.sweep)
app.add_typer(gate.baseline_app)
app.command("gate")(gate.gate)
app.command("report")(report.report)
app.add_typer(plot.app)
app.command("score")(runs.score)
app.command("ls")(runs.ls)
app.command("why")(runs.why)
app.command("export")(runs.export)
app.command("check-plugin")(detect.check_plugin)
app.add_typer(scenes.app)


def _version(asked: bool) -> None:
    if asked:
        from ..core.package import VERSION

        typer.echo(f"roofbench {VERSION}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command line; errors of roofbench and of the file system end with one sentence and exit code 2."""
    try:
        try:
            app(prog_name="roofbench")
        finally:
            if sys.stdout is not None and not sys.stdout.closed:
                sys.stdout.flush()
    except RoofbenchError as error:
        _tell(str(error))
        sys.exit(2)
    except SystemExit as leaving:
        if leaving.code == _INTERRUPTED:
            typer.echo("Stopped: no half-written file is left; 'roofbench run --resume' goes on with a run", err=True)
        raise
    except BrokenPipeError:
        # The reader of a pipe (head, less) has gone: not an error.
        _close_stdout()
        sys.exit(0)
    except OSError as error:
        _tell(f"{error.filename or 'the output'}: {error.strerror or error}")
        _close_stdout()
        sys.exit(2)
    except Exception as error:
        import sqlite3  # here, since evaluate has no store

        if not isinstance(error, sqlite3.Error):
            raise
        _tell(f"the results store cannot be written or read: {error}")
        sys.exit(2)


def _tell(sentence: str) -> None:
    typer.secho(f"Error: {sentence}", err=True, fg=typer.colors.RED if sys.stderr.isatty() else None)


def _close_stdout() -> None:
    """Keep Python from flushing into a pipe that is closed or a disk that is full."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
