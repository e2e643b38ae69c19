"""The result of a run as footprints: parts, buildings or blocks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from .arrays import Floats, Rectangles
from .blocks import outline_blocks
from .energy import ground_variance
from .preparation import Prepared
from .rectangles import to_world
from .roofs import KINDS, RoofFit, fit_roof
from .rows import find_levels

__all__ = ["as_footprints", "fit_roofs"]

#: Metres around the core of a scene in which footprints are made, and around a block in which rectangles divide it.
_AROUND, _BESIDE = 40.0, 25.0


def fit_roofs(prepared: Prepared, rectangles: Rectangles) -> list[RoofFit]:
    """Return the roof of each rectangle."""
    model = prepared.model
    rules = model.roof_rules
    return [fit_roof(prepared.tables, one, rules, ground_variance(one, model)) for one in rectangles]


def _near(outlines: NDArray[np.object_], blocks: NDArray[np.object_], wanted: Any) -> NDArray[np.bool_]:
    """Return which rectangles decide what is built where it is wanted, and in the blocks that reach there."""
    near = shapely.intersects(outlines, wanted)
    if len(blocks) and len(outlines):
        near[shapely.STRtree(outlines).query(blocks, predicate="dwithin", distance=_BESIDE)[1]] = True
    return np.asarray(near)


def as_footprints(
    prepared: Prepared,
    rectangles: Rectangles,
    fits: Sequence[RoofFit],
    energies: Floats,
    *,
    level: str,
    crs: str | None,
    record: dict[str, Any],
    source: str,
) -> Footprints:
    """Return the footprints of a level (``part``, ``building`` or ``block``), see `rows`.

    Every footprint has the attribute ``part_of``: the number of the building of a part, of the block of a building,
    and of a block its own. Parts and buildings have height, tau, slope (m, m, m/m), roof and energy, too: buildings
    those of their largest part, with the energies added up.
    """
    wanted = shapely.box(*prepared.core).buffer(_AROUND, join_style="mitre")
    blocks = outline_blocks(
        rectangles,
        prepared.grid,
        prepared.height,
        prepared.state,
        prepared.score,
        prepared.openness,
        crown_openness=prepared.background.crown_openness,
        within=wanted,
    )
    near = _near(shapely.polygons(to_world(rectangles, prepared.grid)), blocks, wanted)
    rectangles, energies, fits = rectangles[near], energies[near], [fits[k] for k in np.flatnonzero(near).tolist()]
    if level == "block":
        attributes: dict[str, NDArray[Any]] = {"part_of": np.arange(len(blocks))}
        return Footprints.of(blocks, crs=crs, attributes=attributes, metadata=record, source=source)
    levels = find_levels(
        rectangles, blocks, prepared.height, prepared.state, prepared.grid, prepared.image_of, prepared.structures
    )
    main = levels.rectangle_of_part
    energy: NDArray[Any] = energies[main] / np.bincount(main, minlength=len(rectangles))[main]
    outlines, part_of = levels.parts, levels.building_of_part
    if level == "building":
        outlines, part_of = levels.buildings, levels.block_of_building
        energy = np.bincount(levels.building_of_part, weights=energy, minlength=len(outlines))
        main = main[levels.largest_part]
    return Footprints.of(
        outlines,
        crs=crs,
        attributes={
            "part_of": part_of,
            "height": np.array([fits[k].height for k in main], dtype=np.float64),
            "tau": np.array([fits[k].tau for k in main], dtype=np.float64),
            "slope": np.array([fits[k].slope for k in main], dtype=np.float64),
            "roof": np.array([KINDS[fits[k].kind] for k in main], dtype=str),
            "energy": energy,
        },
        metadata=record,
        source=source,
    )
