"""Pictures of the steps of a line detector, after figures 2 to 6 of the papers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from ..base import Step
from ..scale_bar import add_scale_bar
from .boxes import Boxes, box_centres, box_corners, lengths, widths
from .texture import BIN_COUNT, Texture
from .trace import Fate, Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_steps"]

#: Largest side of a drawn raster, pixels: more is not seen and makes large files.
_DRAWN = 1600
_FATE_COLOURS = {
    Fate.RECTANGLE: "#0050d0",
    Fate.INSIDE: "#3fa7ff",
    Fate.NARROW: "#9b59b6",
    Fate.VEGETATION: "#d62728",
    Fate.UNADJUSTED: "#ff8c00",
    Fate.OUTVOTED: "#e6007e",
    Fate.BORDER: "#707070",
}
_KEPT, _LOST, _TWICE = "#ffd400", "#ff2a2a", "#00d5e0"


def draw_steps(trace: Trace) -> Iterator[Step]:
    """Yield one picture per step of a detection."""
    drawings: list[tuple[str, str, Callable[[Figure], None]]] = [
        (
            "masks",
            "Orthoimage, vegetation index, primary mask (black: no ground) and secondary mask (black: something high).",
            lambda figure: _masks(figure, trace),
        ),
        (
            "lines",
            "Lines around the black shapes; lines dropped for the reason in the key have a circle at their centre.",
            lambda figure: _lines(figure, trace),
        ),
        (
            "extended-lines",
            "Lines as fitted (red) and after adjustment and extension (blue).",
            lambda figure: _extended(figure, trace),
        ),
        ("initial-rectangles", "Initial rectangles on the primary mask.", lambda figure: _initial(figure, trace)),
    ]
    if trace.votes is not None:
        caption = "Mean vote of each extended line; lines at or below one half are dropped (circles)."
        drawings.append(("votes", caption, lambda figure: _votes(figure, trace)))
    drawings.append(("final-rectangles", _final_caption(trace), lambda figure: _final(figure, trace)))
    if (texture := trace.texture) is not None:
        caption = "Edge orientation histograms of the largest candidates, with the tests that each passes."
        drawings.append(("histograms", caption, lambda figure: _histograms(figure, trace, texture)))
    for number, (name, caption, draw) in enumerate(drawings, start=1):
        yield Step(f"{number:02d}-{name}", caption, draw)


def _final_caption(trace: Trace) -> str:
    caption = "Final rectangles (yellow), those dropped because larger ones cover them (cyan, dashed)"
    if trace.texture is None:
        return f"{caption}."
    return f"{caption}, candidates without texture of a building (red); digits: the tests passed."


def _axes(figure: Figure, trace: Trace) -> Axes:
    rows, columns = trace.grid.shape
    width = 10.0
    figure.set_size_inches(width, min(14.0, max(4.0, width * rows / columns + 0.8)))
    axes = figure.add_subplot()
    _frame(axes, trace)
    return axes


def _frame(axes: Axes, trace: Trace) -> None:
    rows, columns = trace.grid.shape
    axes.set_xlim(0, columns)
    axes.set_ylim(rows, 0)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    add_scale_bar(axes, unit=trace.grid.gsd)


def _show(axes: Axes, trace: Trace, raster: NDArray[Any], **style: Any) -> None:
    rows, columns = trace.grid.shape
    step = max(1, max(rows, columns) // _DRAWN)
    axes.imshow(raster[::step, ::step], extent=(0, columns, rows, 0), interpolation="nearest", **style)


def _photograph(trace: Trace) -> NDArray[np.float32]:
    bands = [trace.image.values[trace.image.bands.index(name)] for name in ("red", "green", "blue")]
    full = np.float32(np.iinfo(trace.image.values.dtype).max)
    step = max(1, max(trace.grid.shape) // _DRAWN)
    return np.asarray(np.stack([band[::step, ::step] for band in bands], axis=-1).astype(np.float32) / full)


def _show_photograph(axes: Axes, trace: Trace, *, faint: bool = False) -> None:
    """Show the orthoimage, in colour or, under coloured lines, in light grey."""
    rows, columns = trace.grid.shape
    colours = _photograph(trace)
    style: dict[str, Any] = {}
    if faint:
        colours = 0.55 + 0.45 * colours.mean(axis=-1)
        style = {"cmap": "gray", "vmin": 0, "vmax": 1}
    axes.imshow(colours, extent=(0, columns, rows, 0), interpolation="nearest", **style)


def _masks(figure: Figure, trace: Trace) -> None:
    rows, columns = trace.grid.shape
    figure.set_size_inches(12.0, min(16.0, max(5.0, 12.0 * rows / columns + 0.6)))
    figure.set_layout_engine("constrained")
    panels = figure.subplots(2, 2)
    _show_photograph(panels[0, 0], trace)
    panels[0, 0].set_title("orthoimage")
    _show(panels[0, 1], trace, np.diff(trace.vegetation, axis=1), cmap="YlGn", vmin=0, vmax=128)
    panels[0, 1].set_title("vegetation index (0 to 128 and more)")
    _show(panels[1, 0], trace, 1 - trace.masks.primary, cmap="gray", vmin=0, vmax=1)
    panels[1, 0].set_title("primary mask")
    _show(panels[1, 1], trace, 1 - trace.masks.secondary, cmap="gray", vmin=0, vmax=1)
    panels[1, 1].set_title("secondary mask")
    for axes in panels.flat:
        _frame(axes, trace)


def _segments(lines: Boxes) -> NDArray[np.float64]:
    return box_corners(lines)[:, :2]


def _key(axes: Axes, entries: list[tuple[str, str, int]]) -> None:
    handles = [Line2D([], [], color=colour, lw=2, label=f"{label} ({count})") for label, colour, count in entries]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.01), ncol=3, frameon=False, fontsize=8)


def _lines(figure: Figure, trace: Trace) -> None:
    axes = _axes(figure, trace)
    _show_photograph(axes, trace, faint=True)
    entries = []
    for fate, colour in _FATE_COLOURS.items():
        chosen = trace.fates == fate
        if not chosen.any():
            continue
        axes.add_collection(LineCollection(list(_segments(trace.fitted[chosen])), colors=colour, linewidths=1.2))
        entries.append((fate.label, colour, int(chosen.sum())))
        if fate in (Fate.VEGETATION, Fate.UNADJUSTED, Fate.OUTVOTED, Fate.NARROW):
            x, y = box_centres(trace.fitted[chosen]).T
            axes.scatter(x, y, s=14, facecolors="none", edgecolors=colour, linewidths=0.8)
    if trace.rescued.any():
        x, y = box_centres(trace.fitted[trace.rescued]).T
        axes.scatter(x, y, s=26, marker="D", facecolors="none", edgecolors="#00a65a", linewidths=1.0)
        entries.append(("kept by entropy (diamond)", "#00a65a", int(trace.rescued.sum())))
    _key(axes, entries)


def _extended(figure: Figure, trace: Trace) -> None:
    axes = _axes(figure, trace)
    _show(axes, trace, 1.0 - 0.35 * trace.masks.primary, cmap="gray", vmin=0, vmax=1)
    alive = np.isin(trace.fates, (Fate.RECTANGLE, Fate.INSIDE, Fate.NARROW, Fate.OUTVOTED))
    axes.add_collection(LineCollection(list(_segments(trace.lines[alive])), colors="#0050d0", linewidths=1.0))
    axes.add_collection(LineCollection(list(_segments(trace.fitted[alive])), colors="#d62728", linewidths=1.8))
    gained = float((lengths(trace.lines[alive]) - lengths(trace.fitted[alive])).sum()) * trace.grid.gsd
    count = int(alive.sum())
    _key(axes, [("as fitted", "#d62728", count), (f"extended, {gained:.0f} m gained", "#0050d0", count)])


def _outlines(axes: Axes, boxes: Boxes, colour: str, **style: Any) -> None:
    if len(boxes):
        shapes = PolyCollection(list(box_corners(boxes)), facecolors="none", edgecolors=colour, **style)
        axes.add_collection(shapes)


def _initial(figure: Figure, trace: Trace) -> None:
    axes = _axes(figure, trace)
    _show(axes, trace, 1.0 - 0.35 * trace.masks.primary, cmap="gray", vmin=0, vmax=1)
    dropped = trace.initial_fates < 0
    _outlines(axes, trace.initial[~dropped], "#0050d0", linewidths=1.2)
    _outlines(axes, trace.initial[dropped], "#d62728", linewidths=1.0, linestyles="--")
    entries = [("initial rectangle", "#0050d0", int((~dropped).sum()))]
    entries.append(("later wholly inside a final one", "#d62728", int(dropped.sum())))
    _key(axes, entries)


def _votes(figure: Figure, trace: Trace) -> None:
    assert trace.votes is not None
    axes = _axes(figure, trace)
    _show_photograph(axes, trace, faint=True)
    voted = ~np.isnan(trace.votes[:, 0])
    mean = trace.votes[voted].mean(axis=1)
    lines = LineCollection(list(_segments(trace.lines[voted])), cmap="RdYlBu", linewidths=1.8)
    lines.set_array(mean)
    lines.set_clim(0, 1)
    axes.add_collection(lines)
    x, y = box_centres(trace.lines[trace.fates == Fate.OUTVOTED]).T
    axes.scatter(x, y, s=14, facecolors="none", edgecolors="#b00000", linewidths=0.8)
    figure.colorbar(lines, ax=axes, shrink=0.6, label="mean vote")


def _final(figure: Figure, trace: Trace) -> None:
    axes = _axes(figure, trace)
    _show_photograph(axes, trace)
    twice, lost = trace.candidates[trace.duplicates], trace.candidates[~trace.kept & ~trace.duplicates]
    _outlines(axes, twice, _TWICE, linewidths=0.8, linestyles="--")
    _outlines(axes, lost, _LOST, linewidths=1.0)
    _outlines(axes, trace.final, _KEPT, linewidths=1.4)
    entries = [("building", _KEPT, len(trace.final))]
    entries += [("seen again", _TWICE, len(twice))] if len(twice) else []
    if trace.texture is not None:
        entries.append(("no texture of a building", _LOST, len(lost)))
        # Off the centre, which rectangles of one house share.
        places = 0.7 * box_centres(trace.candidates) + 0.3 * box_corners(trace.candidates)[:, 0]
        for (x, y), passed in zip(places, trace.texture.passed, strict=True):
            text = "".join(str(number + 1) for number in np.flatnonzero(passed))
            edge = [withStroke(linewidth=1.2, foreground="black")]
            axes.text(x, y, text, color="white", fontsize=8, ha="center", va="center", path_effects=edge)
    _key(axes, entries)


def _histograms(figure: Figure, trace: Trace, texture: Texture) -> None:
    by_area = np.argsort(-(box_areas := _areas(trace)), kind="stable")
    passing = trace.kept | trace.duplicates
    chosen = [*by_area[passing[by_area]][:6], *by_area[~passing[by_area]][:6]]
    figure.set_size_inches(12, 7.5)
    figure.set_layout_engine("constrained")
    if not chosen:
        figure.text(0.5, 0.5, "no candidate", ha="center")
        return
    panels = figure.subplots(max(1, -(-len(chosen) // 4)), 4, squeeze=False)
    degrees = -92.5 + 5.0 * np.arange(BIN_COUNT) + 2.5
    for axes, candidate in zip(panels.flat, chosen, strict=False):
        histogram = texture.collective[candidate]
        axes.bar(degrees, histogram, width=4.4, color="#0050d0" if passing[candidate] else _LOST)
        axes.axhline(histogram.mean(), color="black", lw=0.8, ls="--")
        tests = ", ".join(f"T{number + 1}" for number in np.flatnonzero(texture.passed[candidate]))
        axes.set_title(f"{box_areas[candidate]:.0f} m²: {tests or 'no test'}", fontsize=8)
        axes.set_xticks([-90, -45, 0, 45], ["±90°", "-45°", "0°", "45°"], fontsize=7)
        axes.tick_params(axis="y", labelsize=7)
    for axes in panels[:, 0]:
        axes.set_ylabel("length of edges, m", fontsize=8)
    for axes in panels.flat[len(chosen) :]:
        axes.set_axis_off()


def _areas(trace: Trace) -> NDArray[np.float64]:
    return np.asarray(lengths(trace.candidates) * widths(trace.candidates) * trace.grid.gsd**2)
