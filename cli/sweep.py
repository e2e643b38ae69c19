"""``roofbench sweep``: quality along parameters of detectors and of synthetic scenes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..core.errors import ParameterError
from . import completion
from .command import RunOptions, with_run_options
from .console import messages, table_console
from .options import (
    DetectorSeedsOption,
    EvaluatorsOption,
    FormatOption,
    IndexOption,
    OverwriteOption,
    ScenesOption,
    SeedsOption,
    WordsArgument,
)
from .progress import run_progress

if TYPE_CHECKING:
    import pandas as pd

    from ..benchmark.analysis.sweep import Sweep
    from ..evaluators.base import Index

__all__ = ["sweep"]


@with_run_options
def sweep(
    detectors: Annotated[
        str,
        typer.Argument(
            metavar="DETECTOR", help="Detector, or several separated by commas.", autocompletion=completion.detectors
        ),
    ],
    words: WordsArgument = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="NAME=VALUES",
            help="VALUES: VALUE,VALUE,... or FROM:TO:STEP; scene.NAME varies the generator; repeat for more.",
        ),
    ] = None,
    grid: Annotated[bool, typer.Option("--grid", help="Vary all axes together, not one at a time.")] = False,
    scenes: ScenesOption = None,
    seeds: SeedsOption = None,
    detector_seeds: DetectorSeedsOption = 1,
    index: IndexOption = None,
    level: Annotated[
        float | None,
        typer.Option("--level", metavar="VALUE", help="Report where the index passes this value, such as 0.8."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Tidy table, .csv or .parquet.")
    ] = None,
    evaluator: EvaluatorsOption = None,
    form: FormatOption = "table",
    overwrite: OverwriteOption = False,
    *,
    options: RunOptions,
) -> None:
    """Sweep detector parameters or parameters of the scene generator; stored results are reused.

    Exit code 3 when runs failed, 4 when nothing could be measured.
    """
    from ..benchmark.analysis.leaderboard import unsuccessful_runs
    from ..benchmark.analysis.sweep import axis_of, break_downs, make_sweep, run_sweep
    from ..benchmark.store.writer import Store
    from ..benchmark.suite import suite_of_words
    from ..core.registry import split_list
    from ..reports.leaderboard_text import print_unsuccessful
    from ..reports.sweep_text import break_down_text, check_sweep_table, write_sweep_table

    execution = options.execution()
    if output is not None:
        check_sweep_table(output, overwrite)
    suite = suite_of_words(words, split_list(detectors), evaluator, seeds=detector_seeds)
    if seeds is not None:
        suite = suite.with_seeds(seeds)
    if scenes is not None:
        suite = suite.with_scenes(scenes)
    shown = suite.evaluators[0].ranking_index(index)
    if level is not None and shown.better == "neither":
        raise ParameterError(f"{shown.key} has no better direction, so no level to break down at")
    console = messages(options.quiet)
    with Store(options.store) as opened:
        planned = make_sweep(suite, [axis_of(text) for text in vary or ()], opened, grid=grid)
        with run_progress(planned.plan, console, verbose=options.verbose) as report:
            table, rows = run_sweep(planned, opened, execution=execution, progress=report)
    # The file first: the reader of the table may close the pipe (head).
    if output is not None:
        write_sweep_table(table, output, overwrite=overwrite)
        console.print(f"{output}: {len(table)} rows", markup=False)
    _print(table, planned, shown, form)
    if level is not None:
        first = table[table["evaluator"] == planned.plan.evaluators[0].label]
        for found in break_downs(first, planned.axes, shown, level):
            typer.echo(break_down_text(found), err=form in ("csv", "json"))
    unsuccessful = unsuccessful_runs(rows)
    print_unsuccessful(unsuccessful, console)
    if any(run.status == "failed" for run in unsuccessful):
        raise typer.Exit(3)
    if not table["scenes"].any():
        raise typer.Exit(4)


def _print(table: pd.DataFrame, planned: Sweep, index: Index, form: Literal["table", "csv", "md", "json"]) -> None:
    from ..reports.sweep_text import sweep_records, sweep_table

    if form in ("csv", "json"):
        tidy = sweep_records(table)
        typer.echo(tidy.to_csv() if form == "csv" else tidy.to_json(), nl=form == "json")
        return
    first = planned.plan.evaluators[0].label
    console = table_console()
    text = sweep_table(table[table["evaluator"] == first], [axis.name for axis in planned.axes], index)
    shown = text.to_markdown() + "\n" if form == "md" else text.to_text(console.width)
    console.print(shown, markup=False, soft_wrap=True)
    console.print(f"mean of {index.title} over scenes, {first}, with its bootstrap interval", markup=False)
