"""``roofbench baseline save`` and ``roofbench gate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ...scenes.errors import InputError, ParameterError
from .options import (
    DEFAULT_STORE,
    DetectorOption,
    EvaluatorOption,
    JobsOption,
    MemoryLimitOption,
    PluginOption,
    QuietOption,
    SchedulerOption,
    StoreOption,
    TimeLimitOption,
    load_plugins,
    messages,
    read_limits,
    suite_from_words,
)
from .progress import run_progress

if TYPE_CHECKING:
    from rich.console import Console

    from ..baseline import Baseline
    from ..runner import Execution
    from ..suite import Suite

baseline_app = typer.Typer(
    name="baseline", help="What a version of the code reached, for the gate.", no_args_is_help=True
)


@baseline_app.callback()
def _baseline() -> None:
    pass


@baseline_app.command("save")
def save(
    output: Annotated[Path, typer.Option("--output", "-o", help="Baseline file, JSON, to be kept in git.")],
    suite: Annotated[str, typer.Option(help="Suite: TOML file or name.")] = "gate",
    detector: DetectorOption = None,
    evaluator: EvaluatorOption = None,
    seeds: Annotated[int | None, typer.Option(min=1, help="Seeds 1 to N of every preset.", metavar="N")] = None,
    detector_seeds: Annotated[int, typer.Option(min=1, help="Seeds of stochastic detectors given by -d.")] = 1,
    jobs: JobsOption = 1,
    scheduler: SchedulerOption = None,
    time_limit: TimeLimitOption = None,
    memory_limit: MemoryLimitOption = None,
    store: StoreOption = DEFAULT_STORE,
    plugin: PluginOption = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists.")] = False,
    quiet: QuietOption = False,
) -> None:
    """Run a suite and save what every detector reached; refused when the working tree has uncommitted changes."""
    from ...scenes.output import check_target
    from ..provenance import code_version
    from ..runner import Execution

    load_plugins(plugin)
    check_target(output, overwrite)
    version = code_version()
    if version.dirty:
        raise InputError(
            "the working tree has uncommitted changes, and a baseline must name the commit that reached it: "
            "commit or stash them first"
        )
    chosen = suite_from_words([suite], detector, evaluator, seeds=detector_seeds)
    if seeds is not None:
        chosen = chosen.with_seeds(seeds)
    execution = Execution(jobs=jobs, scheduler=scheduler, limits=read_limits(time_limit, memory_limit))
    told = messages(quiet)
    measured, failed = _measure(chosen, store, execution, told)
    measured.save(output, overwrite=overwrite)
    told.print(
        f"{output}: {len(measured.detectors)} detectors on {len(measured.scenes)} scenes, {version}", markup=False
    )
    if failed:
        raise typer.Exit(3)


def gate(
    baseline: Annotated[Path, typer.Argument(help="Baseline file.")],
    candidate: Annotated[
        Path | None, typer.Argument(help="Another baseline file; without it, the code that runs now is measured.")
    ] = None,
    suite: Annotated[str | None, typer.Option(help="Suite to measure instead of the baseline's own.")] = None,
    detector: DetectorOption = None,
    index: Annotated[list[str] | None, typer.Option(help="Index to gate; repeat for more.")] = None,
    margin: Annotated[
        list[str] | None, typer.Option(help="Difference taken as none, INDEX=NUMBER, such as object.quality=0.005.")
    ] = None,
    level: Annotated[float, typer.Option(min=1e-6, max=0.5, help="Level of significance.")] = 0.05,
    time: Annotated[
        bool, typer.Option("--time", help="Gate run time, too: the baseline's commit and this code in turns.")
    ] = False,
    time_margin: Annotated[float, typer.Option(min=0.001, help="Share of run time taken as no difference.")] = 0.1,
    form: Annotated[
        Literal["table", "md", "json"], typer.Option("--format", "-f", help="How it is printed.")
    ] = "table",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write Markdown here as well.")] = None,
    jobs: JobsOption = 1,
    scheduler: SchedulerOption = None,
    time_limit: TimeLimitOption = None,
    memory_limit: MemoryLimitOption = None,
    store: StoreOption = DEFAULT_STORE,
    plugin: PluginOption = None,
    quiet: QuietOption = False,
) -> None:
    """Say by paired tests over scenes whether a change has made a detector better or worse.

    Exit code 1 when an index became worse or a run fails that did not, 4 when nothing could be measured or the scenes
    are not the same, else 0.
    """
    from ...reports.gate_text import format_gate
    from ...scenes.output import whole_file
    from ..baseline import Baseline
    from ..gate import compare, different_scenes, gated_indices, margins_of
    from ..runner import Execution
    from ..timing import time_side_by_side

    load_plugins(plugin)
    before = Baseline.load(baseline)
    judge = before.evaluator.evaluator()
    indices = gated_indices(judge, index)
    margins = margins_of(margin or [], indices)
    told = messages(quiet)
    if candidate is not None:
        if suite is not None or detector:
            raise ParameterError("a candidate file is measured already: leave out --suite and --detector")
        after = Baseline.load(candidate)
    else:
        execution = Execution(jobs=jobs, scheduler=scheduler, limits=read_limits(time_limit, memory_limit))
        after, _ = _measure(_candidate_suite(before, suite, detector), store, execution, told)
        after = after.with_labels_of(before)
    differences = different_scenes(before, after)
    if differences:
        for text in differences[:10]:
            typer.echo(f"Not comparable: {text}", err=True)
        raise typer.Exit(4)
    extra = time_side_by_side(before, margin=time_margin, level=level) if time else []
    result = compare(before, after, indices=indices, margins=margins, level=level, extra=extra)
    typer.echo(format_gate(result, form))
    if output is not None:
        with whole_file(output, overwrite=True) as scratch:
            scratch.write_text(format_gate(result, "md") + "\n", encoding="utf-8")
    raise typer.Exit(result.exit_code)


def _candidate_suite(before: Baseline, suite: str | None, detectors: list[str] | None) -> Suite:
    """Return what is measured: the baseline's scenes and detectors, unless told otherwise."""
    from dataclasses import replace

    from ...detectors.registry import make_detector
    from ..suite import Entrant

    chosen = before.to_suite()
    if suite is not None:
        chosen = replace(suite_from_words([suite], None, None), evaluators=chosen.evaluators, entrants=chosen.entrants)
    if detectors:
        seeds = max((entrant.seeds for entrant in chosen.entrants), key=len)
        chosen = replace(chosen, entrants=tuple(Entrant(make_detector(name), seeds) for name in detectors))
    return chosen


def _measure(suite: Suite, store: Path, execution: Execution, told: Console) -> tuple[Baseline, int]:
    """Run a suite; return what it reached, and how many runs failed."""
    from ...reports.tables import print_incidents
    from ..baseline import measure
    from ..leaderboard import incidents_of
    from ..plan import make_plan
    from ..provenance import code_version
    from ..runner import run_plan
    from ..store import Store

    with Store(store) as opened:
        plan = make_plan(suite, opened)
        with run_progress(plan, told) as report:
            result = run_plan(plan, opened, execution=execution, progress=report)
        print_incidents(incidents_of(result.rows), told)
        measured = measure(suite, result.rows, opened, plan.judges[0], code_version())
    return measured, len(result.failed)
