"""Progress on standard error: a bar only where that is a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from ..benchmark.plan import Plan, PlannedRun
    from ..benchmark.store.outcomes import Outcome

__all__ = ["import_progress", "run_progress"]


@contextmanager
def run_progress(
    plan: Plan, console: Console, *, verbose: bool = False
) -> Iterator[Callable[[PlannedRun, Outcome], None] | None]:
    """Yield a callback for finished runs: a bar and failures on a terminal, with `verbose` a line for each run."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    total = plan.counts()["detect"]
    if not console.is_terminal or console.quiet or not total:
        yield _line_writer(console) if verbose and not console.quiet else None
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task("running", total=total)

        def report(run: PlannedRun, outcome: Outcome) -> None:
            where = f"{run.identity.label} on {run.identity.scene.name}"
            progress.update(bar, advance=1, description=where[:50])
            if outcome.status == "failed":
                progress.console.print(f"failed {where}: {outcome.reason}", markup=False)
            elif verbose:
                progress.console.print(_line(run, outcome), markup=False)

        yield report


def _line_writer(console: Console) -> Callable[[PlannedRun, Outcome], None]:
    return lambda run, outcome: console.print(_line(run, outcome), markup=False, soft_wrap=True)


def _line(run: PlannedRun, outcome: Outcome) -> str:
    """Return a finished run in one line."""
    reason = f": {outcome.reason}" if outcome.reason else ""
    return f"{outcome.status} {run.identity.label} on {run.identity.scene.name}, seed {run.identity.seed}{reason}"


@contextmanager
def import_progress() -> Iterator[tuple[Callable[[str], None], Callable[[int, int], None] | None]]:
    """Yield a function that prints a note and one that moves the bar, or None without a terminal."""
    if not sys.stderr.isatty():
        yield (lambda sentence: typer.echo(f"- {sentence}", err=True)), None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task: Any = None

        def move(done: int, total: int) -> None:
            nonlocal task
            if task is None:
                task = bar.add_task("reading points", total=total)
            bar.update(task, completed=done, visible=done < total)

        yield (lambda sentence: bar.console.print(f"- {sentence}", markup=False, highlight=False, soft_wrap=True)), move
