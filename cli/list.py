"""``roofbench list``: detectors, evaluators, suites, scenes and indices by name."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from .command import load_plugins
from .console import print_result, table_console
from .options import FORMAT_HELP, PluginOption

__all__ = ["list_names"]


def list_names(
    kind: Annotated[
        Literal["detectors", "evaluators", "suites", "scenes", "indices"],
        typer.Argument(metavar="KIND", help="detectors, evaluators, suites, scenes or indices."),
    ],
    form: Annotated[Literal["table", "csv", "md", "json"], typer.Option("--format", "-f", help=FORMAT_HELP)] = "table",
    plugin: PluginOption = None,
) -> None:
    """List what there is to choose from, one line each."""
    from ..benchmark.catalogue import entries
    from ..reports.catalogue_text import catalogue_table, format_entries

    load_plugins(plugin)
    found = entries(kind)
    if form == "table":
        print_result(format_entries(found, table_console().width))
        typer.echo("'roofbench info NAME' explains one of them", err=True)
        return
    table = catalogue_table(found)
    print_result({"csv": table.to_csv, "md": table.to_markdown, "json": table.to_json}[form]().rstrip("\n"))
