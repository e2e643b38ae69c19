"""``roofbench sweep``: quality along parameters of detectors and of synthetic scenes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..core.errors import ParameterError
from ..core.wording import counted
from . import completion
from .command import RunOptions, with_run_options
from .console import messages, print_result, table_console
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

    from ..benchmark.analysis.published_sweep import PublishedSweep
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
            help="VALUES: VALUE,VALUE,... or FROM:TO:STEP; without =VALUES the declared ones; scene.NAME varies the "
            "generator; repeat for more.",
        ),
    ] = None,
    figure: Annotated[
        str | None,
        typer.Option(
            "--figure",
            metavar="NUMBER",
            help="Repeat a figure of the detector's paper on its presets, draw it and check what the text says of it.",
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
    from ..benchmark.analysis.published_sweep import axes_of, published_axes
    from ..benchmark.analysis.sweep import break_downs, make_sweep, run_sweep
    from ..benchmark.store.writer import Store
    from ..benchmark.suite import suite_of_words
    from ..core.output import check_target
    from ..core.registry import split_list
    from ..reports.leaderboard_text import print_unsuccessful
    from ..reports.sweep_text import break_down_text, check_sweep_table, write_sweep_table

    execution = options.execution()
    if output is not None:
        check_sweep_table(output, overwrite)
    selections = split_list(detectors)
    published = None
    if figure is not None:
        published = _published(selections, figure, vary)
        check_target(_picture(published), overwrite)
        words = words or list(published.scenes)
        seeds = published.seeds if seeds is None else seeds
    suite = suite_of_words(words, selections, evaluator, seeds=detector_seeds)
    if seeds is not None:
        suite = suite.with_seeds(seeds)
    if scenes is not None:
        suite = suite.with_scenes(scenes)
    shown = suite.evaluators[0].ranking_index(index)
    if level is not None and shown.better == "neither":
        raise ParameterError(f"{shown.key} has no better direction, so no level to break down at")
    console = messages(options.quiet)
    with Store(options.store) as opened:
        if published is not None:
            suite, axes = published_axes(suite, published)
        else:
            axes = axes_of(vary or (), suite)
        planned = make_sweep(suite, axes, opened, grid=grid)
        with run_progress(planned.plan, console, verbose=options.verbose) as report:
            table, rows = run_sweep(planned, opened, execution=execution, progress=report)
    # The file first: the reader of the table may close the pipe (head).
    if output is not None:
        write_sweep_table(table, output, overwrite=overwrite)
        console.print(f"{output}: {counted(len(table), 'row')}", markup=False)
    if published is None:
        _print(table, planned, shown, form)
    else:
        _print_published(published, table, planned, form, overwrite=overwrite)
    if level is not None:
        first = table[table["evaluator"] == planned.plan.evaluators[0].label]
        for found in break_downs(first, planned.axes, shown, level):
            print_result(break_down_text(found), err=form in ("csv", "json"))
    unsuccessful = unsuccessful_runs(rows)
    print_unsuccessful(unsuccessful, console)
    if any(run.status == "failed" for run in unsuccessful):
        raise typer.Exit(3)
    if not table["scenes"].any():
        raise typer.Exit(4)


def _published(selections: list[str], figure: str, vary: list[str] | None) -> PublishedSweep:
    from ..benchmark.analysis.published_sweep import published_sweep
    from ..core.registry import parse_selection

    if vary:
        raise ParameterError("--figure chooses what is varied: leave out --vary")
    if len(selections) != 1:
        raise ParameterError("--figure repeats the figure of one detector's paper: name one detector")
    return published_sweep(parse_selection(selections[0])[0], figure)


def _picture(published: PublishedSweep) -> Path:
    return Path(f"{published.detector}-figure-{published.figure}.png")


def _print_published(
    published: PublishedSweep,
    table: pd.DataFrame,
    planned: Sweep,
    form: Literal["table", "csv", "md", "json"],
    *,
    overwrite: bool,
) -> None:
    """Draw a published figure into the working folder; print its values and what the paper says of it."""
    from ..benchmark.analysis.published_sweep import curves_of
    from ..benchmark.identity.recipes import label_of
    from ..reports.figures import save_plot
    from ..reports.published_sweep_report import curve_table, finding_table, published_sweep_figure

    label = label_of(planned.detectors[0])
    first = table[table["evaluator"] == planned.plan.evaluators[0].label]
    curves = curves_of(first, published, label)
    if form in ("csv", "json"):
        _print(table, planned, planned.plan.evaluators[0].evaluator.ranking_index(None), form)
    if len(curves) < len(published.parameters):
        return  # runs failed; the exit code says so
    target = _picture(published)
    save_plot(published_sweep_figure(published, curves, label), target, dpi=110, overwrite=overwrite)
    findings = published.findings(curves)
    console = table_console()
    for shown in () if form in ("csv", "json") else (curve_table(curves), finding_table(findings)):
        text = shown.to_markdown() + "\n" if form == "md" else shown.to_text(console.width)
        console.print(text, markup=False, soft_wrap=True)
    held = sum(found.reproduced for found in findings)
    print_result(f"{target}: {held} of {len(findings)} statements of the text reproduced", err=form in ("csv", "json"))


def _print(table: pd.DataFrame, planned: Sweep, index: Index, form: Literal["table", "csv", "md", "json"]) -> None:
    from ..reports.sweep_text import sweep_records, sweep_table

    if form in ("csv", "json"):
        tidy = sweep_records(table)
        print_result(tidy.to_csv() if form == "csv" else tidy.to_json(), nl=form == "json")
        return
    first = planned.plan.evaluators[0].label
    console = table_console()
    text = sweep_table(table[table["evaluator"] == first], [axis.name for axis in planned.axes], index)
    shown = text.to_markdown() + "\n" if form == "md" else text.to_text(console.width)
    console.print(shown, markup=False, soft_wrap=True)
    console.print(f"mean of {index.title} over scenes, {first}, with its bootstrap interval", markup=False)
