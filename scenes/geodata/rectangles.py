"""Footprints as rectangles: L, T, U and C shapes as rectangles that share a building id.

The reference entities of the papers are rectangles, and the parts of one building overlap naturally. A footprint is
turned to each of its main directions and cut by the lines of its walls into cells. Rectangles of whole cells are taken
one at a time, in any of the directions, each time the one that brings most: the area of the footprint that it newly
covers, less three times the area that it covers outside.

All lengths in metres, areas in m2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from .footprints import Footprints
from .polygon_repair import polygonal_part

__all__ = ["RectangleFit", "as_rectangles", "decompose"]

#: A rectangle this similar (intersection over union) to the footprint stands for it alone.
_ALONE = 0.97
#: Weight of area covered outside the footprint against area inside. With 1 or 2 a rectangle over a whole court can win
#: against its wings; with more than 4 slanting ends are cut into many small ones.
_OUTSIDE = 3
#: Degrees between directions that count as two, in turn, until the rectangles are so similar to the footprint.
_APART, _FITS = (3.5, 0.5), 0.9
#: Most lines per direction; footprints with more vertices (round ones) are cut more coarsely.
_MOST_LINES = 28


@dataclass(frozen=True)
class RectangleFit:
    """How well rectangles stand for the footprints that they were made from.

    Attributes
    ----------
    footprints : int
        Footprints that were decomposed.
    rectangles : int
        Rectangles made of them.
    agreement : float
        Intersection over union of all areas, building by building, added up; 1 is perfect.
    poor : tuple of int
        `Footprints.ids` of those whose own intersection over union is below 0.8.
    """

    footprints: int
    rectangles: int
    agreement: float
    poor: tuple[int, ...]


def as_rectangles(
    footprints: Footprints, *, tolerance: float = 0.5, smallest: float = 4.0
) -> tuple[Footprints, RectangleFit]:
    """Return the footprints as rectangles with building ids, and how well they fit.

    Parameters
    ----------
    footprints : Footprints
    tolerance : float
        Vertices nearer than this, metres, across a direction lie on one line.
    smallest : float
        A further rectangle must bring at least this area, m2, and 1 % of the footprint.

    Returns
    -------
    rectangles : Footprints
        Convex quadrilaterals with right angles; the attribute ``footprint`` holds the id they come from. Rectangles
        of one footprint, and of footprints of one building, share the building id.
    fit : RectangleFit
    """
    corners: list[NDArray[np.float64]] = []
    owners: list[int] = []
    both = either = 0.0
    poor = []
    for row, polygon in enumerate(footprints.polygons):
        parts = decompose(polygon, tolerance=tolerance, smallest=smallest)
        corners.extend(parts)
        owners.extend([row] * len(parts))
        common, union = _common_and_union(polygon, parts)
        both, either = both + common, either + union
        if common < 0.8 * union:
            poor.append(int(footprints.ids[row]))
    owner = np.array(owners, dtype=np.int64)
    labels = footprints.ids if footprints.building_ids is None else footprints.building_ids
    columns = {name: column[owner] for name, column in footprints.attributes.items() if name != "building_id"}
    columns["footprint"] = footprints.ids[owner]
    rectangles = Footprints.from_rectangles(
        np.array(corners).reshape(-1, 4, 2),
        crs=footprints.crs,
        building_ids=labels[owner],
        attributes=columns,
        metadata=footprints.metadata,
        source=footprints.source,
    )
    fit = RectangleFit(len(footprints), len(rectangles), both / either if either else 1.0, tuple(poor))
    return rectangles, fit


def decompose(polygon: shapely.Geometry, *, tolerance: float = 0.5, smallest: float = 4.0) -> list[NDArray[np.float64]]:
    """Return the rectangles of one footprint, each as corners of shape (4, 2), the most important first.

    There is at least one for each part of a multipolygon, however small it is.
    """
    if polygon.geom_type == "MultiPolygon":
        pieces = sorted(shapely.get_parts(polygon), key=lambda piece: -piece.area)
        return [part for piece in pieces for part in decompose(piece, tolerance=tolerance, smallest=smallest)]
    middle, _ = _middle_and_grid(polygon)
    centred = shapely.transform(polygon, lambda points: points - middle)
    box = _least_box(shapely.get_coordinates(centred))
    if centred.area >= _ALONE * _area(box):
        return [box + middle]
    least = max(smallest, 0.01 * polygon.area)
    parts: list[NDArray[np.float64]] = []
    similar = -1.0
    # Walls of one direction differ by some degrees where they were drawn by hand. Where that fits badly, wings that
    # differ by as little may be meant.
    for apart in _APART:
        found = _parts(centred, _directions(centred, apart), tolerance, least) or [box]
        common, union = _common_and_union(centred, found)
        if common / union > similar:
            parts, similar = found, common / union
        if similar >= _FITS:
            break
    return [part + middle for part in parts]


def _parts(
    polygon: shapely.Geometry, directions: list[float], tolerance: float, least: float
) -> list[NDArray[np.float64]]:
    """Return the rectangles, in any of some directions, of a footprint around the origin; each brings a least area."""
    _, grid = _middle_and_grid(polygon)
    first, *others = directions
    # All overlays happen in the frame of the longest walls and on a grid, where they cannot fail.
    uncovered = shapely.set_precision(shapely.transform(polygon, lambda points: _turn(points, -first)), grid)
    boards = [_Board(uncovered, angle - first, tolerance) for angle in (first, *others)]
    parts: list[NDArray[np.float64]] = []
    while True:
        bids = [board.best() for board in boards]
        winner = int(np.argmax([value for value, _ in bids]))
        value, block = bids[winner]
        if value < least and (parts or value <= 0):
            break
        part = boards[winner].take(block)
        parts.append(_turn(part, first))
        left = shapely.difference(uncovered, shapely.set_precision(shapely.Polygon(part), grid), grid_size=grid)
        uncovered = polygonal_part(left, grid_size=grid)
        for board in boards:
            board.update(uncovered)
    return parts


def _middle_and_grid(polygon: shapely.Geometry) -> tuple[NDArray[np.float64], float]:
    """Return the centre of the bounds and the grid of overlays, metres: a thousand millionth of the size."""
    west, south, east, north = shapely.bounds(polygon)
    return np.array([(west + east) / 2, (south + north) / 2]), 1e-9 * max(east - west, north - south)


def _common_and_union(polygon: shapely.Geometry, parts: list[NDArray[np.float64]]) -> tuple[float, float]:
    """Return the area that a footprint and its rectangles have in common, and that of their union, m2."""
    middle, grid = _middle_and_grid(polygon)
    footprint = shapely.set_precision(shapely.transform(polygon, lambda points: points - middle), grid)
    covered = shapely.union_all([shapely.Polygon(part - middle) for part in parts], grid_size=grid)
    common = float(shapely.area(shapely.intersection(footprint, covered, grid_size=grid)))
    return common, float(shapely.area(footprint) + shapely.area(covered)) - common


def _least_box(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners, shape (4, 2), of the smallest rectangle around points: one side lies on the convex hull."""
    hull = shapely.get_coordinates(shapely.convex_hull(shapely.MultiPoint(points)))
    edges = np.diff(hull, axis=0)
    angles = np.arctan2(edges[:, 1], edges[:, 0])
    boxes = []
    for angle in angles:
        turned = _turn(hull, -angle)
        (west, south), (east, north) = turned.min(axis=0), turned.max(axis=0)
        boxes.append(_turn(np.array([[west, south], [east, south], [east, north], [west, north]]), angle))
    return min(boxes, key=_area)


