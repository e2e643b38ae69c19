"""Maps of two detections of one place: what both find, what only one finds, and what only one of them invents."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from matplotlib.collections import PathCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..evaluators.uncertainty.paired import FATES, PairedComparison
from ..evaluators.verdict_table import Verdicts
from .format import shortened
from .map_elements import add_scale_bar, polygon_paths
from .pair_text import FATE_WORDS, objects_line
from .places import places_of
from .verdict_style import FATE_LOOKS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["pair_figure"]

#: Colours of Okabe & Ito.
_BLUE, _ORANGE = "#0072B2", "#D55E00"


def pair_figure(found: PairedComparison, *, title: str, area: shapely.Geometry | None = None) -> Figure:
    """Return the map of a paired comparison, with scale bar, legend and counts.

    References are filled by their fate; detections of A and of B that count as wrong are outlined in the colour of
    their side. Footprints in places far apart get a map for each place (the nine with most objects).

    Parameters
    ----------
    found : PairedComparison
        By an evaluator with verdicts.
    title : str
    area : polygon, optional
        Evaluation area, drawn dashed.
    """
    one, two = found.first.verdicts, found.second.verdicts
    if one is None or two is None or found.fates is None:
        raise ValueError("an evaluator without verdicts has no objects to draw")
    figure = Figure(figsize=(13, 9), dpi=100, layout="constrained")
    heading = f"{shortened(title, 170)}\n{objects_line(found)}"
    figure.suptitle(heading, x=0.01, ha="left", fontsize=10, parse_math=False)
    groups = _groups(found, one, two)
    every = np.concatenate([np.empty(0, dtype=object), *(polygons for polygons, _ in groups)])
    places, total = places_of(every)
    columns = int(np.ceil(np.sqrt(len(places))))
    grid = figure.subplots(-(-len(places) // columns), columns, squeeze=False)
    for axes in grid.flat:
        axes.set_axis_off()
    for number, (axes, extent) in enumerate(zip(grid.flat, places, strict=False)):
        axes.set_axis_on()
        if total > 1:
            axes.set_title(f"place {number + 1} of {total}", fontsize=9, loc="left")
        _draw(axes, groups, every, extent, area)
    handles = [Patch(**look) for polygons, look in groups if len(polygons)]
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _groups(found: PairedComparison, one: Verdicts, two: Verdicts) -> list[tuple[NDArray[np.object_], dict[str, Any]]]:
    """Return what is drawn with one look, in drawing order: polygons, and look with label."""
    groups: list[tuple[NDArray[np.object_], dict[str, Any]]] = []
    for fate in FATES:
        style, polygons = FATE_LOOKS[fate], one.reference.polygons[found.fates == fate]
        groups.append(
            (
                polygons,
                {
                    "facecolor": to_rgba(style.colour, style.opacity),
                    "edgecolor": style.colour,
                    "hatch": style.hatch,
                    "linewidth": 0.6,
                    "label": f"{FATE_WORDS[fate]} ({len(polygons):,})",
                },
            )
        )
    # Dashes over a solid line: where both detect the same wrong object, both colours are seen.
    for name, verdicts, colour, dashes in (("B", two, _ORANGE, "-"), ("A", one, _BLUE, (0, (3, 2)))):
        wrong = [kind.key for kind in verdicts.kinds_of("detection") if kind.counts_as == "wrong"]
        polygons = verdicts.detected.polygons[verdicts.detection_table.where(*wrong)]
        label = f"wrong detection of {name} ({len(polygons):,})"
        look = {"facecolor": "none", "edgecolor": colour, "linewidth": 1.2, "linestyle": dashes, "label": label}
        groups.append((polygons, look))
    return groups


def _draw(
    axes: Axes,
    groups: list[tuple[NDArray[np.object_], dict[str, Any]]],
    every: NDArray[np.object_],
    extent: tuple[float, float, float, float] | None,
    area: shapely.Geometry | None,
) -> None:
    if extent is None and len(every):
        extent = tuple(shapely.total_bounds(every if area is None else np.append(every, area)))
    if extent is None:
        axes.text(0.5, 0.5, "no footprints", ha="center", va="center", transform=axes.transAxes)
        axes.set_axis_off()
        return
    pad = 0.03 * max(extent[2] - extent[0], extent[3] - extent[1], 1.0)
    axes.set_xlim(extent[0] - pad, extent[2] + pad)
    axes.set_ylim(extent[1] - pad, extent[3] + pad)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    window = shapely.box(*extent)
    for polygons, look in groups:
        visible = polygons[shapely.intersects(polygons, window)]
        axes.add_collection(PathCollection(list(polygon_paths(visible)), **look))
    if area is not None:
        border: dict[str, Any] = {"facecolor": "none", "edgecolor": "#555555", "linestyle": "--", "linewidth": 1}
        axes.add_collection(PathCollection(list(polygon_paths([area])), **border))
    add_scale_bar(axes)
