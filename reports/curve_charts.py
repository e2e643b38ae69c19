"""Curves of several detectors for reports: one panel for each curve of an evaluator, one line for each detector."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..benchmark.analysis.report_data import PooledCurves
from ..core.wording import counted
from ..evaluators.index import Curve
from .charts import legend_below
from .format import shortened, unit_text
from .inline_svg import SERIES, new_figure, style_axes

__all__ = ["curves_figure"]

_COLUMNS = 3


def curves_figure(found: PooledCurves) -> Figure:
    """Return the figure of one evaluator; fractions are shown in percent, histograms as steps."""
    curves = next(iter(found.pooled.values())).evaluator.curves
    rows = math.ceil(len(curves) / _COLUMNS)
    # One width for all evaluators: a page scales figures to its own.
    figure = new_figure(9.6, 2.7 * rows + 0.5)
    panels = figure.subplots(rows, _COLUMNS, squeeze=False)
    for panel in panels.flat[len(curves) :]:
        panel.set_visible(False)
    for panel, curve in zip(panels.flat, curves, strict=False):
        _draw(panel, curve, found)
    legend_below(figure)
    return figure


def _draw(axes: Axes, curve: Curve, found: PooledCurves) -> None:
    style_axes(axes)
    axes.set_title(curve.title, loc="left", fontsize=10)
    x_scale, y_scale = (100.0 if unit == "fraction" else 1.0 for unit in (curve.x_unit, curve.y_unit))
    for place, (label, evaluation) in enumerate(found.pooled.items()):
        x, y = evaluation.curves[curve.key]
        colour, _ = SERIES[place % len(SERIES)]
        if curve.bars:
            axes.stairs(y_scale * y, x_scale * x, color=colour, linewidth=1.4, label=shortened(label))
        else:
            axes.plot(x_scale * x, y_scale * y, color=colour, linewidth=1.4, label=shortened(label))
    if curve.y_unit == "fraction":
        axes.set_ylim(0, 105)
    axes.set_xlabel(f"{_label(curve.x, curve.x_unit)}; {counted(len(found.scenes), 'scene')}")
    axes.set_ylabel(_label(curve.y, curve.y_unit))


def _label(words: str, unit: str) -> str:
    text = "m²" if unit == "m2" else unit_text(unit)
    return f"{words} [{text}]" if text else words
