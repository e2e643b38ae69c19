"""``roofbench run``: scenes x detectors, leaderboard on the terminal and in files."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..core.errors import ParameterError
from .options import (
    DetectorOption,
    DetectorSeedsOption,
    EvaluatorOption,
    RunOptions,
    ScenesOption,
    SeedsOption,
    WordsArgument,
    messages,
    suite_from_words,
    table_console,
    with_run_options,
)
from .progress import run_progress

if TYPE_CHECKING:
    from ..benchmark.plan import Plan
    from ..reports.tables import Leaderboard


@with_run_options
def run(
    words: WordsArgument = None,
    detector: DetectorOption = None,
    evaluator: EvaluatorOption = None,
    scenes: ScenesOption = None,
    seeds: SeedsOption = None,
    detector_seeds: DetectorSeedsOption = 1,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Folder for report.html, leaderboard.csv and leaderboard.md.")
    ] = None,
    rank_by: Annotated[str | None, typer.Option(help="Index that ranks, for instance pixel.quality.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="List what would run and why the rest would not.")] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with what this store was last asked for.")] = False,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Run only what failed before.")] = False,
    overwrite: Annotated[
        Literal["missing", "never", "always"],
        typer.Option(help="missing: all without a good result; never: not even failures again; always: everything."),
    ] = "missing",
    *,
    options: RunOptions,
) -> None:
    """Run detectors on scenes and print the leaderboard; what the store holds already is not run again.

    Exit code 3 when runs failed, 4 when nothing could be measured.
    """
    from ..benchmark.analysis.leaderboard import incidents_of, make_leaderboard, rank_index
    from ..benchmark.analysis.report_contents import fill_report
    from ..benchmark.execution.runner import run_plan
    from ..benchmark.plan import make_plan, plan_content, suite_from_content
    from ..benchmark.store.writer import Store
    from ..reports.tables import print_incidents
    from .report import write_report

    execution = options.execution()
    if resume and words:
        raise ParameterError("--resume goes on with what the store was asked for: leave out the suite and scenes")
    told = messages(options.quiet)
    with Store(options.store, must_exist=resume) as opened:
        suite = (
            suite_from_content(opened.last_plan())
            if resume
            else suite_from_words(words, detector, evaluator, seeds=detector_seeds)
        )
        if seeds is not None:
            suite = suite.with_seeds(seeds)
        if scenes is not None:
            suite = suite.with_scenes(scenes)
        rank_index(suite.evaluators[0], rank_by)
        if output is not None and not dry_run:
            _make_folder(output)
        plan = make_plan(suite, opened, overwrite=overwrite, only_failed=retry_failed)
        if dry_run:
            _print_plan(plan)
            return
        opened.save_plan(suite.name, shlex.join(["roofbench", *sys.argv[1:]]), plan_content(suite))
        with run_progress(plan, told) as report:
            result = run_plan(plan, opened, execution=execution, overwrite=overwrite, progress=report)
        boards = [
            make_leaderboard(result.rows, opened, judge, title=f"Suite {suite.name}", rank_by=rank_by)
            for judge in plan.judges
        ]
        known = len(result.rows) - result.done
        told.print(
            f"{result.done} runs done, {known} stored before, {len(result.failed)} failed; store {options.store}"
        )
        # Files before the table: who reads it may close the pipe (head).
        if output is not None:
            _write(output, boards)
            if any(entry.scenes for board in boards for entry in board.entries):
                judged = list(zip(plan.judges, boards, strict=True))
                filled = fill_report(opened, result.rows, title=f"Suite {suite.name}", judged=judged)
                write_report(filled, output / "report.html", overwrite=True)
        for number, board in enumerate(boards):
            if number:
                typer.echo()
            board.print(table_console())
        print_incidents(incidents_of(result.rows), told)
        if result.failed:
            raise typer.Exit(3)
        if not any(entry.scenes for board in boards for entry in board.entries):
            raise typer.Exit(4)


def _print_plan(plan: Plan) -> None:
    words = {"detect": "run", "evaluate": "evaluate", "nothing": "stored"}
    for run in plan.runs:
        identity = run.identity
        typer.echo(f"{words[run.todo]:9}{identity.label}  {identity.scene.name}  seed {identity.seed}: {run.why}")
    counts = plan.counts()
    typer.echo(
        f"{len(plan.runs)} runs: {counts['detect']} to run, {counts['evaluate']} to evaluate, "
        f"{counts['nothing']} left as stored"
    )


def _make_folder(folder: Path) -> None:
    """Make the folder for results before the long work, or say why it cannot be."""
    from ..core.errors import OutputError
    from ..core.output import check_target

    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "it is a file" if folder.is_file() else error.strerror
        raise OutputError(f"{folder} cannot be made: {reason}; name another folder with -o") from error
    check_target(folder / "report.html", overwrite=True)


def _write(folder: Path, boards: list[Leaderboard]) -> None:
    """Write one CSV and one Markdown file; a further evaluator gets files of its own name."""
    from ..core.output import whole_file

    for number, board in enumerate(boards):
        name = "leaderboard" if number == 0 else f"leaderboard-{board.evaluator.partition(' ')[0]}"
        for ending, text in (("csv", board.to_csv()), ("md", board.to_markdown())):
            with whole_file(folder / f"{name}.{ending}", overwrite=True) as scratch:
                scratch.write_text(text, encoding="utf-8")
