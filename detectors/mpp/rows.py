"""Rows: which parts are one building, and which buildings stand wall to wall.

Nouns
-----
part
    What one rectangle describes: a house, a wing, an annex.
block
    All that is built together (`blocks`).
row
    A block at least `_SHORTEST` metres long with at least `_CERTAIN_WALLS` certain party walls, or a long and narrow
    one with `_WALLS_OF_LONG`, of which one part has `_REPEATED`: houses of a row repeat under one line of roofs, while
    the wings of one building have a step each. Bends (`bends`) are certain walls if there are `_CERTAIN_WALLS`; a
    building with wings has one or two. So are those of a run (`runs`), where houses have a part each. The parts of a
    row are cut at their probable party walls, and each piece is a house of its own unless smaller than `_ANNEX`.
building
    A block that is no row with all its parts, or a house of a row with its annexes. A part outside all blocks is a
    building, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.raster import Grid, Image
from .arrays import Rectangles
from .bends import count_bends
from .buildings import block_of, outline_buildings
from .party_walls import CERTAIN, PROBABLE, Wall, most_walls, party_walls, profile_of
from .rectangles import to_world
from .runs import runs_of
from .wall_colours import Colours, colours_of

__all__ = ["Levels", "find_levels"]

#: Certain party walls that make a row of a block, and of one of `_LONG` metres or more that is `_SLENDER` times as long
#: as wide or more.
_CERTAIN_WALLS, _WALLS_OF_LONG = 3, 2
#: Certain party walls that one part of a row has at least, and probable ones of one part that make each other certain.
_REPEATED, _MANY = 2, 5
_LONG, _SLENDER = 25.0, 2.0
#: Metres: shortest row. Villas of two or three wings have as many steps and valleys, but are shorter.
_SHORTEST = 22.5
#: Square metres: smaller pieces of a row belong to the house that they touch most; the smallest piece that is one.
_ANNEX, _PIECE = 15.0, 8.0
#: Metres: pieces so close touch, and by how much outlines are closed when they are joined.
_TOUCH, _CLOSE = 0.3, 0.05
#: Metres: shortest common wall of an annex and its house.
_WALL = 1.0


@dataclass(frozen=True, eq=False)
class Levels:
    """Outlines of parts and of buildings, and how they belong together.

    Attributes
    ----------
    parts : ndarray of polygons, shape (p,)
    rectangle_of_part : ndarray of int64, shape (p,)
        Row of the rectangle that describes a part; a rectangle across several houses describes several parts.
    building_of_part : ndarray of int64, shape (p,)
    buildings : ndarray of polygons, shape (b,)
    block_of_building : ndarray of int64, shape (b,)
        Blocks are numbered first; a building outside all blocks has a number of its own.
    """

    parts: NDArray[np.object_]
    rectangle_of_part: NDArray[np.int64]
    building_of_part: NDArray[np.int64]
    buildings: NDArray[np.object_]
    block_of_building: NDArray[np.int64]

    @property
    def largest_part(self) -> NDArray[np.int64]:
        """Row of the largest part of each building, shape (b,)."""
        order = np.lexsort((-shapely.area(self.parts), self.building_of_part))
        first = np.unique(self.building_of_part[order], return_index=True)[1]
        rows: NDArray[np.int64] = order[first].astype(np.int64)
        return rows


def find_levels(
    rectangles: Rectangles,
    blocks: NDArray[np.object_],
    height: NDArray[np.uint16],
    state: NDArray[np.uint8],
    grid: Grid,
    image_of: Callable[[], Image | None] = lambda: None,
    structures: NDArray[np.uint8] | None = None,
) -> Levels:
    """Return parts and buildings.

    Parameters
    ----------
    rectangles : ndarray, shape (n, 5)
        Grid frame.
    blocks : ndarray of shapely Polygons
        As `blocks.outline_blocks` returns them.
    height : ndarray of uint16, shape (rows, columns)
        Height above ground, cm.
    state : ndarray of uint8, shape (rows, columns)
        See `cells`.
    grid : Grid
    image_of : callable
        Returns the image of the scene; called only where a block has room for a row.
    structures : ndarray of uint8, shape (rows, columns), optional
        Height of what stands on the roofs, cm.
    """
    block = block_of(shapely.polygons(to_world(rectangles, grid)), blocks)
    inside = block >= 0
    room = np.bincount(block[inside], weights=most_walls(rectangles, grid)[inside], minlength=len(blocks))
    # Most blocks are too small for a row, whatever their roofs look like.
    looked_at = inside & np.append(_are_rows(blocks, room), False)[block]
    certain = np.zeros(len(rectangles), dtype=np.int64)
    probable: dict[int, list[Wall]] = {}
    image = image_of() if looked_at.any() else None

    @cache
    def colours(number: int) -> Colours | None:
        return colours_of(blocks[number], image, grid)

    def walls_of(rectangle: Rectangles, number: int) -> tuple[list[Wall], int]:
        """Return the probable walls of a rectangle and the number of certain ones."""
        profile = profile_of(rectangle, height, state, grid, partial(colours, number), structures)
        walls = party_walls(profile, PROBABLE, grid)
        return walls, len(walls if len(walls) >= _MANY else party_walls(profile, CERTAIN, grid))

    for k in np.flatnonzero(looked_at).tolist():
        probable[k], certain[k] = walls_of(rectangles[k], block[k])
    walls_of_block = np.bincount(block[inside], weights=certain[inside], minlength=len(blocks))
    for number in np.unique(block[looked_at]).tolist():
        members = np.flatnonzero(block == number)
        bends, of_part = count_bends(rectangles[members], grid.gsd)
        if bends >= _CERTAIN_WALLS:
            walls_of_block[number] += bends
            certain[members] += of_part
    most_of_block = np.zeros(len(blocks), dtype=np.int64)
    np.maximum.at(most_of_block, block[inside], certain[inside])
    row = _are_rows(blocks, walls_of_block) & (most_of_block >= _REPEATED)
    for number in np.unique(block[looked_at & ~np.append(row, False)[block]]).tolist():
        runs = runs_of(rectangles[block == number], grid.gsd)
        most = max((walls_of(run, number)[1] for run in runs), default=0)
        row[number] = most >= _CERTAIN_WALLS
    # Rows are divided by themselves below.
    outlines = outline_buildings(rectangles, blocks, grid, wanted=~np.append(row, False)[block])
    parts: list[Any] = []
    rectangle_of: list[int] = []
    building_of: list[int] = []
    buildings: list[Any] = []
    block_of_building: list[int] = []
    for k in np.flatnonzero(block < 0).tolist():
        parts.append(outlines[k])
        rectangle_of.append(k)
        building_of.append(len(buildings))
        buildings.append(outlines[k])
        block_of_building.append(len(blocks) + len(block_of_building))
    for number in np.unique(block[block >= 0]).tolist():
        members = np.flatnonzero(block == number)
        if not row[number]:
            parts += list(outlines[members])
            rectangle_of += members.tolist()
            building_of += [len(buildings)] * len(members)
            buildings.append(blocks[number])
            block_of_building.append(number)
            continue
        walls = [probable[k] for k in members.tolist()]
        pieces, owners = _pieces(rectangles[members], blocks[number], walls, grid)
        group = _houses(pieces, owners)
        parts += pieces
        rectangle_of += members[owners].tolist()
        building_of += (group + len(buildings)).tolist()
        houses = [_joined([pieces[k] for k in np.flatnonzero(group == g)]) for g in range(group.max() + 1)]
        buildings += houses
        block_of_building += [number] * len(houses)
    return Levels(
        _objects(parts),
        np.array(rectangle_of, dtype=np.int64),
        np.array(building_of, dtype=np.int64),
        _objects(buildings),
        np.array(block_of_building, dtype=np.int64),
    )


def _are_rows(blocks: NDArray[np.object_], walls: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which blocks are rows, from the number of their certain party walls."""
    corners = shapely.get_coordinates(shapely.oriented_envelope(blocks)).reshape(-1, 5, 2)
    sides = np.sort(np.hypot(*(corners[:, 1:3] - corners[:, :2]).transpose(2, 0, 1)), axis=1)
    slender = (sides[:, 1] >= _LONG) & (sides[:, 1] >= _SLENDER * sides[:, 0])
    enough = walls >= np.where(slender, _WALLS_OF_LONG, _CERTAIN_WALLS)
    return np.asarray(enough & (sides[:, 1] >= _SHORTEST))


