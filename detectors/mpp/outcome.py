"""The result of a run as footprints: a rectangle or an outline each, or blocks of all that is built together."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from .blocks import outline_blocks
from .buildings import outline_buildings
from .energy import ground_variance
from .preparation import Prepared
from .rectangles import to_world
from .roofs import KINDS, fit_roof

__all__ = ["as_blocks", "as_buildings", "fit_roofs"]


def fit_roofs(prepared: Prepared, rectangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what `roofs.fit_roof` says of each rectangle, shape (n, 5)."""
    tables, model = prepared.tables, prepared.model
    share = model.weight * model.fit_weight
    price = model.roof_price / share if share > 0 else math.inf
    fits = np.zeros((len(rectangles), 5))
    for rectangle, fit in zip(rectangles, fits, strict=True):
        explained = ground_variance(rectangle, model)
        fit_roof(
            tables.small,
            tables.large,
            rectangle,
            price,
            model.least_tau,
            explained,
            model.least_height,
            model.cell,
            fit,
        )
    return fits


def as_buildings(
    prepared: Prepared,
    rectangles: NDArray[np.float64],
    fits: NDArray[np.float64],
    energies: NDArray[np.float64],
    *,
    follow_cells: bool,
    crs: str | None,
    record: dict[str, Any],
    source: str,
) -> Footprints:
    """Return one footprint a rectangle, with the attributes height, tau, slope (m, m, m/m), roof and energy.

    Footprints are the rectangles, or where `follow_cells` is set and a rectangle is no good outline, its part of the
    block (`buildings`).
    """
    if follow_cells:
        outlines = outline_buildings(rectangles, _blocks(prepared, rectangles), prepared.grid)
    else:
        outlines = shapely.polygons(to_world(rectangles, prepared.grid))
    return Footprints.of(
        outlines,
        crs=crs,
        attributes={
            "height": fits[:, 1],
            "tau": fits[:, 2],
            "slope": fits[:, 4],
            "roof": np.array([KINDS[int(kind)] for kind in fits[:, 3]], dtype=str),
            "energy": energies,
        },
        metadata=record,
        source=source,
    )


def as_blocks(
    prepared: Prepared, rectangles: NDArray[np.float64], *, crs: str | None, record: dict[str, Any], source: str
) -> Footprints:
    """Return one footprint a block that the rectangles belong to, outlined along its cells (`blocks`)."""
    return Footprints.of(_blocks(prepared, rectangles), crs=crs, metadata=record, source=source)


def _blocks(prepared: Prepared, rectangles: NDArray[np.float64]) -> NDArray[np.object_]:
    return outline_blocks(rectangles, prepared.grid, prepared.state, prepared.score)
