"""``roofbench plot``: single figures as PNG, SVG or PDF."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import ParameterError, UnknownNameError
from .options import DEFAULT_STORE, PluginOption, StoreOption, load_plugins

if TYPE_CHECKING:
    from matplotlib.figure import Figure

app = typer.Typer(name="plot", help="Single figures as PNG, SVG or PDF.", no_args_is_help=True)

OutputOption = Annotated[Path, typer.Option("--output", "-o", help="Picture: .png, .svg or .pdf.")]
DpiOption = Annotated[int, typer.Option(min=30, max=1200, help="Pixels per inch of a PNG.")]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists.")]


@app.command("sweep")
def sweep(
    table: Annotated[
        Path | None, typer.Argument(help="Table of 'roofbench sweep -o'; without it, the sweeps in the store.")
    ] = None,
    *,
    output: OutputOption,
    index: Annotated[
        list[str] | None, typer.Option(help="Index to plot; object- and area-based quality by default.")
    ] = None,
    axis: Annotated[list[str] | None, typer.Option(help="Only this axis; repeat for more.")] = None,
    level: Annotated[float, typer.Option(min=0, max=1, help="Where a detector counts as broken down.")] = 0.8,
    store: StoreOption = DEFAULT_STORE,
    plugin: PluginOption = None,
    dpi: DpiOption = 120,
    overwrite: OverwriteOption = False,
) -> None:
    """Plot quality along swept parameters and generator axes, with intervals and break-down points."""
    from ..benchmark.analysis.report_contents import newest_runs, stored_judges
    from ..benchmark.analysis.sensitivity import read_sweep_table, stored_sensitivities
    from ..benchmark.store.writer import Store
    from ..reports.sensitivity import sensitivity_figure

    load_plugins(plugin)
    if table is not None:
        lines = read_sweep_table(table, indices=index or (), level=level)
    else:
        with Store(store, must_exist=True) as opened:
            rows = [row for row in newest_runs(opened) if row.status == "ok"]
            judges = stored_judges(opened, rows)
            values = opened.index_values([row.id for row in rows], judges[0].key) if judges else {}
            lines = stored_sensitivities(rows, values, judges[0], level=level, chosen=index or ()) if judges else []
    known = dict.fromkeys(line.axis for line in lines)
    if axis:
        missing = [name for name in axis if name not in known]
        if missing:
            raise UnknownNameError(f"no axis {missing[0]!r} was swept; there are {', '.join(known) or 'none'}")
        lines = [line for line in lines if line.axis in axis]
    if not lines:
        raise ParameterError(f"{table or store} holds no sweep: 'roofbench sweep DETECTOR --vary ...' makes one")
    _save(sensitivity_figure(lines, level=level), output, dpi, overwrite)
    for line in lines:
        if line.break_down:
            typer.echo(line.break_down, err=True)


@app.command("scene")
def scene(
    name: Annotated[str, typer.Argument(help="Scene as named in the store, or a pattern that one scene matches.")],
    output: OutputOption,
    detector: Annotated[
        str | None, typer.Option("--detector", "-d", help="Only matching labels.", metavar="PATTERN")
    ] = None,
    window: Annotated[
        str | None, typer.Option(help="Part to show, metres from the lower left corner.", metavar="X,Y,WIDTH,HEIGHT")
    ] = None,
    store: StoreOption = DEFAULT_STORE,
    plugin: PluginOption = None,
    dpi: DpiOption = 120,
    overwrite: OverwriteOption = False,
) -> None:
    """Plot the verdicts of detectors on a scene, side by side."""
    from ..benchmark.analysis.report_contents import newest_runs, stored_judges
    from ..benchmark.analysis.report_scenes import scene_view
    from ..benchmark.store.writer import Store
    from ..reports.scene_figure import overlay_figure

    load_plugins(plugin)
    with Store(store, must_exist=True) as opened:
        rows = [row for row in newest_runs(opened, detector=detector, scene=name) if row.status == "ok"]
        names = dict.fromkeys(row.scene for row in rows)
        if len(names) != 1:
            found = f"several scenes match {name!r}: {', '.join(list(names)[:8])}" if names else f"no run on {name!r}"
            raise UnknownNameError(f"{store}: {found}; 'roofbench ls' lists what there is")
        judges = stored_judges(opened, rows)
        first = {row.label: row for row in sorted(rows, key=lambda row: -row.seed)}
        chosen = [row for row in rows if first[row.label] is row]
        view = scene_view(opened, opened.scene(rows[0].scene_id), chosen, judges[0].key) if judges else None
    if view is None:
        raise ParameterError(f"{store}: {name!r} has no verdicts to draw: it has no reference, or was not evaluated")
    _save(overlay_figure(view, window=_window(window, view.extent)), output, dpi, overwrite)


@app.command("gate")
def gate(
    result: Annotated[Path, typer.Argument(help="What 'roofbench gate ... --format json' printed.")],
    output: OutputOption,
    dpi: DpiOption = 120,
    overwrite: OverwriteOption = False,
) -> None:
    """Plot the paired differences of a gate with their intervals against the margins."""
    from ..reports.gate_figure import gate_figure
    from ..reports.gate_json import read_gate

    _save(gate_figure(read_gate(result)), output, dpi, overwrite)


def _save(figure: Figure, path: Path, dpi: int, overwrite: bool) -> None:
    from matplotlib.text import Text

    from ..reports.figures import save_figure

    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        text.set_parse_math(False)
    figure.set_facecolor("white")
    figure.patch.set_alpha(1)
    save_figure(figure, path, dpi=dpi, overwrite=overwrite)


def _window(text: str | None, extent: tuple[float, float, float, float]) -> tuple[float, float, float, float] | None:
    if text is None:
        return None
    try:
        x, y, width, height = (float(part) for part in text.split(","))
    except ValueError:
        raise ParameterError(f"cannot read --window {text!r}: write X,Y,WIDTH,HEIGHT in metres") from None
    if not all(map(math.isfinite, (x, y, width, height))) or width <= 0 or height <= 0:
        raise ParameterError(f"--window {text}: width and height must be more than 0 m, all four must be finite")
    if x >= extent[2] - extent[0] or y >= extent[3] - extent[1] or x + width <= 0 or y + height <= 0:
        raise ParameterError(
            f"--window {text} lies beside the scene, which is {extent[2] - extent[0]:.0f} m wide and "
            f"{extent[3] - extent[1]:.0f} m high"
        )
    return extent[0] + x, extent[1] + y, extent[0] + x + width, extent[1] + y + height