def _area(corners: NDArray[np.float64]) -> float:
    """Return the area of a rectangle."""
    (ax, ay), (bx, by) = corners[1] - corners[0], corners[2] - corners[1]
    return float(abs(ax * by - ay * bx))


class _Board:
    """The cells that the walls of a footprint make along one direction, and what each would bring."""

    def __init__(self, polygon: shapely.Geometry, angle: float, tolerance: float) -> None:
        self._angle = angle
        edges = self._edges(polygon)
        self._x, self._y = _lines(edges, 0, tolerance), _lines(edges, 1, tolerance)
        self._uncovered = _cell_areas(edges, self._x, self._y)
        self._outside = np.diff(self._y)[:, None] * np.diff(self._x) - self._uncovered
        self._whole = self._uncovered - _OUTSIDE * self._outside
        self._taken = np.zeros(self._whole.shape, dtype=bool)

    def best(self) -> tuple[float, tuple[int, int, int, int]]:
        """Return the most that a block of cells brings, and the block; 0 and none without cells."""
        if not self._whole.size:
            return 0.0, (0, 0, 0, 0)
        gain = self._uncovered - _OUTSIDE * self._outside
        # Cells already taken count a little, so that the parts of an L run through each other, as houses do.
        return _best_block(np.where(self._taken, 1e-6 * self._whole, gain))

    def take(self, block: tuple[int, int, int, int]) -> NDArray[np.float64]:
        """Return the corners of a block, which is covered from now on."""
        bottom, top, left, right = block
        self._taken[bottom:top, left:right] = True
        west, east, south, north = self._x[left], self._x[right], self._y[bottom], self._y[top]
        return _turn(np.array([[west, south], [east, south], [east, north], [west, north]]), self._angle)

    def update(self, uncovered: shapely.Geometry) -> None:
        """Measure what of the footprint is still uncovered."""
        if self._whole.size:
            self._uncovered = _cell_areas(self._edges(uncovered), self._x, self._y)

    def _edges(self, polygon: shapely.Geometry) -> NDArray[np.float64]:
        """Return the edges in the direction of the board, shape (n, 2, 2), the polygon to their left."""
        rings = shapely.get_rings(shapely.orient_polygons(shapely.get_parts(polygon)))
        points, ring = shapely.get_coordinates(rings, return_index=True)
        points = _turn(points, -self._angle)
        return np.asarray(np.stack([points[:-1], points[1:]], axis=1)[ring[:-1] == ring[1:]])


