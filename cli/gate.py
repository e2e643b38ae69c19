"""``roofbench baseline save`` and ``roofbench gate``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..core.errors import InputError, ParameterError, UnknownNameError
from .options import (
    DetectorOption,
    EvaluatorOption,
    RunOptions,
    ScenesOption,
    SeedsOption,
    messages,
    suite_from_words,
    with_run_options,
)
from .progress import run_progress

if TYPE_CHECKING:
    from rich.console import Console

    from ..benchmark.analysis.baseline import Baseline
    from ..benchmark.suite import Entrant, Suite

baseline_app = typer.Typer(
    name="baseline", help="What a version of the code reached, for the gate.", no_args_is_help=True
)


@baseline_app.callback()
def _baseline() -> None:
    pass


@baseline_app.command("save")
@with_run_options
def save(
    output: Annotated[Path, typer.Option("--output", "-o", help="Baseline file, JSON, to be kept in git.")],
    suite: Annotated[str, typer.Option(help="Suite: TOML file or name.")] = "gate",
    detector: DetectorOption = None,
    evaluator: EvaluatorOption = None,
    scenes: ScenesOption = None,
    seeds: SeedsOption = None,
    detector_seeds: Annotated[
        int, typer.Option(min=1, help="Seeds of stochastic detectors given by -d: so many runs a scene.", metavar="N")
    ] = 5,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists.")] = False,
    *,
    options: RunOptions,
) -> None:
    """Run a suite and save what every detector reached; refused when the working tree has uncommitted changes."""
    from ..benchmark.identity.provenance import code_version
    from ..core.output import check_target

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
    if scenes is not None:
        chosen = chosen.with_scenes(scenes)
    told = messages(options.quiet)
    measured, failed = _measure(chosen, options, told)
    measured.save(output, overwrite=overwrite)
    told.print(
        f"{output}: {len(measured.detectors)} detectors on {len(measured.scenes)} scenes, {version}", markup=False
    )
    if failed:
        raise typer.Exit(3)


@with_run_options
def gate(
    baseline: Annotated[Path, typer.Argument(help="Baseline file.")],
    candidate: Annotated[
        Path | None, typer.Argument(help="Another baseline file; without it, the code that runs now is measured.")
    ] = None,
    suite: Annotated[str | None, typer.Option(help="Suite to measure instead of the baseline's own.")] = None,
    detector: DetectorOption = None,
    against: Annotated[
        str | None, typer.Option(help="Detector of the baseline that the one of -d is compared with.", metavar="NAME")
    ] = None,
    scenes: ScenesOption = None,
    index: Annotated[list[str] | None, typer.Option(help="Index to gate; repeat for more.")] = None,
    margin: Annotated[
        list[str] | None, typer.Option(help="Difference taken as none, INDEX=NUMBER, such as object.quality=0.005.")
    ] = None,
    level: Annotated[
        float | None,
        typer.Option(min=1e-6, max=0.5, help="Twice the share of false alarms that is borne.", show_default="0.01"),
    ] = None,
    time: Annotated[
        bool, typer.Option("--time", help="Gate run time, too: the baseline's commit and this code in turns.")
    ] = False,
    time_margin: Annotated[float, typer.Option(min=0.001, help="Share of run time taken as no difference.")] = 0.1,
    form: Annotated[
        Literal["table", "md", "json"], typer.Option("--format", "-f", help="How it is printed.")
    ] = "table",
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write Markdown here as well.")] = None,
    *,
    options: RunOptions,
) -> None:
    """Say by paired tests over scenes whether a change has made a detector better or worse.

    With -d only the detectors that it names are compared, each with the one of the same name in the baseline or with
    the one that --against names; with --scenes only the scenes of that pattern.

    Exit code 1 when an index became worse or a run fails that did not, 4 when nothing could be measured or the scenes
    are not the same, else 0.
    """
    from ..benchmark.analysis.baseline import Baseline
    from ..benchmark.analysis.gate import GATE_LEVEL, compare, different_scenes, gated_indices, margins_of
    from ..benchmark.analysis.timing import time_side_by_side
    from ..core.output import whole_file
    from ..reports.gate_text import format_gate

    before = Baseline.load(baseline)
    if scenes is not None:
        before = before.with_scenes(scenes)
    if against is not None:
        before = before.only([against])
    judge = before.evaluator.evaluator()
    indices = gated_indices(judge, index)
    margins = margins_of(margin or [], indices)
    level = GATE_LEVEL if level is None else level
    if candidate is not None:
        if suite is not None or detector or time:
            raise ParameterError("a candidate file is measured already: leave out --suite, --detector and --time")
        after = Baseline.load(candidate)
        after = after if scenes is None else after.with_scenes(scenes)
    else:
        if detector:
            before, entrants = _named(before, detector)
        else:
            entrants = before.to_suite().entrants
        chosen = replace(before.to_suite(), entrants=entrants)
        if suite is not None:
            chosen = replace(chosen, scenes=suite_from_words([suite], None, None).scenes)
            chosen = chosen if scenes is None else chosen.with_scenes(scenes)
        after, _ = _measure(chosen, options, messages(options.quiet))
    after = after.with_labels_of(before)
    differences = different_scenes(before, after)
    if differences:
        for text in differences[:10]:
            typer.echo(f"Not comparable: {text}", err=True)
        raise typer.Exit(4)
    extra = time_side_by_side(before, after, margin=time_margin, level=level) if time else []
    result = compare(before, after, indices=indices, margins=margins, level=level, extra=extra)
    if output is not None:
        with whole_file(output, overwrite=True) as scratch:
            scratch.write_text(format_gate(result, "md") + "\n", encoding="utf-8")
    typer.echo(format_gate(result, form))
    raise typer.Exit(result.exit_code)


def _named(before: Baseline, selections: list[str]) -> tuple[Baseline, tuple[Entrant, ...]]:
    """Return what the baseline has of the detectors that are named, and those to be run, with its seeds."""
    from ..benchmark.suite import Entrant
    from ..detectors.registry import make_detector

    detectors = {entrant.label: entrant.detector for entrant in (Entrant(make_detector(name)) for name in selections)}
    known = before.counterparts(list(detectors))
    for label in detectors:
        if label not in known:
            raise UnknownNameError(
                f"the baseline has no detector {label!r}; it has {', '.join(before.detectors)}: say with --against "
                "which one it is compared with"
            )
    entrants = (Entrant(detector, before.detectors[known[label]].seeds) for label, detector in detectors.items())
    return before.only(known.values()), tuple(entrants)


def _measure(suite: Suite, options: RunOptions, told: Console) -> tuple[Baseline, int]:
    """Run a suite; return what it reached, and how many runs failed."""
    from ..benchmark.analysis.baseline import measure
    from ..benchmark.analysis.leaderboard import incidents_of
    from ..benchmark.execution.runner import run_plan
    from ..benchmark.identity.provenance import code_version
    from ..benchmark.plan import make_plan
    from ..benchmark.store.writer import Store
    from ..reports.tables import print_incidents

    execution = options.execution()
    with Store(options.store) as opened:
        plan = make_plan(suite, opened)
        with run_progress(plan, told) as report:
            result = run_plan(plan, opened, execution=execution, progress=report)
        print_incidents(incidents_of(result.rows), told)
        measured = measure(suite, result.rows, opened, plan.judges[0], code_version())
    return measured, len(result.failed)
