"""Pictures of the steps of the plain baseline detector."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from matplotlib.collections import PathCollection
from matplotlib.path import Path
from numpy.typing import NDArray

from ..base import Step
from ..scale_bar import add_scale_bar

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

    from .ndsm_detector import Work

__all__ = ["draw_steps"]

#: Largest side of a drawn raster, cells: more is not seen and makes large files.
_DRAWN = 1600


def draw_steps(work: Work) -> Iterator[Step]:
    """Yield one picture per step of a detection."""
    drawings: list[tuple[str, str, Callable[[Figure], None]]] = [
        (
            "heights",
            "Mean height above ground of the points that are higher than the threshold, metres.",
            lambda figure: _heights(figure, work),
        ),
        (
            "cues",
            "The cues on high cells: each is drawn from a roof (red) through its threshold (yellow) to a tree (green).",
            lambda figure: _cues(figure, work),
        ),
        (
            "likeness",
            "Mean of the cues over the neighbourhood: -1 roof, +1 tree; high cells below 0 are roof.",
            lambda figure: _likeness(figure, work),
        ),
        (
            "mask",
            "Roof cells: kept (dark), added by filling holes (blue), cut off by the opening (red).",
            lambda figure: _mask(figure, work),
        ),
        (
            "outlines",
            "Traced outlines (white) and footprints with straight walls (red) on heights above ground; "
            "traced outlines without a footprint were too small or too much like a tree.",
            lambda figure: _outlines(figure, work),
        ),
    ]
    for number, (name, caption, draw) in enumerate(drawings, start=1):
        yield Step(f"{number:02d}-{name}", caption, draw)


def _size(figure: Figure, work: Work, across: int = 1, down: int = 1) -> None:
    rows, columns = work.cues.grid.shape
    width = 10.0 if across == 1 else 12.0
    figure.set_size_inches(width, min(14.0, max(4.0, width / across * down * rows / columns + 0.6)))


def _frame(axes: Axes, work: Work) -> None:
    xmin, ymin, xmax, ymax = work.cues.grid.extent
    axes.set_xlim(xmin, xmax)
    axes.set_ylim(ymin, ymax)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    add_scale_bar(axes)


def _show(axes: Axes, work: Work, raster: NDArray[Any], **style: Any) -> AxesImage:
    xmin, ymin, xmax, ymax = work.cues.grid.extent
    step = max(1, max(raster.shape[:2]) // _DRAWN)
    axes.set_facecolor("white")
    _frame(axes, work)
    return axes.imshow(raster[::step, ::step], extent=(xmin, xmax, ymin, ymax), interpolation="nearest", **style)


def _heights(figure: Figure, work: Work) -> None:
    _size(figure, work)
    axes = figure.add_subplot()
    known = work.cues.height[np.isfinite(work.cues.height)]
    top = float(np.percentile(known, 99)) if len(known) else 1.0
    drawn = _show(axes, work, work.cues.height, cmap="viridis", vmin=0, vmax=top)
    figure.colorbar(drawn, ax=axes, label="height above ground, m", shrink=0.8)


def _cues(figure: Figure, work: Work) -> None:
    down = 2 if len(work.said) > 1 else 1
    across = 2 if len(work.said) > 1 else 1
    _size(figure, work, across, down)
    panels = np.atleast_1d(figure.subplots(down, across, squeeze=False)).ravel()
    for axes in panels:
        axes.set_axis_off()
    for axes, (name, said) in zip(panels, work.said.items(), strict=False):
        axes.set_axis_on()
        drawn = _show(axes, work, np.where(work.high, said, np.nan), cmap="RdYlGn", vmin=-1, vmax=1)
        axes.set_title(name)
    if work.said:
        key = figure.colorbar(drawn, ax=panels, shrink=0.5, ticks=[-1, 0, 1])
        key.ax.set_yticklabels(["roof", "undecided", "tree"])


def _likeness(figure: Figure, work: Work) -> None:
    _size(figure, work)
    axes = figure.add_subplot()
    drawn = _show(axes, work, np.where(work.high, work.likeness, np.nan), cmap="RdYlGn", vmin=-1, vmax=1)
    figure.colorbar(drawn, ax=axes, label="likeness: -1 roof, +1 tree", shrink=0.7)


def _mask(figure: Figure, work: Work) -> None:
    _size(figure, work)
    colours = np.ones((*work.roof.shape, 3))
    colours[work.roof & work.mask] = (0.25, 0.25, 0.25)
    colours[work.mask & ~work.roof] = (0.2, 0.45, 0.9)
    colours[work.roof & ~work.mask] = (0.9, 0.25, 0.2)
    _show(figure.add_subplot(), work, colours)


def _outlines(figure: Figure, work: Work) -> None:
    _size(figure, work)
    axes = figure.add_subplot()
    known = work.cues.height[np.isfinite(work.cues.height)]
    top = float(np.percentile(known, 99)) if len(known) else 1.0
    _show(axes, work, np.nan_to_num(work.cues.height), cmap="gray", vmin=0, vmax=1.3 * top)
    _draw(axes, work.traced, edgecolor="white", linewidth=0.6)
    _draw(axes, work.footprints.polygons, edgecolor="#ff3b30", linewidth=1.3)


def _draw(axes: Axes, polygons: NDArray[np.object_], **style: Any) -> None:
    paths = [
        Path.make_compound_path(*[Path(shapely.get_coordinates(ring)) for ring in shapely.get_rings(polygon)])
        for polygon in polygons
    ]
    axes.add_collection(PathCollection(paths, facecolor="none", **style))
