"""The steps of a run as data: cells, evidence, boxes, convergence and result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..steps import Axis, ChartPanel, Curve, Layer, MapPanel, OutlineLayer, ReliefRaster, Role, Scale, Step, ValueRaster
from .cells import HIGH
from .preparation import Prepared
from .rectangles import to_world
from .tables import MILLI

__all__ = ["convergence_step", "mpp_steps"]


def mpp_steps(prepared: Prepared, buildings: NDArray[np.object_], trace: Mapping[str, Any] | None) -> Iterator[Step]:
    """Yield the steps of a run.

    Parameters
    ----------
    prepared : Prepared
    buildings : ndarray of Polygon
        Outlines of the result.
    trace : mapping or None
        Columns of the chain, absent from a search: ``proposals``, ``energy``, ``temperature``, ``buildings`` and, by
        move, ``tried`` and ``accepted``.
    """
    extent = prepared.grid.extent
    metres = np.where(prepared.state == HIGH, 0.01 * prepared.height, np.nan)
    relief = ReliefRaster(metres, extent)
    known = metres[np.isfinite(metres)]
    top = max(1.0, float(np.percentile(known, 99))) if len(known) else 1.0
    heights = Scale(label="height above ground", unit="m", low=0, high=top)
    yield _map(
        prepared, "heights", "Heights above ground of high cells.", ValueRaster(metres, extent, heights, "not high")
    )
    evidence = Scale(label="evidence of a roof", unit="nats per m²", low=-4, high=4, kind="diverging")
    yield _map(
        prepared,
        "evidence",
        "What each cell adds to a rectangle: positive values support a roof, negative ones count against it.",
        ValueRaster(prepared.score / MILLI, extent, evidence),
    )
    boxes = shapely.polygons(to_world(prepared.boxes.rectangles, prepared.grid))
    yield _map(
        prepared,
        "boxes",
        "Boxes that the data suggest, on shaded heights.",
        relief,
        OutlineLayer(boxes, "suggested box", Role.CANDIDATE),
    )
    if trace is not None:
        yield convergence_step(trace)
    yield _map(
        prepared,
        "buildings",
        "Buildings after the local search, on shaded heights.",
        relief,
        OutlineLayer(buildings, "building", Role.RESULT),
    )


def _map(prepared: Prepared, name: str, caption: str, *layers: Layer) -> Step:
    return Step(name, caption, (MapPanel(extent=prepared.grid.extent, layers=layers),))


def convergence_step(trace: Mapping[str, Any]) -> Step:
    """Return the convergence of a simulation; `trace` may lack any column but ``proposals``."""
    proposals = Axis(label="proposals")
    count = np.asarray(trace["proposals"])
    panels = [
        ChartPanel(x=proposals, y=axis, series=(Curve(count, np.asarray(trace[column])),))
        for column, axis in (
            ("energy", Axis(label="energy")),
            ("temperature", Axis(label="temperature", logarithmic=True)),
            ("buildings", Axis(label="buildings")),
        )
        if column in trace
    ]
    if trace.get("tried"):
        curves = tuple(
            Curve(count, _share(np.asarray(trace["accepted"][move]), np.asarray(tried)), move)
            for move, tried in trace["tried"].items()
        )
        panels.append(ChartPanel(x=proposals, y=Axis(label="accepted", unit="%", logarithmic=True), series=curves))
    return Step("convergence", "How the simulation went, and the accepted share of each move.", tuple(panels))


def _share(accepted: NDArray[np.float64], tried: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the accepted share over ten rows, since single rows hold few births; NaN where nothing was accepted."""
    window = np.ones(10)
    share = np.convolve(accepted, window, mode="same") / np.maximum(np.convolve(tried, window, mode="same"), 1)
    return np.where(share > 0, share, np.nan)