def _cell_areas(edges: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the area, m2, of a polygon in each cell between the lines x and y, shape (len(y) - 1, len(x) - 1).

    Green's theorem gives the area to the left of X and below Y as the sum, over the edges, of the integral of
    -min(height, Y) along the part of the edge to the left of X; cells are differences of four such areas. No overlay
    is involved, so nothing can fail.
    """
    if not len(edges):
        return np.zeros((max(len(y) - 1, 0), max(len(x) - 1, 0)))
    start, end = edges[:, 0, :, None], edges[:, 1, :, None]
    run, rise = end[:, 0] - start[:, 0], end[:, 1] - start[:, 1]
    # The ends of each edge to the left of each line X: shape (edges, X).
    first, last = np.minimum(start[:, 0], x), np.minimum(end[:, 0], x)
    # How far each end is below each line Y: shape (edges, X, Y).
    shares = ((position - start[:, 0]) / np.where(run == 0, 1, run) for position in (first, last))
    one, other = (y - (start[:, 1] + share * rise)[..., None] for share in shares)
    near, far = np.minimum(one, other), np.maximum(one, other)
    span = np.where(far > near, far - near, 1)
    crossing = np.maximum(far, 0) ** 2 / (2 * span)
    below = np.where(near >= 0, (near + far) / 2, crossing)
    areas = ((last - first)[..., None] * below).sum(axis=0)
    return np.asarray(np.diff(np.diff(areas.T, axis=0), axis=1))


def _directions(polygon: shapely.Polygon, apart: float) -> list[float]:
    """Return up to three directions of the walls, radians, the one with the longest walls first.

    The weight of a wall for a direction falls to 1/e at a distance of `apart` degrees.
    """
    edges = np.concatenate(
        [np.diff(shapely.get_coordinates(ring), axis=0) for ring in (polygon.exterior, *polygon.interiors)]
    )
    angle, length = np.arctan2(edges[:, 1], edges[:, 0]), np.hypot(edges[:, 0], edges[:, 1])
    # Directions count modulo 90 degrees; four times the angle makes them periodic.
    width = 1 - np.cos(4 * np.radians(apart))
    near = np.exp((np.cos(4 * (angle[:, None] - angle[None, :])) - 1) / width)
    left = length.copy()
    found: list[float] = []
    while len(found) < 3 and left.sum() > 0.15 * length.sum():
        best = int(np.argmax(near @ left))
        found.append(float(np.angle((near[best] * left * np.exp(4j * angle)).sum()) / 4))
        left[near[best] > 0.2] = 0
    return found


def _turn(points: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cosine, sine], [-sine, cosine]]))


def _lines(edges: NDArray[np.float64], axis: int, tolerance: float) -> NDArray[np.float64]:
    """Return the positions, sorted, where rectangles may end: walls across an axis, and the middles of slanting ones.

    Positions within a tolerance are one, their mean weighted by the lengths of the walls.
    """
    along, across = np.abs(edges[:, 1] - edges[:, 0]).T[[axis, 1 - axis]]
    start, end = edges[:, 0, axis], edges[:, 1, axis]
    slanting = (along > tolerance) & (across > tolerance)
    position = np.concatenate([start, end, ((start + end) / 2)[slanting]])
    weight = np.concatenate([across, across, along[slanting]]) + 1e-3
    order = np.argsort(position)
    position, weight = position[order], weight[order]
    while True:
        lines, first = [], 0
        while first < len(position):
            last = int(np.searchsorted(position, position[first] + tolerance, side="right"))
            lines.append(np.average(position[first:last], weights=weight[first:last]))
            first = last
        if len(lines) <= _MOST_LINES:
            return np.array(lines)
        tolerance *= 1.3


def _best_block(values: NDArray[np.float64]) -> tuple[float, tuple[int, int, int, int]]:
    """Return the largest sum over a block of cells, and the block as (bottom, top, left, right), ends exclusive."""
    rows, columns = values.shape
    total = np.zeros((rows + 1, columns + 1))
    total[1:, 1:] = values.cumsum(axis=0).cumsum(axis=1)
    bottom, top = np.triu_indices(rows + 1, k=1)
    strips = total[top] - total[bottom]
    sums = strips[:, None, :] - strips[:, :, None]  # [strip, left, right]
    sums[:, *np.tril_indices(columns + 1)] = -np.inf
    strip, left, right = np.unravel_index(int(np.argmax(sums)), sums.shape)
    return float(sums[strip, left, right]), (int(bottom[strip]), int(top[strip]), int(left), int(right))
