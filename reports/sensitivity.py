"""Sensitivity plots: quality against parameters of detectors and of scenes.

After figure 8 of Awrangjeb, Ravanbakhsh & Fraser (2010), section 4.4.1, which plots object- and area-based quality
against five values of five parameters, the others at their standard values. Here each axis has a panel of its own
with the values themselves, the 95 % bootstrap interval of the mean over scenes, and the place where the mean falls
below a level.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ..benchmark.analysis.report_data import Sensitivity
from ..core.parameter_rules import parameter_text
from .format import shortened
from .inline_svg import INK, SERIES, new_figure, style_axes

__all__ = ["sensitivity_figure"]

_DASHES: tuple[Any, ...] = ("-", (0, (4, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)))
#: Widths in a legend, inches: the sample of a line with its gaps, and a letter.
_LEGEND_MARK, _LEGEND_LETTER = 0.6, 0.075
_COLUMNS = 3


def sensitivity_figure(lines: Sequence[Sensitivity], *, level: float | None = None) -> Figure:
    """Return a panel per axis: a colour per detector, a dash per index.

    Parameters
    ----------
    lines : sequence of Sensitivity
        In any order; at least one.
    level : float, optional
        Drawn dotted, when every index is a fraction.
    """
    axes_names = list(dict.fromkeys(line.axis for line in lines))
    detectors = list(dict.fromkeys(line.detector for line in lines))
    indices = list({line.index.key: line.index for line in lines}.values())
    columns = min(_COLUMNS, len(axes_names))
    rows = math.ceil(len(axes_names) / columns)
    figure = new_figure(
        max(4.4, 3.25 * columns), 2.75 * rows + 0.35 * math.ceil((len(detectors) + len(indices) + 4) / 4)
    )
    # One scale for all panels, so that slopes can be compared.
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    percent = all(index.unit == "fraction" for index in indices)
    factor = 100.0 if percent else 1.0
    for panel in grid.flat[len(axes_names) :]:
        panel.set_visible(False)
    for panel, name in zip(grid.flat, axes_names, strict=False):
        style_axes(panel)
        own = [line for line in lines if line.axis == name]
        values, places = _places(own)
        broken = 0
        for line in own:
            colour, marker = SERIES[detectors.index(line.detector) % len(SERIES)]
            dash = _DASHES[[index.key for index in indices].index(line.index.key) % len(_DASHES)]
            _draw_line(panel, line, places, colour=colour, marker=marker, dash=dash, factor=factor)
            if line.break_down is not None and line.break_down.value is not None:
                _draw_break_down(panel, line.break_down.value, broken, colour)
                broken += 1
        if level is not None and percent:
            panel.axhline(100 * level, color=INK, linewidth=0.8, linestyle=":", alpha=0.7)
        _label_axis(panel, name, own, values, places)
    units = " / ".join(dict.fromkeys(index.symbol or index.title for index in indices))
    for row in grid:
        row[0].set_ylabel(f"{units} [{'%' if percent else indices[0].unit}], mean over scenes")
    words = [index.title if len(index.title) > 9 else _named(index.key) for index in indices]
    _legend(figure, detectors, words, _marks(lines, level if percent else None))
    return figure


def _named(key: str) -> str:
    """Return an index key in words: ``pixel.quality`` becomes ``pixel quality``."""
    return key.replace(".", " ").replace("_", " ")


def _places(lines: Sequence[Sensitivity]) -> tuple[list[Any], dict[Any, float]]:
    """Return the values of an axis in order, and their places: numbers to scale, others at equal distances."""
    values = list({point.value: None for line in lines for point in line.points})
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        values.sort()
        return values, {value: float(value) for value in values}
    return values, {value: float(place) for place, value in enumerate(values)}


def _draw_line(
    panel: Axes, line: Sensitivity, places: dict[Any, float], *, colour: str, marker: str, dash: Any, factor: float
) -> None:
    known = [point for point in line.points if point.mean is not None]
    x = [places[point.value] for point in known]
    y = [factor * (point.mean or 0.0) for point in known]
    spans = [
        (places[p.value], factor * p.low, factor * p.high) for p in known if p.low is not None and p.high is not None
    ]
    if len(spans) > 1:
        at, low, high = zip(*spans, strict=True)
        panel.fill_between(at, low, high, color=colour, alpha=0.13, linewidth=0)
    panel.plot(x, y, color=colour, linestyle=dash, linewidth=1.5, marker=marker, markersize=4.5)
    most = max([line.scenes, *(point.scenes for point in line.points)])
    for point, height in zip(known, y, strict=True):
        if point.scenes < most:
            panel.annotate(
                f"n = {point.scenes}",
                (places[point.value], height),
                xytext=(4, 4),
                textcoords="offset points",
                fontsize=7,
                color=INK,
            )
    if line.default in places and any(point.value == line.default for point in known):
        here = next(point for point in known if point.value == line.default)
        panel.plot(
            places[here.value],
            factor * (here.mean or 0.0),
            marker="o",
            markersize=10,
            markerfacecolor="none",
            markeredgecolor=INK,
            markeredgewidth=1,
        )


def _draw_break_down(panel: Axes, value: float, number: int, colour: str) -> None:
    """Draw a triangle on the axis; each stands above the one before, since several may lie at one value."""
    panel.plot(
        value,
        0.055 * number,
        marker="v",
        color=colour,
        markersize=7,
        transform=panel.get_xaxis_transform(),
        clip_on=False,
    )


def _label_axis(
    panel: Axes, name: str, lines: Sequence[Sensitivity], values: Sequence[Any], places: dict[Any, float]
) -> None:
    unit = next((line.unit for line in lines if line.unit), "")
    counts = [point.scenes for line in lines for point in line.points]
    n = f"{min(counts)}" if min(counts) == max(counts) else f"{min(counts)}–{max(counts)}"
    title = name.removeprefix("scene.").replace("_", " ")
    left_out = dict.fromkeys(parameter_text(value) for line in lines for value in line.left_out)
    more = f"\nleft out (other scenes): {shortened(', '.join(left_out))}" if left_out else ""
    panel.set_xlabel(f"{shortened(title)}{f' [{unit}]' if unit else ''}; n = {n} scenes{more}")
    kind = "parameter of the scenes" if name.startswith("scene.") else "parameter of the detector"
    panel.set_title(kind, loc="left", fontsize=10)
    if len(values) <= 7:
        panel.set_xticks(
            [places[value] for value in values], [shortened(parameter_text(value), 14) for value in values]
        )


def _marks(lines: Sequence[Sensitivity], level: float | None) -> list[Artist]:
    """Return the legend of bands, rings, triangles and the dotted line, as far as they are drawn."""
    ring: dict[str, Any] = {"marker": "o", "markersize": 9, "markerfacecolor": "none", "markeredgecolor": INK}
    points = [point for line in lines for point in line.points]
    marks: list[Artist] = []
    if any(point.low is not None for point in points):
        marks.append(Patch(facecolor=INK, alpha=0.15, label="95 % interval"))
    if any(point.value == line.default for line in lines for point in line.points):
        marks.append(Line2D([], [], linestyle="", label="default value", **ring))
    if level is not None:
        marks.append(Line2D([], [], color=INK, linewidth=0.8, linestyle=":", label=f"{100 * level:g} %"))
    if any(line.break_down is not None and line.break_down.value is not None for line in lines):
        marks.append(Line2D([], [], color=INK, marker="v", markersize=6, linestyle="", label="passes the level"))
    return marks


def _legend(figure: Figure, detectors: Sequence[str], indices: Sequence[str], marks: Sequence[Artist]) -> None:
    handles: list[Artist] = [
        Line2D([], [], color=colour, marker=marker, markersize=5, linewidth=1.5, label=shortened(name))
        for name, (colour, marker) in zip(detectors, SERIES * (len(detectors) // len(SERIES) + 1), strict=False)
    ]
    handles += [
        Line2D([], [], color=INK, linestyle=_DASHES[place % len(_DASHES)], linewidth=1.5, label=name)
        for place, name in enumerate(indices)
    ]
    entries = [*handles, *marks]
    widest = _LEGEND_MARK + _LEGEND_LETTER * max(len(str(entry.get_label())) for entry in entries)
    figure.legend(
        handles=entries,
        loc="outside lower center",
        ncols=max(1, min(4, len(entries), int(figure.get_figwidth() / widest))),
        frameon=False,
        fontsize=9,
        labelcolor=INK,
    )
