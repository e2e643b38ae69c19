"""The outcomes of the tiles of a city as files, and the city that they make."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from ...detectors.base import Declaration, Detector
from ...detectors.tiling import Seams, Tile, join_tiles
from ...scenes.geodata.footprints import Footprints
from ..store.outcomes import Cost, Outcome

__all__ = ["JoinedTiles", "join_outcomes", "tile_of_file"]


class JoinedTiles(NamedTuple):
    """A city.

    Attributes
    ----------
    footprints : Footprints
    seams : Seams
    skipped : dict of Tile to str
        Tiles that lack an input of the detector, with the reason.
    cost : Cost
        Times of all tiles together, highest memory of one of them.
    notes : tuple of str
        Of all tiles, each once.
    """

    footprints: Footprints
    seams: Seams
    skipped: dict[Tile, str]
    cost: Cost
    notes: tuple[str, ...]


def tile_of_file(file: Path, side: float) -> Tile:
    """Return the tile of a file, which is called ``COLUMN_ROW.KEY``."""
    column, row = map(int, file.name.partition(".")[0].split("_"))
    return Tile(row, column, side)


def join_outcomes(files: Mapping[Tile, Path], detector: Detector | Declaration, crs: str | None) -> JoinedTiles:
    """Join the stored outcomes of the tiles that are finished."""
    parts: dict[Tile, Footprints] = {}
    skipped: dict[Tile, str] = {}
    notes: dict[str, None] = {}
    seconds, cpu_seconds, peak = 0.0, 0.0, 0
    for tile, file in sorted(files.items()):
        outcome = Outcome.from_bytes(file.read_bytes())
        seconds, cpu_seconds = seconds + outcome.cost.seconds, cpu_seconds + outcome.cost.cpu_seconds
        peak = max(peak, outcome.cost.peak_memory or 0)
        if outcome.status == "skipped":
            skipped[tile] = str(outcome.reason)
        elif outcome.status == "ok":
            parts[tile] = _footprints(outcome)
            notes.update(dict.fromkeys(outcome.metadata.get("notes", ())))
    found, seams = join_tiles(parts, crs=crs, numbers=detector.numbers, source=detector.name)
    cost = Cost(seconds=seconds, cpu_seconds=cpu_seconds, peak_memory=peak)
    return JoinedTiles(found, seams, skipped, cost, tuple(notes))


def _footprints(outcome: Outcome) -> Footprints:
    polygons = np.empty(len(outcome.detections), dtype=object)
    polygons[:] = shapely.from_wkb(list(outcome.detections))
    columns = {name: np.array(column) for name, column in outcome.attributes.items()}
    return dataclasses.replace(Footprints(polygons=polygons), attributes=columns)
