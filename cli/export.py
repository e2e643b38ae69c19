"""``roofbench export``: a stored run as vector layers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import completion
from .console import say
from .options import DEFAULT_STORE, OverwriteOption, RunArgument, StoreOption

__all__ = ["export"]


def export(
    run: RunArgument,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="Vector file; a GeoPackage holds both layers.")
    ],
    evaluator: Annotated[
        str | None,
        typer.Option(
            "--evaluator",
            "-e",
            metavar="EVALUATOR",
            help="Whose verdicts.",
            autocompletion=completion.evaluators,
        ),
    ] = None,
    store: StoreOption = DEFAULT_STORE,
    overwrite: OverwriteOption = False,
) -> None:
    """Write a stored run as vector layers: detections and references with their verdicts."""
    from ..benchmark.store.writer import Store
    from ..reports.run_export import export_run

    with Store(store, must_exist=True) as opened:
        what = export_run(opened, opened.run(run).id, output, evaluator=evaluator, overwrite=overwrite)
    say(f"{output}: {what}")
