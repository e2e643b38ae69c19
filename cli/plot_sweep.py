"""``roofbench plot sweep``: quality along swept parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import ParameterError, UnknownNameError
from .command import load_plugins
from .console import print_result, say
from .options import (
    DEFAULT_STORE,
    DpiOption,
    IndicesOption,
    OverwriteOption,
    PictureOption,
    PluginOption,
    StoreOption,
)

__all__ = ["plot_sweep"]


def plot_sweep(
    table: Annotated[
        Path | None,
        typer.Argument(metavar="TABLE", help="Table of 'roofbench sweep -o'; without it, the sweeps in the store."),
    ] = None,
    *,
    output: PictureOption,
    index: IndicesOption = None,
    axis: Annotated[
        list[str] | None, typer.Option("--axis", metavar="NAME", help="Only this axis; repeat for more.")
    ] = None,
    level: Annotated[
        float, typer.Option("--level", min=0, max=1, metavar="Q", help="Quality below which a detector breaks down.")
    ] = 0.8,
    store: StoreOption = DEFAULT_STORE,
    plugin: PluginOption = None,
    dpi: DpiOption = 120,
    overwrite: OverwriteOption = False,
) -> None:
    """Plot quality along swept parameters and generator axes, with intervals and break-down points."""
    from ..benchmark.analysis.report_contents import newest_runs, stored_evaluators
    from ..benchmark.analysis.sensitivity import read_sweep_table, stored_sensitivities
    from ..benchmark.store.writer import Store
    from ..reports.figures import save_plot
    from ..reports.sensitivity import sensitivity_figure
    from ..reports.sweep_text import break_down_text

    load_plugins(plugin)
    if table is not None:
        lines = read_sweep_table(table, indices=index or (), level=level)
    else:
        with Store(store, must_exist=True) as opened:
            rows = [row for row in newest_runs(opened) if row.status == "ok"]
            evaluators = stored_evaluators(opened, rows)
            values = opened.index_values([row.id for row in rows], evaluators[0].key) if evaluators else {}
            lines = (
                stored_sensitivities(rows, values, evaluators[0], level=level, chosen=index or ()) if evaluators else []
            )
    known = dict.fromkeys(line.axis for line in lines)
    if axis:
        missing = [name for name in axis if name not in known]
        if missing:
            raise UnknownNameError(f"no axis {missing[0]!r} was swept; there are {', '.join(known) or 'none'}")
        lines = [line for line in lines if line.axis in axis]
    if not lines:
        raise ParameterError(f"{table or store} contains no sweep: 'roofbench sweep DETECTOR --vary ...' makes one")
    save_plot(sensitivity_figure(lines, level=level), output, dpi=dpi, overwrite=overwrite)
    print_result(output)
    for line in lines:
        if line.break_down:
            say(break_down_text(line.break_down))
