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

__all__ = ["RectangleFit", "as_rectangles", "decompose"]

#: A rectangle this similar (intersection over union) to the footprint stands for it alone.
_ALONE = 0.97
#: Weight of area covered outside the footprint against area inside. With 1 or 2 a rectangle over a whole court can win
#: against its wings; with more than 4 slanting ends are cut into many small ones.
_OUTSIDE = 3
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
        covered = shapely.union_all([shapely.Polygon(part) for part in parts])
        common = shapely.area(shapely.intersection(polygon, covered))
        union = shapely.area(polygon) + shapely.area(covered) - common
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
    box = shapely.minimum_rotated_rectangle(polygon)
    if box.geom_type == "Polygon" and polygon.area >= _ALONE * box.area:
        return [shapely.get_coordinates(box)[:4]]
    origin = shapely.get_coordinates(shapely.centroid(polygon))[0]
    centred = shapely.transform(polygon, lambda points: points - origin)
    least = max(smallest, 0.01 * polygon.area)
    boards = [_Board(centred, angle, tolerance) for angle in _directions(centred)]
    parts: list[NDArray[np.float64]] = []
    uncovered = centred
    while True:
        bids = [board.best() for board in boards]
        winner = int(np.argmax([value for value, _ in bids]))
        value, block = bids[winner]
        if value < least and (parts or value <= 0):
            break
        part = boards[winner].take(block)
        parts.append(part + origin)
        uncovered = shapely.difference(uncovered, shapely.Polygon(part))
        for board in boards:
            board.update(uncovered)
    return parts or [shapely.get_coordinates(box)[:4]]


class _Board:
    """The cells that the walls of a footprint make along one direction, and what each would bring."""

    def __init__(self, polygon: shapely.Geometry, angle: float, tolerance: float) -> None:
        self._angle = angle
        turned = self._turned(polygon)
        self._x, self._y = _lines(turned, 0, tolerance), _lines(turned, 1, tolerance)
        west, south = np.meshgrid(self._x[:-1], self._y[:-1])
        east, north = np.meshgrid(self._x[1:], self._y[1:])
        self._cells = shapely.box(west, south, east, north)
        self._uncovered = self._inside(turned)
        self._outside = (east - west) * (north - south) - self._uncovered
        self._whole = self._uncovered - _OUTSIDE * self._outside
        self._taken = np.zeros(self._cells.shape, dtype=bool)

    def best(self) -> tuple[float, tuple[int, int, int, int]]:
        """Return the most that a block of cells brings, and the block; 0 and none without cells."""
        if not self._cells.size:
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
        """Learn what of the footprint is still uncovered."""
        if self._cells.size:
            self._uncovered = self._inside(self._turned(uncovered))

    def _turned(self, polygon: shapely.Geometry) -> shapely.Geometry:
        return shapely.transform(polygon, lambda points: _turn(points, -self._angle))

    def _inside(self, polygon: shapely.Geometry) -> NDArray[np.float64]:
        shapely.prepare(polygon)
        return np.asarray(shapely.area(shapely.intersection(polygon, self._cells)), dtype=np.float64)


def _directions(polygon: shapely.Polygon) -> list[float]:
    """Return up to three directions of the walls, radians, the one with the longest walls first."""
    edges = np.concatenate(
        [np.diff(shapely.get_coordinates(ring), axis=0) for ring in (polygon.exterior, *polygon.interiors)]
    )
    angle, length = np.arctan2(edges[:, 1], edges[:, 0]), np.hypot(edges[:, 0], edges[:, 1])
    # Directions count modulo 90 degrees; four times the angle makes them periodic.
    near = np.exp((np.cos(4 * (angle[:, None] - angle[None, :])) - 1) / 0.1)  # falls to 1/e at 6.5 degrees
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


def _lines(polygon: shapely.Geometry, axis: int, tolerance: float) -> NDArray[np.float64]:
    """Return the positions, sorted, where rectangles may end: walls across an axis, and the middles of slanting ones.

    Positions within a tolerance are one, their mean weighted by the lengths of the walls.
    """
    positions, weights = [], []
    for part in shapely.get_parts(polygon):
        for ring in (part.exterior, *part.interiors):
            corners = shapely.get_coordinates(ring)
            along, across = np.abs(np.diff(corners, axis=0)).T[[axis, 1 - axis]]
            start, end = corners[:-1, axis], corners[1:, axis]
            slanting = (along > tolerance) & (across > tolerance)
            positions.extend([start, end, ((start + end) / 2)[slanting]])
            weights.extend([across, across, along[slanting]])
    position, weight = np.concatenate(positions), np.concatenate(weights) + 1e-3
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
