"""Progress on standard error, only where that is a terminal: spinner, runs, elapsed time, and what is being compiled.

Workers compile kernels in processes of their own. What they compile is seen by the entries that appear in the cache of
kernels, one as soon as it is compiled.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

from ..reports.format import shortened
from .console import messages, say

if TYPE_CHECKING:
    from rich.console import Console

    from ..benchmark.plan import Plan, PlannedRun
    from ..benchmark.store.outcomes import Outcome

__all__ = ["import_progress", "run_progress"]

#: Columns that are left for the status on a terminal of 80, and seconds between two looks at the cache of kernels.
_STATUS, _LOOK_EVERY = 42, 0.5


@contextmanager
def run_progress(
    plan: Plan, console: Console, *, verbose: bool = False
) -> Iterator[Callable[[PlannedRun, Outcome], None] | None]:
    """Yield a callback for finished runs: a bar and failures on a terminal, with `verbose` a line for each run."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    total = plan.counts()["detect"]
    if not console.is_terminal or console.quiet or not total:
        yield _line_writer(console) if verbose and not console.quiet else None
        return
    columns = (
        SpinnerColumn(),
        BarColumn(bar_width=16),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}", markup=False),
    )
    with Progress(*columns, console=console, transient=True) as progress, ExitStack() as stack:
        bar = progress.add_task("starting workers", total=total)
        stack.enter_context(_compiling(lambda text: progress.update(bar, description=text), progress.console))

        def report(run: PlannedRun, outcome: Outcome) -> None:
            where = f"{run.identity.label} on {run.identity.scene.name}"
            progress.update(bar, advance=1, description=shortened(where, _STATUS))
            if outcome.status == "failed":
                progress.console.print(f"failed {where}: {outcome.reason}", markup=False)
            elif verbose:
                progress.console.print(_line(run, outcome), markup=False)

        yield report


@contextmanager
def _compiling(show: Callable[[str], None], console: Console) -> Iterator[None]:
    """Show the kernel that was compiled last, as long as this block runs."""
    from ..core.kernel_files import names
    from ..core.kernels import cache_folder

    folder, ended = cache_folder(), threading.Event()
    known = set(names(folder))

    def watch() -> None:
        count = 0
        while not ended.wait(_LOOK_EVERY):
            fresh = [name for name in names(folder) if name not in known]
            if not fresh:
                continue
            if not count:
                console.print(
                    f"compiling the detectors for this machine, once; later runs take them from {folder}",
                    markup=False,
                    soft_wrap=True,
                )
            known.update(fresh)
            count += len(fresh)
            kernel = fresh[-1].rpartition("-")[0].rpartition(".")[2]
            show(shortened(f"compiling {kernel} ({count} kernels)", _STATUS))

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def _line_writer(console: Console) -> Callable[[PlannedRun, Outcome], None]:
    return lambda run, outcome: console.print(_line(run, outcome), markup=False, soft_wrap=True)


def _line(run: PlannedRun, outcome: Outcome) -> str:
    """Return a finished run in one line."""
    reason = f": {outcome.reason}" if outcome.reason else ""
    return f"{outcome.status} {run.identity.label} on {run.identity.scene.name}, seed {run.identity.seed}{reason}"


@contextmanager
def import_progress(
    what: str = "reading points",
) -> Iterator[tuple[Callable[[str], None], Callable[[int, int], None] | None]]:
    """Yield a function that prints a note and one that moves the bar, or None without a terminal."""
    if not sys.stderr.isatty():
        yield (lambda sentence: say(f"- {sentence}")), None
        return
    from rich.progress import Progress

    with Progress(console=messages(), transient=True) as bar:
        task: Any = None

        def move(done: int, total: int) -> None:
            nonlocal task
            if task is None:
                task = bar.add_task(what, total=total or None)
            bar.update(task, completed=done, total=total or None, visible=done != total)

        yield (lambda sentence: bar.console.print(f"- {sentence}", markup=False, highlight=False, soft_wrap=True)), move
