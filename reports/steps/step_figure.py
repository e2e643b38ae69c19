"""A step as a figure: its panels side by side, with legends, colour bars and scale bars."""

from __future__ import annotations

import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from ...detectors.steps import ChartPanel, MapPanel, Scale, Step
from .chart_panel import draw_chart
from .map_panel import draw_map

__all__ = ["step_figure"]

#: Inches.
_WIDTH, _WIDE, _HIGHEST = 10.0, 12.0, 14.0


def step_figure(step: Step) -> Figure:
    """Return the picture of a step; panels that share a scale share its colour bar."""
    columns = max(1, min(step.columns, len(step.panels)))
    rows = max(1, math.ceil(len(step.panels) / columns))
    figure = Figure(figsize=_size(step, rows, columns), layout="constrained")
    if not step.panels:
        figure.text(0.5, 0.5, "nothing to show", ha="center")
        return figure
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat[len(step.panels) :]:
        axes.set_axis_off()
    used: dict[Scale, tuple[ScalarMappable, list[Axes]]] = {}
    for number, (axes, panel) in enumerate(zip(grid.flat, step.panels, strict=False)):
        if isinstance(panel, ChartPanel):
            below, left = step.panels[number + columns : number + columns + 1], step.panels[:number][-1:]
            draw_chart(
                axes,
                panel,
                label_x=not any(isinstance(other, ChartPanel) and other.x == panel.x for other in below),
                label_y=number % columns == 0
                or not any(isinstance(other, ChartPanel) and other.y == panel.y for other in left),
            )
            continue
        for scale, colours in draw_map(axes, panel, coordinates=len(step.panels) == 1).items():
            used.setdefault(scale, (colours, []))[1].append(axes)
    for scale, (colours, places) in used.items():
        _add_colour_bar(figure, scale, colours, places)
    return figure


def _size(step: Step, rows: int, columns: int) -> tuple[float, float]:
    width = _WIDTH if columns == 1 else _WIDE
    heights = []
    for panel in step.panels:
        if isinstance(panel, MapPanel):
            xmin, ymin, xmax, ymax = panel.extent
            heights.append(0.9 * width / columns * (ymax - ymin) / (xmax - xmin) + 0.7)
        else:
            heights.append(min(2.6, width / columns))
    return width, min(_HIGHEST, max(4.0, rows * max(heights, default=4.0)))


def _add_colour_bar(figure: Figure, scale: Scale, colours: ScalarMappable, places: list[Axes]) -> None:
    style: dict[str, Any] = {"label": f"{scale.label}, {scale.unit}" if scale.unit else scale.label}
    if scale.ends:
        middle = (scale.low + scale.high) / 2
        style["ticks"] = [scale.low, middle, scale.high] if len(scale.ends) == 3 else [scale.low, scale.high]
    bar = figure.colorbar(colours, ax=places, shrink=0.7, **style)
    if scale.ends:
        bar.ax.set_yticklabels(scale.ends)
