"""Draw a map of a step: its layers, a legend below it, and a scale bar."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import Normalize, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import AbstractPathEffect, Normal, withStroke
from numpy.typing import NDArray

from ...detectors.steps import (
    ClassRaster,
    ColourRaster,
    Extent,
    LineLayer,
    MapPanel,
    MarkerLayer,
    OutlineLayer,
    ReliefRaster,
    Scale,
    TextLayer,
    ValueRaster,
)
from ..map_elements import add_scale_bar, polygon_paths
from .step_colours import MISSING, ROLE_COLOURS, colour_map

__all__ = ["draw_map", "scales_of"]

#: Longest side of a drawn raster, cells: more is not visible and makes large files.
_MOST_CELLS = 1600
#: Width of lines and outlines, points.
_LINE = 1.3


def draw_map(axes: Axes, panel: MapPanel, *, coordinates: bool) -> dict[Scale, ScalarMappable]:
    """Draw a map and return its scales, which the figure shows as colour bars.

    Parameters
    ----------
    axes : Axes
        Empty.
    panel : MapPanel
    coordinates : bool
        Whether the axes carry map coordinates.
    """
    xmin, ymin, xmax, ymax = panel.extent
    axes.set_facecolor("white")
    axes.set_xlim(xmin, xmax)
    axes.set_ylim(ymin, ymax)
    axes.set_aspect("equal")
    axes.set_title(panel.title, fontsize=10)
    handles: list[Any] = []
    for layer in panel.layers:
        if isinstance(layer, ValueRaster):
            handles += _draw_values(axes, layer)
        elif isinstance(layer, ClassRaster):
            handles += _draw_classes(axes, layer)
        elif isinstance(layer, ColourRaster):
            _show(axes, _faded(layer.values) if layer.faint else layer.values, layer.extent)
        elif isinstance(layer, ReliefRaster):
            _show(axes, _shaded(layer), layer.extent, cmap="gray", vmin=0, vmax=1)
        elif isinstance(layer, OutlineLayer):
            handles += _draw_outlines(axes, layer)
        elif isinstance(layer, LineLayer):
            handles += _draw_lines(axes, layer)
        elif isinstance(layer, MarkerLayer):
            handles += _draw_markers(axes, layer)
        else:
            _draw_texts(axes, layer)
    if handles:
        below = (0.5, -0.06 if coordinates else -0.01)
        axes.legend(handles=handles, loc="upper center", bbox_to_anchor=below, ncol=3, frameon=False, fontsize=8)
    if coordinates:
        axes.ticklabel_format(useOffset=False, style="plain")
        axes.tick_params(labelsize=7)
        axes.set_xlabel("east, m", fontsize=8)
        axes.set_ylabel("north, m", fontsize=8)
    else:
        axes.set_xticks([])
        axes.set_yticks([])
    add_scale_bar(axes)
    return {scale: ScalarMappable(Normalize(scale.low, scale.high), colour_map(scale)) for scale in scales_of(panel)}


def scales_of(panel: MapPanel) -> list[Scale]:
    """Return the scales of a map's layers, each once."""
    scales = [layer.scale for layer in panel.layers if isinstance(layer, ValueRaster | LineLayer)]
    return list(dict.fromkeys(scale for scale in scales if scale is not None))


