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

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.kernels import kernel
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
    rectangles: NDArray[np.float64],
    blocks: NDArray[np.object_],
    grid: Grid,
    *,
    always: bool = False,
    wanted: NDArray[np.bool_] | None = None,
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
    wanted : ndarray of bool, shape (n,), optional
        Which outlines are wanted: all of a block or none. The others are rectangles, which no other outline avoids.
    """
    outlines: NDArray[np.object_] = shapely.polygons(to_world(rectangles, grid))
    if len(rectangles) == 0 or len(blocks) == 0:
        return outlines
    block = block_of(outlines, blocks)
    near = _near(outlines)
    result = outlines.copy()
    alone = np.bincount(block[block >= 0], minlength=len(blocks)) == 1
    places = corners(rectangles)
    asked = np.ones(len(rectangles), dtype=np.bool_) if wanted is None else wanted
    inside = np.flatnonzero((block >= 0) & asked)
    parts = blocks[block[inside]]
    for row in np.flatnonzero(~alone[block[inside]]).tolist():
        k = int(inside[row])
        order = np.concatenate([[k], near[k][near[k] != k]])
        parts[row] = _part(rectangles[order], places[k], parts[row], grid)
    common = shapely.area(shapely.intersection(parts, outlines[inside]))
    together = shapely.area(parts) + shapely.area(outlines[inside]) - common
    follows = ~shapely.is_empty(parts) & (common < (2.0 if always else _AS_GOOD) * together)
    result[inside[follows]] = parts[follows]
    # Zones are drawn one by one, regardless of the rectangles: where two footprints share a strip, the first keeps it.
    drawn = np.zeros(len(rectangles), dtype=np.bool_)
    drawn[inside[follows]] = True
    for k in np.flatnonzero(drawn).tolist():
        rivals = near[k][(near[k] != k) & asked[near[k]] & (~drawn[near[k]] | (near[k] < k))]
        rivals = rivals[shapely.intersects(result[rivals], result[k])]
        rest = _whole(shapely.difference(result[k], shapely.union_all(result[rivals]), grid_size=_FINEST))
        result[k] = outlines[k] if rest.is_empty else rest
    return result


def _near(outlines: NDArray[np.object_]) -> list[NDArray[np.int64]]:
    """Return the rows of the outlines whose zones may meet that of each, itself among them."""
    one, other = shapely.STRtree(outlines).query(outlines, predicate="dwithin", distance=2 * _REACH)
    return np.split(other, np.searchsorted(one, np.arange(1, len(outlines))))


def _part(rectangles: NDArray[np.float64], place: NDArray[np.float64], block: Any, grid: Grid) -> Any:
    """Return the common area of a block and the zone of the first rectangle, which ends at the others, shape (m, 5).

    `place` are the corners of the first.
    """
    reach = _REACH / grid.gsd
    # Beyond its block a zone is not needed.
    xmin, ymin, xmax, ymax = block.bounds
    (first, last), (start, end) = grid.to_pixel([xmin, xmax], [ymax, ymin])
    left, top = np.floor(np.maximum(place.min(axis=0) - reach, (start, first))).astype(int) - 1
    right, bottom = np.ceil(np.minimum(place.max(axis=0) + reach, (end, last))).astype(int) + 1
    west, north = grid.to_world(top, left)
    window = Grid(float(west), float(north), grid.gsd, int(bottom - top), int(right - left))
    turns = np.stack([np.cos(rectangles[:, 4]), np.sin(rectangles[:, 4])], axis=1)
    # The "coverage" is more than one half where the lead is positive.
    pieces = trace(_lead(rectangles, turns, (int(top), int(left)), reach, window.shape), window)
    zone = pieces[0] if len(pieces) == 1 else shapely.multipolygons(pieces)
    return shapely.simplify(_whole(shapely.intersection(zone, block)), _STRAIGHT)


def _whole(outline: Any) -> Any:
    """Return an outline without its small parts; the largest is always kept."""
    if shapely.get_type_id(outline) == shapely.GeometryType.POLYGON:
        return outline
    parts = shapely.get_parts(outline)
    parts = parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]
    if len(parts) < 2:
        return parts[0] if len(parts) else shapely.Polygon()
    sizes = shapely.area(parts)
    return shapely.union_all(parts[(sizes >= _SCRAP) | (sizes == sizes.max())])


@kernel
def _lead(
    rectangles: NDArray[np.float64],
    turns: NDArray[np.float64],
    first: tuple[int, int],
    reach: float,
    shape: tuple[int, int],
) -> NDArray[np.float32]:
    """Return one half more than how much nearer the first rectangle is than all others, at most its reach, in cells.

    Parameters
    ----------
    rectangles : ndarray, shape (n, 5)
    turns : ndarray, shape (n, 2)
        Cosine and sine of their angles.
    first : tuple of int
        Row and column of the first cell.
    reach : float
    shape : tuple of int
        Rows and columns.
    """
    rows, columns = shape
    lead = np.empty((rows, columns), dtype=np.float32)
    own, least = np.empty(columns), np.empty(columns)
    for row in range(rows):
        y = first[0] + row + 0.5
        for k in range(len(rectangles)):
            cos, sin, dy = turns[k, 0], turns[k, 1], y - rectangles[k, 1]
            for column in range(columns):
                dx = first[1] + column + 0.5 - rectangles[k, 0]
                u = abs(dx * cos + dy * sin) - 0.5 * rectangles[k, 2]
                v = abs(dy * cos - dx * sin) - 0.5 * rectangles[k, 3]
                beyond_u, beyond_v = max(u, 0.0), max(v, 0.0)
                nearness = math.sqrt(beyond_u * beyond_u + beyond_v * beyond_v) + min(max(u, v), 0.0)
                if k == 0:
                    own[column], least[column] = nearness, reach - nearness
                else:
                    least[column] = min(least[column], nearness - own[column])
        for column in range(columns):
            lead[row, column] = np.float32(least[column] + 0.5)
    return lead
