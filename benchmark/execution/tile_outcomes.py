"""The outcomes of the tiles of a city as files, and the city that they make."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from ...detectors.seams import TileFacts, tile_facts
from ...detectors.tiling import Tile
from ...scenes.geodata.footprints import Footprints
from ..store.outcomes import Cost, Outcome

__all__ = ["TileSurvey", "stored_parts", "survey_tiles", "tile_of_file"]


class TileSurvey(NamedTuple):
    """What the finished tiles say besides their footprints.

    Attributes
    ----------
    facts : TileFacts
        What must be known before they are joined.
    skipped : dict of Tile to str
        Tiles that lack an input of the detector, with the reason.
    cost : Cost
        Times of all tiles together, highest memory of one of them.
    notes : tuple of str
        Of all tiles, each once.
    cues : mapping of str to int
        Tiles by the cues that the detector used there, where it names them.
    """

    facts: TileFacts
    skipped: dict[Tile, str]
    cost: Cost
    notes: tuple[str, ...]
    cues: Mapping[str, int]


def tile_of_file(file: Path, side: float) -> Tile:
    """Return the tile of a file, which is called ``COLUMN_ROW.KEY``."""
    column, row = map(int, file.name.partition(".")[0].split("_"))
    return Tile(row, column, side)


def survey_tiles(files: Mapping[Tile, Path]) -> TileSurvey:
    """Read the outcomes of finished tiles one by one, and keep none."""
    skipped: dict[Tile, str] = {}
    notes: dict[str, None] = {}
    cues: dict[str, int] = {}
    seconds, cpu_seconds, peak = 0.0, 0.0, 0

    def parts() -> Iterator[tuple[Tile, Footprints]]:
        nonlocal seconds, cpu_seconds, peak
        for tile, outcome in _outcomes(files):
            seconds, cpu_seconds = seconds + outcome.cost.seconds, cpu_seconds + outcome.cost.cpu_seconds
            peak = max(peak, outcome.cost.peak_memory or 0)
            if outcome.status == "skipped":
                skipped[tile] = str(outcome.reason)
            elif outcome.status == "ok":
                notes.update(dict.fromkeys(outcome.metadata.get("notes", ())))
                used = ", ".join(map(str, outcome.metadata.get("cues", ())))
                if used:
                    cues[used] = cues.get(used, 0) + 1
                yield tile, _footprints(outcome)

    facts = tile_facts(parts())
    cost = Cost(seconds=seconds, cpu_seconds=cpu_seconds, peak_memory=peak)
    return TileSurvey(facts, skipped, cost, tuple(notes), cues)


def stored_parts(files: Mapping[Tile, Path]) -> Iterator[tuple[Tile, Footprints]]:
    """Yield what each finished tile found, by row and column."""
    for tile, outcome in _outcomes(files):
        if outcome.status == "ok":
            yield tile, _footprints(outcome)


def _outcomes(files: Mapping[Tile, Path]) -> Iterator[tuple[Tile, Outcome]]:
    for tile, file in sorted(files.items()):
        yield tile, Outcome.from_bytes(file.read_bytes())


def _footprints(outcome: Outcome) -> Footprints:
    polygons = np.empty(len(outcome.detections), dtype=object)
    polygons[:] = shapely.from_wkb(list(outcome.detections))
    columns = {name: np.array(column) for name, column in outcome.attributes.items()}
    return dataclasses.replace(Footprints(polygons=polygons), attributes=columns)
