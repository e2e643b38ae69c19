"""``roofbench baseline save``: reference scores for the gate."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import InputError
from . import completion
from .command import Command, RunOptions, with_run_options
from .console import messages, print_next
from .measuring import measure_suite
from .options import DetectorOption, EvaluatorsOption, OverwriteOption, ScenesOption, SeedsOption

__all__ = ["app", "save"]

app = typer.Typer(
    name="baseline",
    help="Save reference scores for the regression gate.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
)


@app.callback()
def _baseline() -> None:
    pass


@app.command("save", cls=Command, short_help="Run a suite and save the scores.")
@with_run_options
def save(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="Baseline file, JSON, to be kept in git.")
    ],
    suite: Annotated[
        str,
        typer.Option("--suite", metavar="SUITE", help="Suite: TOML file or name.", autocompletion=completion.suites),
    ] = "gate",
    detector: DetectorOption = None,
    evaluator: EvaluatorsOption = None,
    scenes: ScenesOption = None,
    seeds: SeedsOption = None,
    detector_seeds: Annotated[
        int,
        typer.Option(
            "--detector-seeds", min=1, metavar="N", help="Runs per scene of each stochastic detector given by -d."
        ),
    ] = 5,
    overwrite: OverwriteOption = False,
    *,
    options: RunOptions,
) -> None:
    """Run a suite and save the scores of every detector; refused when the working tree has uncommitted changes."""
    from ..benchmark.identity.provenance import code_version
    from ..benchmark.suite import suite_of_words
    from ..core.output import check_target
    from ..core.wording import counted

    check_target(output, overwrite)
    version = code_version()
    if version.dirty:
        raise InputError(
            "the working tree has uncommitted changes, and a baseline must name the commit that it belongs to: "
            "commit or stash them first"
        )
    chosen = suite_of_words([suite], detector, evaluator, seeds=detector_seeds)
    if seeds is not None:
        chosen = chosen.with_seeds(seeds)
    if scenes is not None:
        chosen = chosen.with_scenes(scenes)
    console = messages(options.quiet)
    measured, failed = measure_suite(chosen, options, console)
    measured.save(output, overwrite=overwrite)
    detectors, places = counted(len(measured.detectors), "detector"), counted(len(measured.scenes), "scene")
    console.print(f"{output}: {detectors} on {places}, {version}", markup=False)
    print_next(console, f"roofbench gate {shlex.quote(str(output))}")
    if failed:
        raise typer.Exit(3)
