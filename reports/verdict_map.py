"""Maps of verdicts: where the detections are right, where they are wrong, and the indices beside it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from matplotlib.collections import PathCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..evaluators.base import Evaluation
from ..evaluators.verdict_table import VerdictKind, Verdicts
from .curves import curve_panels, draw_curves
from .evaluation_text import described, evaluation_table
from .format import shortened
from .map_elements import add_scale_bar, polygon_paths
from .places import places_of
from .verdict_style import ROLE_STYLE, filled_kinds

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_verdicts", "verdict_figure"]

#: Panels of curves below the table of the indices.
_MOST_PANELS = 3
#: Characters of the title of an index that fit beside its symbol.
_LONG_TITLE = 28


def verdict_figure(evaluation: Evaluation, *, title: str, area: shapely.Geometry | None = None) -> Figure:
    """Return a figure: the map of all verdicts with scale bar and legend, beside it the index table and curves.

    Footprints that lie in places far apart get a map for each place (the nine with most objects), since on one map
    of all nothing would be seen.

    Parameters
    ----------
    evaluation : Evaluation
        With verdicts (not a pooled one).
    title : str
    area : polygon, optional
        Evaluation area, drawn dashed.
    """
    verdicts = evaluation.verdicts
    if verdicts is None:
        raise ValueError("a pooled evaluation has no verdicts to draw")
    figure = Figure(figsize=(13, 8), dpi=100, layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=[2.4, 1], squeeze=False)[0]
    figure.suptitle(shortened(title, 150), x=0.01, ha="left", fontsize=11, parse_math=False)
    places, total = places_of(np.concatenate([footprints.polygons for _, _, footprints in verdicts.sides]))
    columns = math.ceil(math.sqrt(len(places)))
    grid = left.subplots(math.ceil(len(places) / columns), columns, squeeze=False)
    for axes in grid.flat:
        axes.set_axis_off()
    handles: dict[str, Any] = {}
    for number, (axes, extent) in enumerate(zip(grid.flat, places, strict=False)):
        axes.set_axis_on()
        if total > 1:
            axes.set_title(f"place {number + 1} of {total}", fontsize=9, loc="left")
        for handle in draw_verdicts(axes, verdicts, extent=extent, area=area):
            handles[str(handle.get_label())] = handle
    if handles:
        order = [kind.legend for kind in verdicts.kinds if kind.role != "outline"]
        shown = sorted(handles.values(), key=lambda handle: _place(str(handle.get_label()), order))
        left.legend(handles=shown, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    panels = curve_panels(evaluation)[:_MOST_PANELS]
    heights = [1.0, *(0.35 for _ in panels)]
    indices, *others = right.subplots(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    _draw_indices(indices, evaluation)
    for panel, curves in zip(others, panels, strict=True):
        draw_curves(panel, evaluation, curves)
    return figure


def draw_verdicts(
    axes: Axes,
    verdicts: Verdicts,
    *,
    extent: tuple[float, float, float, float] | None = None,
    area: shapely.Geometry | None = None,
) -> list[Patch]:
    """Draw verdicts on map axes with a scale bar; return the handles for a legend.

    Parameters
    ----------
    axes : matplotlib Axes
    verdicts : Verdicts
    extent : tuple of float, optional
        ``(xmin, ymin, xmax, ymax)`` to show; all footprints by default.
    area : polygon, optional
        Evaluation area, drawn dashed.
    """
    every = np.concatenate([footprints.polygons for _, _, footprints in verdicts.sides])
    if area is not None:
        every = np.append(every, area)
    if extent is None and len(every):
        extent = tuple(shapely.total_bounds(every))
    if extent is None:
        axes.text(0.5, 0.5, "no footprints on either side", ha="center", va="center", transform=axes.transAxes)
        axes.set_axis_off()
        return []
    pad = 0.03 * max(extent[2] - extent[0], extent[3] - extent[1], 1.0)
    axes.set_xlim(extent[0] - pad, extent[2] + pad)
    axes.set_ylim(extent[1] - pad, extent[3] + pad)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    handles: list[Patch] = []
    window = shapely.box(*extent)
    # Detections lie above references, outlines above both.
    outlined = [kind for kind in verdicts.kinds if kind.role == "outline"]
    for kind in [*filled_kinds(verdicts, "reference"), *filled_kinds(verdicts, "detection"), *outlined]:
        chosen = verdicts.footprints(kind.side).polygons[verdicts.mask(kind)]
        if len(chosen):
            handles.append(_draw_group(axes, chosen, kind, window))
    if area is not None:
        axes.add_collection(
            PathCollection(
                list(polygon_paths([area])), facecolor="none", edgecolor="#555555", linestyle="--", linewidth=1
            )
        )
        handles.append(Patch(facecolor="none", edgecolor="#555555", linestyle="--", label="evaluation area"))
    add_scale_bar(axes)
    return handles


def _draw_group(axes: Axes, polygons: NDArray[np.object_], kind: VerdictKind, window: shapely.Geometry) -> Patch:
    style = ROLE_STYLE[kind.role]
    look: dict[str, Any] = {
        "facecolor": "none" if kind.role == "outline" else to_rgba(style.colour, style.on_map),
        "edgecolor": style.colour,
        "hatch": style.hatch,
        "linewidth": 0.7 if kind.role == "outline" else 0.6,
    }
    visible = polygons[shapely.intersects(polygons, window)]
    axes.add_collection(PathCollection(list(polygon_paths(visible)), **look))
    side = f"{kind.side} " if kind.role == "left out" else ""
    return Patch(label=f"{side}{kind.legend} ({len(polygons):,})", **look)


def _place(label: str, order: list[str]) -> int:
    """Return the place of a legend's entry, whose label ends with a count; entries of no filled kind come last."""
    text = label.rpartition(" (")[0]
    return next((place for place, legend in enumerate(order) if text.endswith(legend)), len(order))


def _draw_indices(axes: Axes, evaluation: Evaluation) -> None:
    """Write the principal indices, the counts' parameters and the notes."""
    axes.set_axis_off()
    rows = evaluation_table(evaluation, (index for index in evaluation.evaluator.indices if index.main)).rows
    table = axes.table(
        cellText=[list(map(str, row)) for row in rows],
        colLabels=("index", "symbol", "value"),
        colWidths=(0.6, 0.17, 0.26),
        cellLoc="left",
        loc="upper center",
    )
    table.auto_set_font_size(False)
    table.set_fontsize(9)
    table.scale(1, 1.35)
    for (row, column), cell in table.get_celld().items():
        cell.set_edgecolor("#CCCCCC")
        cell.visible_edges = "B"
        if row == 0:
            cell.set_text_props(weight="bold")
        elif column == 0:
            cell.set_fontsize(9 * min(1.0, _LONG_TITLE / len(cell.get_text().get_text())))
        if column == 2:
            cell.set_text_props(ha="right")
    notes = [described(evaluation), *evaluation.notes]
    text = "\n".join(_wrapped(note, 58) for note in notes[:6])
    axes.text(0.0, 0.2, text, transform=axes.transAxes, fontsize=8, va="top", color="#444444", parse_math=False)


def _wrapped(text: str, width: int) -> str:
    import textwrap

    return "\n".join(textwrap.wrap(text, width, break_long_words=True))
