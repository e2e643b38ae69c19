"""Tiling: a detector over an extent that does not fit in memory.

Nouns
-----
tile
    Square of a grid that is fixed in absolute coordinates, named by column and row. Its *core* is half open; border
    tiles of a scene own what is centred beyond the scene, too.
halo
    Metres around the core that a detector sees besides it (`Detector.halo`).
owner
    The tile whose core holds the centre of a footprint; only the owner keeps it.
spare
    A footprint that a tile found a little beyond its core. Its owner may see another building there, centred elsewhere.
cut
    A footprint that reaches the rim of a tile's halo inside the scene: the tile may not see all of it.
seam pass
    What follows the last tile (`detectors.seams`).

A tile depends on the scene and on its column and row, never on another tile, so that the result is independent of the
order of the tiles and of the number of workers.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import statistics
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from ..core.errors import RoofbenchError
from ..scenes.geodata.footprints import Footprints
from ..scenes.ground.lowest_points import default_cell
from ..scenes.scene import Scene
from .base import Declaration, Detector

__all__ = [
    "CUT",
    "SPARE",
    "Measured",
    "Tile",
    "measure",
    "owned",
    "stream_of",
    "tiles_of",
    "tiles_over",
]

#: Attributes of the footprints of a tile that say which are cut and which are spare; `join_tiles` removes them.
CUT, SPARE = "cut_by_tile", "spare_of_tile"
#: Metres around a core in which footprints are spare.
_NEAR = 30.0
#: Metres from the rim of the halo within which a footprint counts as cut.
_RIM = 1.0
#: Number of places at which a scene is measured and surveyed, their width and their halo, metres.
_SAMPLES, _SURVEYED, _SAMPLE_WIDTH, _SAMPLE_HALO = 5, 16, 240.0, 30.0

_Extent = tuple[float, float, float, float]


@dataclass(frozen=True, order=True)
class Tile:
    """A square of the fixed grid: column from west to east, row from south to north, side in metres."""

    row: int
    column: int
    side: float

    @property
    def core(self) -> _Extent:
        """``(xmin, ymin, xmax, ymax)``, metres."""
        west, south = self.column * self.side, self.row * self.side
        return west, south, west + self.side, south + self.side

    @property
    def label(self) -> str:
        """``x 84992 y 447488``: the south-west corner."""
        return f"x {self.core[0]:.0f} y {self.core[1]:.0f}"

    def ends(self, whole: _Extent) -> tuple[bool, bool, bool, bool]:
        """Return on which sides, west, south, east and north, a scene of an extent ends with the tile."""
        west, south, east, north = self.core
        return west <= whole[0], south <= whole[1], east >= whole[2], north >= whole[3]

    def owns(self, centres: NDArray[np.float64], whole: _Extent) -> NDArray[np.bool_]:
        """Return which centres, shape (n, 2), belong to the tile in a scene of an extent."""
        beyond = (-math.inf, -math.inf, math.inf, math.inf)
        west, south, east, north = (
            far if ends else edge for ends, edge, far in zip(self.ends(whole), self.core, beyond, strict=True)
        )
        x, y = centres[:, 0], centres[:, 1]
        return np.asarray((x >= west) & (x < east) & (y >= south) & (y < north))

    def depth(self, centres: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of centres from the border of the core, metres; negative beyond it."""
        west, south, east, north = self.core
        x, y = centres[:, 0], centres[:, 1]
        return np.asarray(np.minimum.reduce([x - west, east - x, y - south, north - y]))


class Measured(NamedTuple):
    """What all tiles of a scene share.

    Attributes
    ----------
    parameters : dict of str to float
        Parameters that the detector measures (`Detector.measured`).
    ground_cell : float, optional
        Cell size of the ground filter, metres.
    whole : dict
        Sums of what the detector counts (`Detector.survey`).
    """

    parameters: dict[str, float]
    ground_cell: float | None
    whole: dict[str, Any]


def tiles_over(extent: _Extent, side: float) -> list[Tile]:
    """Return the tiles that an extent meets, by row and column.

    >>> [tile.core[:2] for tile in tiles_over((100, 0, 600, 400), 512)]
    [(0, 0), (512, 0)]
    """
    (west, east), (south, north) = (_indices(extent[axis], extent[axis + 2], side) for axis in (0, 1))
    return [Tile(row, column, side) for row in range(south, north) for column in range(west, east)]


def tiles_of(scene: Scene, side: float, halo: float) -> list[Tile]:
    """Return the tiles of a scene that see something of it: between two towns there may be none for many kilometres."""
    return [tile for tile in tiles_over(scene.extent, side) if not scene.is_empty(tile.core, halo)]


