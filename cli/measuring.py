"""Running a suite for the gate, with progress and failures on the screen."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .progress import run_progress

if TYPE_CHECKING:
    from rich.console import Console

    from ..benchmark.analysis.baseline import Baseline
    from ..benchmark.suite import Suite
    from .command import RunOptions

__all__ = ["measure_suite"]


def measure_suite(suite: Suite, options: RunOptions, console: Console) -> tuple[Baseline, int]:
    """Run a suite; return its scores, and how many runs failed."""
    from ..benchmark.analysis.baseline import measure
    from ..benchmark.analysis.leaderboard import unsuccessful_runs
    from ..benchmark.execution.runner import run_plan
    from ..benchmark.identity.provenance import code_version
    from ..benchmark.plan import make_plan
    from ..benchmark.store.writer import Store
    from ..reports.leaderboard_text import print_unsuccessful

    execution = options.execution()
    with Store(options.store) as opened:
        plan = make_plan(suite, opened)
        with run_progress(plan, console, verbose=options.verbose) as report:
            result = run_plan(plan, opened, execution=execution, progress=report)
        print_unsuccessful(unsuccessful_runs(result.rows), console)
        measured = measure(suite, result.rows, opened, plan.evaluators[0], code_version())
    return measured, len(result.failed)
