"""``roofbench plot scene``: verdicts of detectors on a scene, side by side."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import typer

from ..core.errors import ParameterError, UnknownNameError
from . import completion
from .command import load_plugins
from .console import print_result
from .options import (
    DEFAULT_STORE,
    DetectorsOption,
    DpiOption,
    OverwriteOption,
    PictureOption,
    PluginOption,
    StoreOption,
)

__all__ = ["plot_scene", "read_window"]

Extent = tuple[float, float, float, float]


class Window(NamedTuple):
    """A part of a scene, in metres from its lower left corner."""

    x: float
    y: float
    width: float
    height: float


def read_window(text: str) -> Window:
    """Read ``X,Y,WIDTH,HEIGHT``."""
    try:
        x, y, width, height = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f"cannot read {text!r}: write X,Y,WIDTH,HEIGHT in metres") from None
    if not all(map(math.isfinite, (x, y, width, height))) or width <= 0 or height <= 0:
        raise typer.BadParameter(f"{text}: width and height must be more than 0 m, all four must be finite")
    return Window(x, y, width, height)


def plot_scene(
    name: Annotated[
        str,
        typer.Argument(
            metavar="SCENE",
            help="Scene as named in the store, or a pattern that matches one scene.",
            autocompletion=completion.scenes,
        ),
    ],
    output: PictureOption,
    detectors: DetectorsOption = None,
    window: Annotated[
        Window | None,
        typer.Option(
            "--window",
            parser=read_window,
            metavar="X,Y,WIDTH,HEIGHT",
            help="Part of the scene, in metres from its lower left corner.",
        ),
    ] = None,
    store: StoreOption = DEFAULT_STORE,
    plugin: PluginOption = None,
    dpi: DpiOption = 120,
    overwrite: OverwriteOption = False,
) -> None:
    """Plot the verdicts of detectors on a scene, side by side."""
    from ..benchmark.analysis.report_contents import newest_runs, stored_evaluators
    from ..benchmark.analysis.report_scenes import scene_view
    from ..benchmark.store.writer import Store
    from ..reports.figures import save_plot
    from ..reports.scene_figure import overlay_figure

    load_plugins(plugin)
    with Store(store, must_exist=True) as opened:
        rows = [row for row in newest_runs(opened, detector=detectors, scene=name) if row.status == "ok"]
        names = dict.fromkeys(row.scene for row in rows)
        if len(names) != 1:
            found = f"several scenes match {name!r}: {', '.join(list(names)[:8])}" if names else f"no run on {name!r}"
            raise UnknownNameError(f"{store}: {found}; 'roofbench ls' lists what there is")
        evaluators = stored_evaluators(opened, rows)
        first = {row.label: row for row in sorted(rows, key=lambda row: -row.seed)}
        chosen = [row for row in rows if first[row.label] is row]
        view = scene_view(opened, opened.scene(rows[0].scene_id), chosen, evaluators[0]) if evaluators else None
    if view is None:
        raise ParameterError(f"{store}: {name!r} has no verdicts to draw: it has no reference, or was not evaluated")
    save_plot(overlay_figure(view, window=_placed(window, view.extent)), output, dpi=dpi, overwrite=overwrite)
    print_result(output)


def _placed(window: Window | None, extent: Extent) -> Extent | None:
    """Return the window as xmin, ymin, xmax, ymax in the CRS of the scene."""
    if window is None:
        return None
    x, y, width, height = window
    if x >= extent[2] - extent[0] or y >= extent[3] - extent[1] or x + width <= 0 or y + height <= 0:
        raise ParameterError(
            f"the window {','.join(f'{value:g}' for value in window)} lies outside the scene, which is "
            f"{extent[2] - extent[0]:.0f} m wide and {extent[3] - extent[1]:.0f} m high: change window="
        )
    return extent[0] + x, extent[1] + y, extent[0] + x + width, extent[1] + y + height
