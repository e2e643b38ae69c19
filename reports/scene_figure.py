"""One scene with the verdicts of several detectors, side by side, over its picture."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray
from PIL import Image as Bitmap

from ..benchmark.analysis.report_data import Overlay, SceneView
from ..benchmark.execution.scene_picture import ScenePicture
from ..evaluators.verdict_table import SIDES, VerdictKind
from .format import shortened
from .map_elements import add_scale_bar, polygon_paths
from .verdict_style import ROLE_STYLE, filled_kinds

__all__ = ["overlay_figure"]


def overlay_figure(view: SceneView, *, window: tuple[float, float, float, float] | None = None) -> Figure:
    """Return a panel per overlay, with the counts of each verdict.

    Parameters
    ----------
    view : SceneView
    window : tuple of float, optional
        ``(xmin, ymin, xmax, ymax)`` to show, metres; the whole extent by default.
    """
    xmin, ymin, xmax, ymax = window or view.extent
    count = len(view.overlays)
    columns = 2 if count == 4 else min(3, count)
    rows = math.ceil(count / columns)
    width = {1: 8.0, 2: 6.0}.get(columns, 4.6)
    shape = float(np.clip((ymax - ymin) / (xmax - xmin), 0.4, 2.0))
    figure = Figure(figsize=(width * columns, rows * (width * shape + 0.5) + 0.7), dpi=110, layout="constrained")
    figure.suptitle(shortened(view.name, 90), fontsize=11, parse_math=False)
    backdrop = None if view.picture is None else _pale(view.picture)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat:
        axes.set_axis_off()
    for axes, overlay in zip(grid.flat, view.overlays, strict=False):
        verdicts = overlay.verdicts
        if backdrop is not None:
            left, bottom, right, top = view.extent
            axes.imshow(backdrop, extent=(left, right, bottom, top), interpolation="antialiased")
        _draw(axes, view, overlay)
        axes.set_xlim(xmin, xmax)
        axes.set_ylim(ymin, ymax)
        axes.set_aspect("equal")
        add_scale_bar(axes)
        counts = [
            f"{verdicts.table(kind.side).count(kind.key)} {kind.key}"
            for kind in verdicts.kinds
            if kind.role not in ("outline", "left out")
        ]
        axes.set_title(f"{shortened(overlay.label)}: {', '.join(counts)}", fontsize=9, parse_math=False)
    figure.legend(handles=_legend(view), loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure


def _pale(picture: ScenePicture) -> NDArray[np.float64]:
    """Return the picture in pale colours, so that the verdicts stand out."""
    with Bitmap.open(io.BytesIO(picture.content)) as bitmap:
        pixels = np.asarray(bitmap.convert("RGB"), dtype=np.float64) / 255
    grey = pixels.mean(axis=-1, keepdims=True)
    return np.asarray(0.35 + 0.65 * (0.5 * pixels + 0.5 * grey))


def _draw(axes: Axes, view: SceneView, overlay: Overlay) -> None:
    axes.add_collection(
        PathCollection(list(polygon_paths(view.reference.polygons)), facecolor="none", edgecolor="black", linewidth=0.7)
    )
    for side in reversed(SIDES):
        for kind in filled_kinds(overlay.verdicts, side):
            chosen = overlay.verdicts.footprints(side).polygons[overlay.verdicts.mask(kind)]
            axes.add_collection(PathCollection(list(polygon_paths(chosen)), **_look(kind), linewidth=1.0))
    if view.area is not None and shapely.area(view.area) > 0:
        axes.add_collection(
            PathCollection(list(polygon_paths([view.area])), facecolor="none", edgecolor="#333333", linestyle="--")
        )


def _look(kind: VerdictKind) -> dict[str, Any]:
    style = ROLE_STYLE[kind.role]
    return {
        "facecolor": to_rgba(style.colour, style.on_picture),
        "edgecolor": style.colour,
        "hatch": style.hatch,
    }


def _legend(view: SceneView) -> Sequence[Patch]:
    handles = [Patch(facecolor="none", edgecolor="black", label="reference")]
    every = [overlay.verdicts for overlay in view.overlays]
    for kind in every[0].kinds:
        needed = kind.role != "left out" or any(verdicts.mask(kind).any() for verdicts in every)
        if kind.role != "outline" and needed:
            handles.append(Patch(label=kind.legend, **_look(kind)))
    return handles
