"""``roofbench plot gate``: paired differences with their intervals."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .console import print_result
from .options import DpiOption, OverwriteOption, PictureOption

__all__ = ["plot_gate"]


def plot_gate(
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="Output of 'roofbench gate ... --format json'.")],
    output: PictureOption,
    dpi: DpiOption = 120,
    overwrite: OverwriteOption = False,
) -> None:
    """Plot the paired differences of a gate with their intervals against the margins."""
    from ..reports.figures import save_plot
    from ..reports.gate_figure import gate_figure
    from ..reports.gate_json import read_gate

    save_plot(gate_figure(read_gate(result)), output, dpi=dpi, overwrite=overwrite)
    print_result(output)
