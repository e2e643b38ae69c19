"""The progress bar of commands that run detectors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from ..benchmark.execution.tasks import Outcome
    from ..benchmark.plan import Plan, PlannedRun

__all__ = ["run_progress"]


@contextmanager
def run_progress(plan: Plan, console: Console) -> Iterator[Callable[[PlannedRun, Outcome], None] | None]:
    """Yield what is told of each finished run: a bar and failures on a terminal, else None."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    total = plan.counts()["detect"]
    if not console.is_terminal or console.quiet or not total:
        yield None
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task("running", total=total)

        def report(run: PlannedRun, outcome: Outcome) -> None:
            where = f"{run.identity.label} on {run.identity.scene.name}"
            progress.update(bar, advance=1, description=where[:50])
            if outcome.status == "failed":
                progress.console.print(f"failed {where}: {outcome.reason}", markup=False)

        yield report