def _objects(polygons: list[Any]) -> NDArray[np.object_]:
    array = np.empty(len(polygons), dtype=object)
    array[:] = polygons
    return array


def _pieces(
    rectangles: Rectangles, block: Any, walls: list[list[Wall]], grid: Grid
) -> tuple[list[Any], NDArray[np.int64]]:
    """Return the pieces of a row, which cover its block, and the row of the rectangle of each."""
    zones = outline_buildings(rectangles, _objects([block]), grid, always=True)
    pieces: list[Any] = []
    owners: list[int] = []
    for k, (zone, cuts) in enumerate(zip(zones, walls, strict=True)):
        own = _cut(zone, [_line(wall, grid) for wall in cuts]) if cuts else [zone]
        pieces += own
        owners += [k] * len(own)
    return pieces, np.array(owners, dtype=np.int64)


def _line(wall: Wall, grid: Grid, reach: float = 200.0) -> Any:
    """Return a wall as a line in metres of the CRS, long enough to cross any part."""
    ends = np.stack([wall.point - wall.along * reach / grid.gsd, wall.point + wall.along * reach / grid.gsd])
    x, y = grid.to_world(ends[:, 1], ends[:, 0])
    return shapely.linestrings(np.stack([x, y], axis=1))


def _cut(zone: Any, lines: list[Any]) -> list[Any]:
    """Cut a polygon at lines; pieces below `_PIECE` stay with the one that they touch most."""
    faces = shapely.get_parts(shapely.polygonize([shapely.unary_union([shapely.boundary(zone), *lines])]))
    pieces = [face for face in faces if shapely.contains(zone, shapely.point_on_surface(face))]
    large = [piece for piece in pieces if piece.area >= _PIECE]
    if not large:
        return [zone]
    for scrap in (piece for piece in pieces if piece.area < _PIECE):
        touching = [shapely.length(shapely.intersection(scrap, piece)) for piece in large]
        if max(touching) > 0:
            nearest = int(np.argmax(touching))
            large[nearest] = shapely.union(large[nearest], scrap)
    return large


