"""Pictures of a run: cells, evidence, boxes, convergence and result, for ``roofbench detect --steps``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from .cells import HIGH
from .tables import MILLI

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .preparation import Prepared

__all__ = ["draw_convergence", "draw_evidence", "draw_heights", "draw_outlines"]


def _extent(prepared: Prepared) -> tuple[float, float, float, float]:
    west, south, east, north = prepared.grid.extent
    return west, east, south, north


def _finish(axes: Axes) -> None:
    axes.set_aspect("equal")
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.tick_params(labelsize=7)
    axes.set_xlabel("east (m)", fontsize=8)
    axes.set_ylabel("north (m)", fontsize=8)


def _shade(prepared: Prepared, axes: Axes) -> None:
    metres = np.where(prepared.state == HIGH, 0.01 * prepared.height, 0.0)
    south, east = np.gradient(metres, prepared.grid.gsd) if min(metres.shape) > 1 else (metres, metres)
    axes.imshow(np.clip(0.75 + 0.18 * (east - south), 0, 1), cmap="gray", vmin=0, vmax=1, extent=_extent(prepared))


def draw_heights(prepared: Prepared, figure: Figure) -> None:
    """Draw the heights above ground of high cells over a shaded relief."""
    axes = figure.add_subplot()
    _shade(prepared, axes)
    metres = np.ma.masked_where(prepared.state != HIGH, 0.01 * prepared.height)
    top = float(np.percentile(metres.compressed(), 99)) if metres.count() else 1.0
    image = axes.imshow(metres, cmap="viridis", alpha=0.6, vmin=0, vmax=max(top, 1.0), extent=_extent(prepared))
    figure.colorbar(image, ax=axes, shrink=0.7, label="height above ground (m)")
    _finish(axes)


def draw_evidence(prepared: Prepared, figure: Figure) -> None:
    """Draw the score of each cell: blue speaks for a roof, red against it."""
    axes = figure.add_subplot()
    nats, place = prepared.score / MILLI, _extent(prepared)
    image = axes.imshow(nats, cmap="RdBu", vmin=-4, vmax=4, extent=place, interpolation="nearest")
    figure.colorbar(image, ax=axes, shrink=0.7, label="score (nats per m²)")
    _finish(axes)


def draw_outlines(
    prepared: Prepared, polygons: NDArray[np.object_], figure: Figure, *, colour: str = "crimson"
) -> None:
    """Draw outlines, with their holes, over the shaded relief."""
    from matplotlib.collections import LineCollection

    axes = figure.add_subplot()
    _shade(prepared, axes)
    rings = shapely.get_rings(shapely.get_parts(polygons))
    axes.add_collection(
        LineCollection([shapely.get_coordinates(ring) for ring in rings], colors=colour, linewidths=0.8)
    )
    west, east, south, north = _extent(prepared)
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    _finish(axes)


def draw_convergence(trace: Mapping[str, Any], figure: Figure) -> None:
    """Draw energy, temperature, number of buildings and acceptance per move against the number of proposals."""
    from matplotlib.ticker import LogLocator, NullFormatter

    proposals = np.asarray(trace["proposals"])
    upper, middle, lower = figure.subplots(3, 1, sharex=True)
    upper.plot(proposals, trace["energy"], color="navy")
    upper.set_ylabel("energy")
    hot = upper.twinx()
    hot.plot(proposals, trace["temperature"], color="firebrick", linestyle="--")
    hot.set_yscale("log")
    hot.set_ylabel("temperature", color="firebrick")
    middle.plot(proposals, trace["buildings"], color="seagreen")
    middle.set_ylabel("buildings")
    for move, tried in trace.get("tried", {}).items():
        # Mean over ten rows: single rows hold few births.
        window = np.ones(10)
        total = np.convolve(tried, window, mode="same")
        share = np.convolve(trace["accepted"][move], window, mode="same") / np.maximum(total, 1)
        lower.plot(proposals, np.where(share > 0, share, np.nan), label=move, linewidth=1)
    if trace.get("tried"):
        lower.set_yscale("log")
        lower.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        lower.yaxis.set_major_formatter(lambda share, _: f"{100 * share:g} %")
        lower.yaxis.set_minor_formatter(NullFormatter())
        lower.legend(ncol=8, fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.3), frameon=False)
    lower.set_ylabel("accepted share")
    lower.set_xlabel("proposals")
