"""Footprints as rectangles: L, T, U and C shapes as rectangles that share a building id.

The reference entities of the papers are rectangles, and the parts of one building overlap naturally. A footprint is
turned to its dominant direction and cut by the lines through its vertices into cells. Rectangles of whole cells are
taken one at a time, each time the one that brings most: the area of the footprint that it newly covers, less twice the
area outside the footprint that it newly covers. What is left and large enough (a wing in another direction) is treated
the same way in its own direction.

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
#: Most lines per direction; footprints with more vertices (round ones) are cut more coarsely.
_MOST_LINES = 24


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
        A further rectangle must bring at least this area, m2, and 2 % of the footprint.

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


def decompose(
    polygon: shapely.Geometry, *, tolerance: float = 0.5, smallest: float = 4.0, depth: int = 2
) -> list[NDArray[np.float64]]:
    """Return the rectangles of one footprint, each as corners of shape (4, 2), the most important first.

    There is at least one, however small the footprint is.
    """
    box = shapely.minimum_rotated_rectangle(polygon)
    if box.geom_type == "Polygon" and polygon.area >= _ALONE * box.area:
        return [shapely.get_coordinates(box)[:4]]
    origin = shapely.get_coordinates(shapely.centroid(polygon))[0]
    angle = _direction(polygon, origin)
    turned = shapely.transform(polygon, lambda points: _turn(points - origin, -angle))
    least = max(smallest, 0.02 * polygon.area)
    parts = [_turn(part, angle) + origin for part in _cover(turned, tolerance, least)]
    if depth:
        covered = shapely.union_all([shapely.Polygon(part) for part in parts])
        rest = shapely.difference(polygon, covered)
        # What is left along slightly oblique walls is slivers; opening removes them.
        rest = shapely.intersection(rest, shapely.buffer(shapely.buffer(rest, -tolerance), 1.5 * tolerance))
        for piece in shapely.get_parts(rest):
            if piece.geom_type == "Polygon" and piece.area >= 2 * least:
                wing = decompose(piece, tolerance=tolerance, smallest=smallest, depth=depth - 1)
                parts.extend(part for part in wing if _brings(part, polygon, parts) >= least)
    return parts or [shapely.get_coordinates(box)[:4]]


def _direction(polygon: shapely.Geometry, origin: NDArray[np.float64]) -> float:
    """Return the angle of the walls, radians: of those tried, the one with the longest walls within some degrees."""
    angles, lengths = [], []
    for part in shapely.get_parts(polygon):
        for ring in (part.exterior, *part.interiors):
            edges = np.diff(shapely.get_coordinates(ring) - origin, axis=0)
            angles.append(np.arctan2(edges[:, 1], edges[:, 0]))
            lengths.append(np.hypot(edges[:, 0], edges[:, 1]))
    angle, length = np.concatenate(angles), np.concatenate(lengths)
    # Directions count modulo 90 degrees; four times the angle makes them periodic.
    near = np.exp((np.cos(4 * (angle[:, None] - angle[None, :])) - 1) / 0.1)  # falls to 1/e at 6.5 degrees
    best = int(np.argmax((near * length[None, :]).sum(axis=1)))
    weight = near[best] * length
    mean = np.angle((weight * np.exp(4j * angle)).sum()) / 4
    return float(mean)


def _turn(points: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cosine, sine], [-sine, cosine]]))


def _cover(polygon: shapely.Geometry, tolerance: float, least: float) -> list[NDArray[np.float64]]:
    """Return rectangles along the axes that cover a turned polygon, greedily by what each brings."""
    vertices = shapely.get_coordinates(polygon)
    x, y = _lines(vertices[:, 0], tolerance), _lines(vertices[:, 1], tolerance)
    if len(x) < 2 or len(y) < 2:
        return []
    shapely.prepare(polygon)
    west, south = np.meshgrid(x[:-1], y[:-1])
    east, north = np.meshgrid(x[1:], y[1:])
    cells = shapely.box(west, south, east, north)
    inside = shapely.area(shapely.intersection(polygon, cells))
    gain = inside - 2 * ((east - west) * (north - south) - inside)
    covered = np.zeros(inside.shape, dtype=bool)
    found: list[NDArray[np.float64]] = []
    while True:
        # Covered cells count a little, so that the parts of an L run through each other, as houses do.
        brings = np.where(covered, 1e-6 * gain, gain)
        value, (bottom, top, left, right) = _best(brings)
        if value < least and (found or value <= 0):
            return found
        covered[bottom:top, left:right] = True
        found.append(np.array([[x[left], y[bottom]], [x[right], y[bottom]], [x[right], y[top]], [x[left], y[top]]]))


def _lines(values: NDArray[np.float64], tolerance: float) -> NDArray[np.float64]:
    """Return the positions of the lines through vertices: means of runs that are nearer than the tolerance."""
    ordered = np.sort(values)
    while True:
        first = np.concatenate([[True], np.diff(ordered) > tolerance])
        group = np.cumsum(first) - 1
        if group[-1] < _MOST_LINES:
            return np.asarray(np.bincount(group, weights=ordered) / np.bincount(group))
        tolerance *= 1.5


def _best(values: NDArray[np.float64]) -> tuple[float, tuple[int, int, int, int]]:
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


def _brings(part: NDArray[np.float64], polygon: shapely.Geometry, parts: list[NDArray[np.float64]]) -> float:
    """Return what a further rectangle brings: area inside, less twice that outside the polygon, not yet covered."""
    fresh = shapely.difference(shapely.Polygon(part), shapely.union_all([shapely.Polygon(other) for other in parts]))
    within = shapely.area(shapely.intersection(fresh, polygon))
    return float(within - 2 * (shapely.area(fresh) - within))