def _houses(pieces: list[Any], owners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the house, from 0, of each piece: small ones belong to the piece of another part that they touch most."""
    house = np.arange(len(pieces))
    areas = shapely.area(_objects(pieces))
    tree = shapely.STRtree(pieces)
    for k in np.argsort(areas, kind="stable").tolist():
        if areas[k] >= _ANNEX:
            break
        near = tree.query(pieces[k], predicate="dwithin", distance=_TOUCH)
        near = near[(owners[near] != owners[k]) & (areas[near] > areas[k])]
        if len(near) == 0:
            continue
        around = shapely.buffer(pieces[k], _TOUCH)
        wall = shapely.length(shapely.intersection(shapely.boundary(_objects([pieces[n] for n in near])), around))
        if wall.max() >= _WALL:
            house[house == house[k]] = house[near[np.argmax(wall)]]
    numbers: NDArray[np.int64] = np.unique(house, return_inverse=True)[1].astype(np.int64)
    return numbers


def _joined(pieces: list[Any]) -> Any:
    """Join pieces to one outline; gaps as narrow as rounding are closed."""
    if len(pieces) == 1:
        return pieces[0]
    grown = shapely.union_all(shapely.buffer(_objects(pieces), _CLOSE, join_style="mitre"))
    return shapely.buffer(grown, -_CLOSE, join_style="mitre")
