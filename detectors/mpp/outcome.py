"""The result of a run as footprints: a rectangle or an outline each, or blocks of all that is built together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from .arrays import Floats, Rectangles
from .blocks import outline_blocks
from .buildings import outline_buildings
from .energy import ground_variance
from .preparation import Prepared
from .rectangles import to_world
from .roofs import KINDS, RoofFit, fit_roof

__all__ = ["as_blocks", "as_buildings", "fit_roofs"]


def fit_roofs(prepared: Prepared, rectangles: Rectangles) -> list[RoofFit]:
    """Return the roof of each rectangle."""
    model = prepared.model
    rules = model.roof_rules
    return [fit_roof(prepared.tables, one, rules, ground_variance(one, model)) for one in rectangles]


def as_buildings(
    prepared: Prepared,
    rectangles: Rectangles,
    fits: Sequence[RoofFit],
    energies: Floats,
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
            "height": np.array([fit.height for fit in fits], dtype=np.float64),
            "tau": np.array([fit.tau for fit in fits], dtype=np.float64),
            "slope": np.array([fit.slope for fit in fits], dtype=np.float64),
            "roof": np.array([KINDS[fit.kind] for fit in fits], dtype=str),
            "energy": energies,
        },
        metadata=record,
        source=source,
    )


def as_blocks(
    prepared: Prepared, rectangles: Rectangles, *, crs: str | None, record: dict[str, Any], source: str
) -> Footprints:
    """Return one footprint a block that the rectangles belong to, outlined along its cells (`blocks`)."""
    return Footprints.of(_blocks(prepared, rectangles), crs=crs, metadata=record, source=source)


def _blocks(prepared: Prepared, rectangles: Rectangles) -> NDArray[np.object_]:
    return outline_blocks(rectangles, prepared.grid, prepared.state, prepared.score)
