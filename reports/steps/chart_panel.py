"""Draw a chart of a step: curves or bars against an axis with label and unit."""

from __future__ import annotations

from typing import Literal

from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullFormatter

from ...detectors.steps import Axis, Bars, ChartPanel
from .step_colours import ROLE_COLOURS

__all__ = ["draw_chart"]

#: Okabe & Ito's colours and, from the eighth curve on, dashes.
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
_DASHES = ("-", "--", ":")


def draw_chart(axes: Axes, panel: ChartPanel, *, label_x: bool = True, label_y: bool = True) -> None:
    """Draw a chart on empty axes; a label is left out where the chart below or beside it carries the same one."""
    axes.set_title(panel.title, fontsize=9)
    curves = 0
    for series in panel.series:
        if isinstance(series, Bars):
            axes.bar(series.x, series.y, width=series.width, color=ROLE_COLOURS[series.role])
            if series.mean is not None:
                axes.axhline(series.mean, color="black", lw=0.8, ls="--")
            continue
        colour = _COLOURS[curves % len(_COLOURS)]
        dash = _DASHES[curves // len(_COLOURS) % len(_DASHES)]
        axes.plot(series.x, series.y, color=colour, ls=dash, lw=1.3, label=series.label or None)
        curves += 1
    _prepare(axes, "x", panel.x, labelled=label_x)
    _prepare(axes, "y", panel.y, labelled=label_y)
    axes.tick_params(labelsize=7)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(ncol=min(curves, 8), fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.25), frameon=False)


def _prepare(axes: Axes, which: Literal["x", "y"], axis: Axis, *, labelled: bool) -> None:
    drawn = axes.xaxis if which == "x" else axes.yaxis
    if axis.logarithmic:
        (axes.set_xscale if which == "x" else axes.set_yscale)("log")
        drawn.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        drawn.set_major_formatter("{x:g}")
        drawn.set_minor_formatter(NullFormatter())
    if axis.unit == "%":
        drawn.set_major_formatter(lambda fraction, _: f"{100 * fraction:g}")
    if axis.ticks:
        drawn.set_ticks(list(axis.ticks), list(axis.ticks.values()))
    if labelled:
        drawn.set_label_text(f"{axis.label}, {axis.unit}" if axis.unit else axis.label, fontsize=8)
