"""Buildings: the part of its block that belongs to each rectangle; cells show its edge, rectangles its party walls.

Nouns
-----
nearness
    Of a place to a rectangle: its distance in cells, inside the negative distance from the nearest side.
zone
    Where a rectangle is nearer than all others, and not far. Two that touch meet in their common wall and in its
    extension.

A building is the common area of its zone and its block, or the whole block of which it is the only one, where the
rectangle does not describe that as well.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.outlines import trace
from ...scenes.geodata.raster import Grid
from .rectangles import corners, to_world

__all__ = ["block_of", "outline_buildings"]

#: Intersection over union from which the rectangle is as good an outline.
_AS_GOOD = 0.95
#: Metres: how far a zone reaches from its rectangle, and by how much vertices of an outline may move.
_REACH, _STRAIGHT = 10.0, 0.05
#: Metres: least distance of two corners. Nearer ones cross each other as soon as an outline is moved or written.
_FINEST = 1e-6
#: Square metres: smallest part of a building that is cut off from the rest of it.
_SCRAP = 4.0


def block_of(outlines: NDArray[np.object_], blocks: NDArray[np.object_]) -> NDArray[np.int64]:
    """Return the row of the block that holds most of each outline, shape (n,); -1 where none holds any of it."""
    found = np.full(len(outlines), -1, dtype=np.int64)
    if len(outlines) == 0 or len(blocks) == 0:
        return found
    one, block = shapely.STRtree(blocks).query(outlines, predicate="intersects")
    common = shapely.area(shapely.intersection(outlines[one], blocks[block]))
    order = np.lexsort((-common, one))
    one, block = one[order], block[order]
    first = np.unique(one, return_index=True)[1]
    found[one[first]] = block[first]
    return found


def outline_buildings(
    rectangles: NDArray[np.float64], blocks: NDArray[np.object_], grid: Grid, *, always: bool = False
) -> NDArray[np.object_]:
    """Return one outline a rectangle, shape (n,), polygons or multipolygons in metres of the CRS.

    Parameters
    ----------
    rectangles : ndarray, shape (n, 5)
        Grid frame.
    blocks : ndarray of shapely Polygons
        As `blocks.outline_blocks` returns them.
    grid : Grid
    always : bool
        Follow the cells even where the rectangle is as good an outline, so that the outlines cover their blocks.
    """
    outlines: NDArray[np.object_] = shapely.polygons(to_world(rectangles, grid))
    if len(rectangles) == 0 or len(blocks) == 0:
        return outlines
    block = block_of(outlines, blocks)
    tree = shapely.STRtree(outlines)
    result = outlines.copy()
    alone = np.bincount(block[block >= 0], minlength=len(blocks)) == 1
    for k in np.flatnonzero(block >= 0):
        of = block[k]
        part = blocks[of]
        if not alone[of]:
            rivals = tree.query(outlines[k], predicate="dwithin", distance=2 * _REACH)
            part = _part(rectangles[k], rectangles[rivals[rivals != k]], part, grid)
        together = shapely.area(shapely.union(part, outlines[k]))
        good = 2.0 if always else _AS_GOOD
        if not part.is_empty and shapely.area(shapely.intersection(part, outlines[k])) < good * together:
            result[k] = part
    # Zones are drawn one by one, regardless of the rectangles: where two footprints share a strip, the first keeps it.
    drawn = result != outlines
    for k in np.flatnonzero(drawn):
        rivals = tree.query(outlines[k], predicate="dwithin", distance=2 * _REACH)
        rivals = rivals[(rivals != k) & (~drawn[rivals] | (rivals < k))]
        rest = _whole(shapely.difference(result[k], shapely.union_all(result[rivals]), grid_size=_FINEST))
        result[k] = outlines[k] if rest.is_empty else rest
    return result


def _part(rectangle: NDArray[np.float64], rivals: NDArray[np.float64], block: Any, grid: Grid) -> Any:
    """Return the common area of a block and the zone of a rectangle, which ends at its neighbours, shape (m, 5)."""
    place = corners(rectangle)[0]
    reach = _REACH / grid.gsd
    left, top = np.floor(place.min(axis=0) - reach).astype(int) - 1
    right, bottom = np.ceil(place.max(axis=0) + reach).astype(int) + 1
    west, north = grid.to_world(top, left)
    window = Grid(float(west), float(north), grid.gsd, int(bottom - top), int(right - left))
    x, y = np.meshgrid(np.arange(left, right) + 0.5, np.arange(top, bottom) + 0.5)
    own = _nearness(rectangle, x, y)
    lead = reach - own
    for rival in rivals:
        np.minimum(lead, _nearness(rival, x, y) - own, out=lead)
    # The "coverage" is more than one half where the lead is positive.
    zone = shapely.union_all(trace((lead + 0.5).astype(np.float32), window))
    return shapely.simplify(_whole(shapely.intersection(zone, block)), _STRAIGHT)


def _whole(outline: Any) -> Any:
    """Return an outline without its small parts; the largest is always kept."""
    parts = shapely.get_parts(outline)
    parts = parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
    if len(parts) < 2:
        return parts[0] if len(parts) else shapely.Polygon()
    sizes = shapely.area(parts)
    return shapely.union_all(parts[(sizes >= _SCRAP) | (sizes == sizes.max())])


def _nearness(rectangle: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    cos, sin = np.cos(rectangle[4]), np.sin(rectangle[4])
    dx, dy = x - rectangle[0], y - rectangle[1]
    u = np.abs(dx * cos + dy * sin) - 0.5 * rectangle[2]
    v = np.abs(dy * cos - dx * sin) - 0.5 * rectangle[3]
    nearness: NDArray[np.float64] = np.hypot(np.maximum(u, 0), np.maximum(v, 0)) + np.minimum(np.maximum(u, v), 0)
    return nearness
