"""``roofbench run``: scenes x detectors, leaderboard on the terminal and in files."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated, Literal

import typer

from ..core.errors import ParameterError
from ..core.wording import counted
from .command import RunOptions, with_run_options
from .console import messages, print_next, print_result, table_console
from .options import (
    DEFAULT_STORE,
    DetectorOption,
    DetectorSeedsOption,
    EvaluatorsOption,
    FormatOption,
    IndexOption,
    OverwriteOption,
    ScenesOption,
    SeedsOption,
    WideOption,
    WordsArgument,
)
from .progress import run_progress

__all__ = ["run"]


@with_run_options
def run(
    words: WordsArgument = None,
    detector: DetectorOption = None,
    evaluator: EvaluatorsOption = None,
    scenes: ScenesOption = None,
    seeds: SeedsOption = None,
    detector_seeds: DetectorSeedsOption = 1,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FOLDER", help="Folder for report.html, leaderboard.csv and leaderboard.md."
        ),
    ] = None,
    no_report: Annotated[
        bool, typer.Option("--no-report", help="Do not write report.html (into FOLDER, else beside the store).")
    ] = False,
    overwrite: OverwriteOption = False,
    index: IndexOption = None,
    form: FormatOption = "table",
    wide: WideOption = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="List what would run, and why the rest would not, and stop.")
    ] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the last run of this store.")] = False,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Run only what failed before.")] = False,
    rerun: Annotated[
        Literal["missing", "never", "always"],
        typer.Option(
            "--rerun",
            help="missing: what has no good result; never: only what is not stored at all; always: everything.",
        ),
    ] = "missing",
    *,
    options: RunOptions,
) -> None:
    """Run detectors on scenes and print the leaderboard; stored results are reused.

    Exit code 3 when runs failed, 4 when nothing could be measured.
    """
    from ..benchmark.analysis.leaderboard import make_leaderboard, unsuccessful_runs
    from ..benchmark.execution.runner import run_plan
    from ..benchmark.plan import make_plan, plan_content, suite_from_content
    from ..benchmark.store.writer import Store
    from ..benchmark.suite import suite_of_words
    from ..core.output import make_folder_for
    from ..reports.html_report import write_run_report
    from ..reports.leaderboard_text import print_unsuccessful, show_leaderboards, write_leaderboards
    from ..reports.plan_text import format_plan

    execution = options.execution()
    if resume and words:
        raise ParameterError("resume=True continues the last run of the store: leave out the suite and scenes")
    console = messages(options.quiet)
    # Read before the store is made: a suite with an error leaves no file behind.
    asked = None if resume else suite_of_words(words, detector, evaluator, seeds=detector_seeds)
    with Store(options.store, must_exist=resume) as opened:
        suite = asked or suite_from_content(opened.last_plan())
        if seeds is not None:
            suite = suite.with_seeds(seeds)
        if scenes is not None:
            suite = suite.with_scenes(scenes)
        suite.evaluators[0].ranking_index(index)
        if output is not None and not dry_run:
            make_folder_for(("report.html", "leaderboard.csv", "leaderboard.md"), output, overwrite=overwrite)
        plan = make_plan(suite, opened, rerun=rerun, only_failed=retry_failed)
        for warning in plan.warnings:
            console.print(f"Warning: {warning}", markup=False)
        if dry_run:
            print_result(format_plan(plan, form))
            return
        opened.save_plan(suite.name, shlex.join(["roofbench", *sys.argv[1:]]), plan_content(suite))
        with run_progress(plan, console, verbose=options.verbose) as report:
            result = run_plan(plan, opened, execution=execution, progress=report)
        boards = [
            make_leaderboard(result.rows, opened, keyed, title=f"Suite {suite.name}", rank_by=index)
            for keyed in plan.evaluators
        ]
        known = len(result.rows) - result.done
        console.print(f"{counted(result.done, 'run')} done, {known} stored before, {len(result.failed)} failed")
        if plan.left_out:
            absent = counted(len(plan.left_out), "run of the suite is", "runs of the suite are")
            console.print(f"{absent} not stored and left out: run without --retry-failed to include them")
        # Files first: the reader of the table may close the pipe (head).
        written = [options.store]
        if output is not None:
            write_leaderboards(output, boards)
            written += [output / "leaderboard.csv", output / "leaderboard.md"]
        if not no_report and any(entry.scenes for board in boards for entry in board.entries):
            page = (output or options.store.parent) / "report.html"
            evaluated = list(zip(plan.evaluators, boards, strict=True))
            if write_run_report(page, opened, result.rows, suite=suite.name, evaluated=evaluated):
                written.append(page)
            else:
                console.print(
                    f"{page} is not a report of roofbench and was not replaced: name a folder by --output", markup=False
                )
        show_leaderboards(boards, form, table_console(), wide=wide)
        unevaluated = [run for board in boards for run in board.unsuccessful if run.status == "not evaluated"]
        print_unsuccessful([*unsuccessful_runs(result.rows), *unevaluated], console)
        console.print(f"written: {', '.join(map(str, written))}", markup=False, soft_wrap=True)
        again = "--resume --retry-failed" if result.failed else "--resume" if unevaluated else None
        print_next(console, _next_command(again, options, detector))
        if result.failed or unevaluated:
            raise typer.Exit(3)
        if not any(entry.scenes for board in boards for entry in board.entries):
            raise typer.Exit(4)


def _next_command(again: str | None, options: RunOptions, detectors: list[str] | None) -> str:
    """Return what usually follows: repeat what failed, write a detector, or save reference scores of one's own."""
    from ..detectors.registry import DETECTORS

    if again:
        words = ["roofbench", "run", *again.split()]
        if options.store != DEFAULT_STORE:
            words += ["--store", str(options.store)]
        return shlex.join(words)
    own = [one for one in detectors or () if not DETECTORS.is_builtin(one.partition("[")[0])]
    if own:
        return shlex.join(["roofbench", "baseline", "save", "-d", own[0], "-o", "baseline.json"])
    return "roofbench new detector my-detector"
