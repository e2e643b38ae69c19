"""``roofbench info``: everything about one name."""

from __future__ import annotations

from typing import Annotated

import typer

from . import completion
from .command import load_plugins
from .console import print_result, table_console
from .options import PluginOption

__all__ = ["info"]


def info(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="Detector, evaluator, FILE.py:CLASS, suite, scene, or index by key or symbol.",
            autocompletion=completion.everything,
        ),
    ],
    plugin: PluginOption = None,
) -> None:
    """Explain a detector, evaluator, suite, scene or index: parameters, inputs, source and an example."""
    from ..benchmark.catalogue import entries_of
    from ..reports.catalogue_text import format_entry

    load_plugins(plugin)
    width = table_console().width
    print_result("\n\n".join(format_entry(entry, width) for entry in entries_of(name)))
