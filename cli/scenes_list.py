"""``roofbench scenes list``: the presets of the generator and their parameters."""

from __future__ import annotations

from typing import Annotated

import typer

from .console import print_result

__all__ = ["list_scenes"]


def list_scenes(
    parameters: Annotated[
        bool, typer.Option("--parameters", help="List the parameters of the generator instead.")
    ] = False,
) -> None:
    """List the synthetic scenes, or the parameters of the generator with unit, range and default."""
    from ..reports.scene_text import format_parameters, format_presets

    print_result(format_parameters() if parameters else format_presets())