def _indices(low: float, high: float, side: float) -> tuple[int, int]:
    """Return the first tile and the one after the last along an axis; the quotient may round past a border."""
    first, last = math.floor(low / side), math.ceil(high / side)
    return first - (first * side > low), last + (last * side < high)


def stream_of(seed: int, tile: Tile, detector: Detector | Declaration) -> np.random.Generator:
    """Return the random stream of a tile: from seed, column and row, or from the seed alone (`place_streams`)."""
    entropy = [seed] if detector.place_streams else [seed, tile.column % 2**32, tile.row % 2**32]
    return np.random.default_rng(np.random.SeedSequence(entropy))


def measure(scene: Scene, detector: Detector, tiles: Sequence[Tile]) -> Measured:
    """Return what all tiles share.

    What a detector measures is the lower median over up to five tiles, and what it counts the sum over up to sixteen.
    Only the middle of each tile is read. Tiles without points and tiles that cannot be read are skipped; the latter are
    reported when they are processed.
    """
    found: dict[str, list[float]] = defaultdict(list)
    cells: list[float] = []
    for part in itertools.islice(_samples(scene, tiles), _SAMPLES):
        assert part.points is not None
        cells.append(default_cell(part.points.x, part.points.y, part.extent))
        part.ground_cell = cells[-1]
        for name, value in detector.measured(part).items():
            found[name].append(float(value))
    parameters = {name: statistics.median_low(values) for name, values in sorted(found.items())}
    ground_cell = statistics.median_low(cells) if cells else None
    whole: dict[str, Any] = {}
    fixed = detector.replaced(parameters)
    if type(fixed).survey is not Detector.survey:
        for part in itertools.islice(_samples(scene, tiles), _SURVEYED):
            part.ground_cell = ground_cell
            for name, counts in fixed.survey(part).items():
                whole[name] = np.add(whole.get(name, 0), counts).tolist()
    return Measured(parameters, ground_cell, whole)


def _samples(scene: Scene, tiles: Sequence[Tile]) -> Iterator[Scene]:
    """Yield the middles of tiles that lie far apart, those with points."""
    for tile in _spread(tiles):
        part = _middle(scene, tile)
        if part is not None and part.points is not None and len(part.points):
            yield part


def _spread(tiles: Sequence[Tile]) -> list[Tile]:
    """Return the tiles in an order in which the first few lie far apart (golden section)."""
    golden = (math.sqrt(5) - 1) / 2
    return [tiles[i] for i in np.argsort([(0.5 + golden * k) % 1 for k in range(len(tiles))], kind="stable").tolist()]


def _middle(scene: Scene, tile: Tile) -> Scene | None:
    west, south, east, north = tile.core
    low_x, low_y = max(west, scene.extent[0]), max(south, scene.extent[1])
    high_x, high_y = min(east, scene.extent[2]), min(north, scene.extent[3])
    x, y, reach = (low_x + high_x) / 2, (low_y + high_y) / 2, min(_SAMPLE_WIDTH, tile.side) / 2
    try:
        part = scene.window((x - reach, y - reach, x + reach, y + reach), _SAMPLE_HALO).for_detection()
        _ = part.points, part.image, part.dem
    except RoofbenchError:
        return None
    return part


def owned(found: Footprints, tile: Tile, part: _Extent, whole: _Extent) -> Footprints:
    """Return the footprints that a tile owns and those that are spare, with the attributes `CUT` and `SPARE`.

    Parameters
    ----------
    found : Footprints
        All that was detected in the window of the tile.
    tile : Tile
    part, whole : tuple of float
        Extents of the window, halo included, and of the scene.
    """
    own = tile.owns(found.centres, whole) if len(found) else np.zeros(0, dtype=np.bool_)
    kept = own | (tile.depth(found.centres) >= -_NEAR) if len(found) else own
    found, spare = found.take(kept), ~own[kept]
    bounds = shapely.bounds(found.polygons).reshape(-1, 4)
    cut = np.zeros(len(found), dtype=np.bool_)
    for side, sign in enumerate((1, 1, -1, -1)):
        if part[side] != whole[side]:
            cut |= sign * (bounds[:, side] - part[side]) <= _RIM
    # What a tile sees in part and does not own is seen whole by others.
    found, spare, cut = found.take(~(spare & cut)), spare[~(spare & cut)], cut[~(spare & cut)]
    return dataclasses.replace(found, attributes={**found.attributes, CUT: cut, SPARE: spare})