def _show(axes: Axes, raster: NDArray[Any], extent: Extent, **style: Any) -> None:
    xmin, ymin, xmax, ymax = extent
    step = max(1, max(raster.shape[:2]) // _MOST_CELLS)
    limits = axes.get_xlim(), axes.get_ylim()
    axes.imshow(raster[::step, ::step], extent=(xmin, xmax, ymin, ymax), interpolation="nearest", **style)
    axes.set_xlim(limits[0])
    axes.set_ylim(limits[1])


def _draw_values(axes: Axes, layer: ValueRaster) -> list[Patch]:
    scale = layer.scale
    colour = "black" if scale.kind == "grey" else MISSING
    colours = colormaps[colour_map(scale)].with_extremes(bad=colour)
    _show(axes, np.ma.masked_invalid(layer.values), layer.extent, cmap=colours, vmin=scale.low, vmax=scale.high)
    return [Patch(facecolor=colour, edgecolor="#999999", label=layer.missing)] if layer.missing else []


def _draw_classes(axes: Axes, layer: ClassRaster) -> list[Patch]:
    colours = np.array([to_rgb(ROLE_COLOURS[category.role]) for category in layer.categories])
    step = max(1, max(layer.values.shape) // _MOST_CELLS)
    _show(axes, colours[layer.values[::step, ::step].astype(np.intp)], layer.extent)
    return [
        Patch(facecolor=ROLE_COLOURS[category.role], edgecolor="#999999", label=category.label)
        for category in layer.categories
        if category.label
    ]


def _faded(colours: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return an orthoimage in light grey, on which coloured lines are visible."""
    grey = 0.55 + 0.45 * colours.mean(axis=-1, keepdims=True)
    return np.asarray(np.repeat(grey, 3, axis=-1))


def _shaded(layer: ReliefRaster) -> NDArray[np.floating]:
    """Return heights as brightness, lit from the north-west."""
    metres = np.nan_to_num(layer.values)
    if min(metres.shape) < 2:
        return np.full(metres.shape, 0.75)
    cell = (layer.extent[2] - layer.extent[0]) / metres.shape[1]
    south, east = np.gradient(metres, cell)
    return np.asarray(np.clip(0.75 + 0.18 * (east + south), 0, 1))


def _casing(width: float) -> list[AbstractPathEffect]:
    """Return the white edge that separates a line from whatever it lies on."""
    return [withStroke(linewidth=width + 1.2, foreground="white"), Normal()]


def _draw_outlines(axes: Axes, layer: OutlineLayer) -> list[Line2D]:
    colour, paths = ROLE_COLOURS[layer.role], list(polygon_paths(layer.polygons))
    axes.add_collection(
        PathCollection(paths, facecolor="none", edgecolor=colour, linewidth=_LINE, path_effects=_casing(_LINE))
    )
    return [_handle(colour, layer.label, len(paths))]


def _draw_lines(axes: Axes, layer: LineLayer) -> list[Line2D]:
    lines = LineCollection(list(layer.lines), linewidths=_LINE, path_effects=_casing(_LINE))
    axes.add_collection(lines)
    if layer.values is not None and layer.scale is not None:
        lines.set_cmap(colour_map(layer.scale))
        lines.set_clim(layer.scale.low, layer.scale.high)
        lines.set_array(layer.values)
        lines.set_path_effects([withStroke(linewidth=_LINE + 1.6, foreground="black"), Normal()])
        lines.set_linewidth(1.5 * _LINE)
        return []
    colour = ROLE_COLOURS[layer.role]
    lines.set_color(colour)
    if layer.marked and len(layer.lines):
        _scatter(axes, layer.lines.mean(axis=1), "o", colour)
    return [_handle(colour, layer.label, len(layer.lines), "o" if layer.marked else "")]


def _draw_markers(axes: Axes, layer: MarkerLayer) -> list[Line2D]:
    colour, symbol = ROLE_COLOURS[layer.role], {"circle": "o", "diamond": "D"}[layer.symbol]
    if len(layer.places):
        _scatter(axes, layer.places, symbol, colour)
    return [_handle(colour, layer.label, len(layer.places), symbol, linewidth=0)]


def _scatter(axes: Axes, places: NDArray[np.float64], symbol: str, colour: str) -> None:
    x, y = places.T
    axes.scatter(x, y, s=18, marker=symbol, facecolors="none", edgecolors=colour, linewidths=0.9, zorder=3)


def _handle(colour: str, label: str, count: int, symbol: str = "", linewidth: float = 2.0) -> Line2D:
    text = f"{label} ({count:,})"
    return Line2D([], [], color=colour, lw=linewidth, marker=symbol, markersize=5, mfc="none", label=text)


def _draw_texts(axes: Axes, layer: TextLayer) -> None:
    edge = [withStroke(linewidth=1.4, foreground="black")]
    for (x, y), text in zip(layer.places, layer.texts, strict=True):
        axes.text(x, y, text, color="white", fontsize=8, ha="center", va="center", path_effects=edge, parse_math=False)
