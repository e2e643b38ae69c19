"""``roofbench plot``: the figures that it draws, a command for each."""

from __future__ import annotations

import typer

from .command import Command
from .plot_gate import plot_gate
from .plot_scene import plot_scene
from .plot_sweep import plot_sweep

__all__ = ["app"]

app = typer.Typer(
    name="plot",
    help="Draw single figures as PNG, SVG or PDF.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
)
app.command("sweep", cls=Command, short_help="Plot quality along swept parameters.")(plot_sweep)
app.command("scene", cls=Command, short_help="Plot the verdicts of detectors on a scene.")(plot_scene)
app.command("gate", cls=Command, short_help="Plot the paired differences of a gate.")(plot_gate)
