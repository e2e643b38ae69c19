"""``roofbench ls``: list stored runs."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from .console import print_result
from .options import DEFAULT_STORE, FORMAT_HELP, DetectorsOption, ScenesOption, StoreOption

__all__ = ["ls"]


def ls(
    status: Annotated[
        Literal["ok", "failed", "skipped"] | None, typer.Option("--status", help="Only runs with this status.")
    ] = None,
    detectors: DetectorsOption = None,
    scenes: ScenesOption = None,
    limit: Annotated[int, typer.Option("--limit", "-n", min=0, metavar="N", help="Newest runs to list; 0: all.")] = 50,
    form: Annotated[Literal["table", "csv", "json"], typer.Option("--format", "-f", help=FORMAT_HELP)] = "table",
    store: StoreOption = DEFAULT_STORE,
) -> None:
    """List stored runs, the newest first."""
    from ..benchmark.store.listing import list_runs
    from ..reports.listing_text import format_listing

    listing = list_runs(store, status=status, detector=detectors, scene=scenes, limit=limit or None)
    for piece in format_listing(listing, form):
        print_result(piece, nl=False)
