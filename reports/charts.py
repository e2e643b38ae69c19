"""Charts of a report: quality against building size, time and memory against scene size.

Bars through points are 95 % intervals: Wilson's for shares of objects.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from ..benchmark.analysis.inference import wilson_interval
from ..benchmark.analysis.report_data import CostPoint, SizeBin, SizeCurve
from .format import shortened
from .inline_svg import FAINT, INK, SERIES, new_figure, style_axes

__all__ = ["cost_figure", "legend_below", "size_figure"]


def size_figure(curves: Sequence[SizeCurve]) -> Figure:
    """Return two panels: share of found references and of correct detections, by footprint area."""
    figure = new_figure(9.6, 4.4)
    panels: tuple[tuple[str, str, Callable[[SizeCurve], tuple[SizeBin, ...]]], ...] = (
        ("Completeness: references found", "references", lambda curve: curve.found),
        ("Correctness: detections that found a building", "detections", lambda curve: curve.correct),
    )
    for axes, (title, noun, bins_of) in zip(figure.subplots(1, 2, sharey=True), panels, strict=True):
        style_axes(axes)
        axes.set_title(title, loc="left", fontsize=10)
        for place, curve in enumerate(curves):
            _draw_size(axes, bins_of(curve), curve.label, place, len(curves))
        _label_bins(axes, [bins_of(curve) for curve in curves], noun)
        axes.set_ylim(-3, 103)
    figure.axes[0].set_ylabel("share of objects [%]")
    legend_below(figure)
    return figure


def _draw_size(axes: Axes, bins: Sequence[SizeBin], label: str, place: int, count: int) -> None:
    colour, marker = SERIES[place % len(SERIES)]
    # Points of one bin are drawn side by side, so that their bars do not cover each other.
    offset = (place - (count - 1) / 2) * min(0.12, 0.6 / max(count, 1))
    shown = [(number + offset, each) for number, each in enumerate(bins) if each.count]
    x = [position for position, _ in shown]
    y = [100 * each.right / each.count for _, each in shown]
    bounds = [wilson_interval(each.right, each.count) for _, each in shown]
    axes.vlines(
        x, [100 * low for low, _ in bounds], [100 * high for _, high in bounds], color=colour, linewidth=1.3, alpha=0.6
    )
    axes.plot(x, y, color=colour, marker=marker, markersize=5, linewidth=1.4, label=shortened(label))


def _label_bins(axes: Axes, every: Sequence[Sequence[SizeBin]], noun: str) -> None:
    first = every[0]
    names = []
    for number, each in enumerate(first):
        counts = [bins[number].count for bins in every]
        span = f"{each.low:g}–{each.high:g}" if math.isfinite(each.high) else f"≥ {each.low:g}"
        n = f"{min(counts)}" if min(counts) == max(counts) else f"{min(counts)}\n–{max(counts)}"
        names.append(f"{span if each.low else f'< {each.high:g}'}\nn={n}")
    axes.set_xticks(range(len(first)), names)
    axes.tick_params(axis="x", labelsize=7.5)
    axes.set_xlabel(f"footprint area [m²]; n: {noun} per detector")


def cost_figure(costs: Sequence[CostPoint]) -> Figure:
    """Return two panels: processor time and peak memory against scene size; all axes but memory logarithmic."""
    by_points = all(cost.points for cost in costs)
    figure = new_figure(9.6, 3.9)
    left, right = figure.subplots(1, 2)
    labels = list(dict.fromkeys(cost.label for cost in costs))
    panels: tuple[tuple[Axes, str, str, Callable[[CostPoint], float]], ...] = (
        (left, "Time of a detection", "processor time [s]", lambda cost: cost.cpu_seconds),
        (right, "Memory of a detection", "peak memory of the process [MB]", lambda cost: cost.peak_memory / 1e6),
    )
    for axes, title, ylabel, value in panels:
        style_axes(axes)
        axes.set_title(title, loc="left", fontsize=10)
        for place, label in enumerate(labels):
            own = [cost for cost in costs if cost.label == label and value(cost) > 0]
            colour, marker = SERIES[place % len(SERIES)]
            x = [(cost.points or 0) / 1000 if by_points else cost.hectares for cost in own]
            axes.plot(
                x,
                [value(cost) for cost in own],
                linestyle="none",
                marker=marker,
                color=colour,
                markersize=5,
                alpha=0.75,
                label=shortened(label),
            )
        axes.set_xscale("log")
        if axes is left:
            axes.set_yscale("log")
        else:
            axes.set_ylim(bottom=0)
        for axis in (axes.xaxis, *([axes.yaxis] if axes is left else [])):
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
        size = "laser points [thousands]" if by_points else "extent [ha]"
        axes.set_xlabel(f"{size}; n = {len({cost.scene for cost in costs})} scenes")
        axes.set_ylabel(ylabel)
    legend_below(figure)
    return figure


def legend_below(figure: Figure) -> None:
    """Draw one legend of all labelled lines below the panels."""
    found: dict[str, Artist] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            found.setdefault(str(label), handle)
    if found:
        figure.legend(
            list(found.values()),
            list(found),
            loc="outside lower center",
            ncols=min(4, len(found)),
            frameon=False,
            fontsize=9,
            labelcolor=INK,
            edgecolor=FAINT,
        )
