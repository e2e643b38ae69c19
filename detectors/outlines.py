"""Outlines: from a mask on a grid to polygons with straight walls and right angles.

Nouns
-----
coverage
    Share of each cell that belongs to an object, 0..1, shape (rows, columns). Where it crosses one half between two
    cell centres lies the outline, so that it is found to a fraction of a cell.
wall
    A straight part of an outline, between two corners: a line fitted to the outline's points there.
main directions
    The few directions, modulo 90 degrees, that most of the outline's length follows.

Coordinates are metres, x east and y north; angles are counted from x towards y.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..scenes.raster import Grid

__all__ = ["coverage_of_mask", "minimum_rectangles", "regularise", "simplify", "trace"]

_Points = NDArray[np.float64]

#: Walls within so many degrees follow the same direction; the share of the length that makes it a main one; how many.
_SAME_DIRECTION, _MAIN_SHARE, _MOST_DIRECTIONS = 5.0, 0.15, 4


def coverage_of_mask(mask: NDArray[np.bool_], share: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """Return the coverage whose outline encloses exactly the centres of a mask's cells.

    Parameters
    ----------
    mask : ndarray of bool, shape (rows, columns)
    share : ndarray of float32, shape (rows, columns), optional
        Measured share of each cell that is covered; it moves the outline between the centres. NaN is not known.

    Returns
    -------
    ndarray of float32
        Above one half on the mask, below elsewhere, and 0 beyond the cells that touch the mask.
    """
    import cv2

    solid = mask.astype(np.float32)
    if share is None:
        return solid
    known = np.where(np.isfinite(share), share, solid)
    beside = cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    coverage: NDArray[np.float32] = np.where(
        mask, np.clip(known, 0.51, 1), np.where(beside, np.clip(known, 0, 0.49), 0)
    ).astype(np.float32)
    return coverage


def trace(coverage: NDArray[np.float32], grid: Grid) -> NDArray[np.object_]:
    """Return the polygons, with holes, where the coverage exceeds one half; array of shapely Polygons.

    Objects that reach the border of the grid end there.
    """
    import contourpy

    x, y = grid.to_world(np.arange(-1, grid.rows + 1) + 0.5, np.arange(-1, grid.columns + 1) + 0.5)
    generator = contourpy.contour_generator(x, y, np.pad(coverage, 1), fill_type=contourpy.FillType.OuterOffset)
    filled: Any = generator.filled(0.5, np.inf)
    rings, offsets = filled
    polygons = np.empty(len(rings), dtype=object)
    for number, (points, offset) in enumerate(zip(rings, offsets, strict=True)):
        parts = [points[a:b] for a, b in itertools.pairwise(offset)]
        polygons[number] = shapely.Polygon(parts[0], parts[1:])
    invalid = ~shapely.is_valid(polygons)
    if invalid.any():
        polygons = shapely.get_parts(np.where(invalid, shapely.make_valid(polygons), polygons))
        polygons = polygons[shapely.get_type_id(polygons) == 3]
    return polygons


def simplify(polygons: NDArray[np.object_], tolerance: float) -> NDArray[np.object_]:
    """Return the polygons with fewer vertices, none moved by more than the tolerance in metres (Douglas-Peucker)."""
    simple = shapely.simplify(polygons, tolerance, preserve_topology=True)
    return np.where(shapely.area(simple) > 0, simple, polygons)


def minimum_rectangles(polygons: NDArray[np.object_]) -> NDArray[np.object_]:
    """Return the rectangle of least area around each polygon."""
    rectangles: NDArray[np.object_] = shapely.minimum_rotated_rectangle(polygons)
    return rectangles


def regularise(
    polygons: NDArray[np.object_], tolerance: float, *, angle: float = 15.0, least_agreement: float = 0.85
) -> NDArray[np.object_]:
    """Return the polygons with walls along their main directions and right angles between them.

    Each polygon is simplified; its walls are fitted to the traced points between the corners; those within `angle`
    of a main direction turn into it, and so do walls so short that their direction is noise; neighbouring walls that
    are parallel become one, or are joined by a step; corners are where neighbouring walls meet. A polygon that comes
    out invalid, or agrees less than `least_agreement` (intersection over union) with what was traced, is only
    simplified.

    Parameters
    ----------
    polygons : ndarray of Polygon, shape (n,)
        As `trace` gives them, with all their vertices.
    tolerance : float
        Metres by which traced points may lie beside a wall.
    angle : float
        Degrees.
    least_agreement : float
        0..1.
    """
    simple = simplify(polygons, tolerance)
    result = simple.copy()
    for number, (traced, plain) in enumerate(zip(polygons, simple, strict=True)):
        regular = _regular(traced, plain, tolerance, math.radians(angle))
        if regular is None or not regular.is_valid:
            continue
        common = regular.intersection(traced).area
        if common >= least_agreement * (regular.area + traced.area - common):
            result[number] = regular
    return result


def _regular(traced: Any, simple: Any, tolerance: float, angle: float) -> Any | None:
    """Return one regularised polygon, or None when a ring does not work out."""
    origin = np.array(traced.bounds[:2])
    rings = [simple.exterior, *simple.interiors]
    traced_rings = [traced.exterior, *traced.interiors]
    points = [shapely.get_coordinates(ring)[:-1] - origin for ring in traced_rings]
    walls = []
    for ring in rings:
        corners = shapely.get_coordinates(ring)[:-1] - origin
        source = _source_ring(corners, points)
        if source is None:
            return None
        walls.append(_fit_walls(corners, source))
    mains = _main_directions(np.concatenate(walls))
    shells = [_ring(_turn(ring, mains, tolerance, angle), tolerance) for ring in walls]
    if shells[0] is None:
        return None
    holes = [shell + origin for shell in shells[1:] if shell is not None]
    return shapely.Polygon(shells[0] + origin, holes)


def _source_ring(corners: _Points, rings: list[_Points]) -> tuple[_Points, NDArray[np.intp]] | None:
    """Return the traced ring that the corners are vertices of, with their positions on it in order."""
    for ring in rings:
        positions = {(float(x), float(y)): i for i, (x, y) in enumerate(ring)}
        found = [positions.get((float(x), float(y))) for x, y in corners]
        if all(position is not None for position in found):
            return ring, np.array(found, dtype=np.intp)
    return None


def _fit_walls(corners: _Points, source: tuple[_Points, NDArray[np.intp]]) -> _Points:
    """Return the walls of a ring, shape (n, 4): centre x, y, direction in radians, length."""
    ring, position = source
    size = len(ring)
    # The simplified ring may run either way round the traced one.
    forward = np.count_nonzero(np.diff(position) > 0) >= len(position) / 2
    walls = np.empty((len(corners), 4))
    for i, start in enumerate(position):
        end = position[(i + 1) % len(position)]
        steps = (end - start) % size if forward else (start - end) % size
        index = (start + np.arange(steps + 1) * (1 if forward else -1)) % size
        walls[i] = _fit_line(ring[index])
    return walls


def _fit_line(points: _Points) -> _Points:
    """Return centre, direction and length of a traced piece: a total least-squares line, weighted by length."""
    first, last = points[0], points[-1]
    middle = (points[:-1] + points[1:]) / 2
    weight = np.hypot(*(points[1:] - points[:-1]).T)
    if len(middle) < 4:
        centre, along = (first + last) / 2, last - first
    else:
        centre = np.average(middle, axis=0, weights=weight)
        spread = (middle - centre) * np.sqrt(weight)[:, None]
        along = np.linalg.svd(spread, full_matrices=False)[2][0]
        along = along if along @ (last - first) >= 0 else -along
    return np.array([*centre, math.atan2(along[1], along[0]), math.hypot(*(last - first))])


def _main_directions(walls: _Points) -> _Points:
    """Return the main directions, radians in 0..pi/2, most followed first."""
    degrees = np.degrees(walls[:, 2]) % 90
    # Long walls tell directions better than many short ones of the same length.
    weight = walls[:, 3] ** 1.5
    remaining, least = weight.copy(), _MAIN_SHARE * weight.sum()
    away = (degrees[:, None] - degrees[None, :] + 45) % 90 - 45
    near = np.abs(away) < _SAME_DIRECTION
    mains: list[float] = []
    while len(mains) < _MOST_DIRECTIONS:
        support = (near * remaining[:, None]).sum(axis=0)
        best = int(np.argmax(support))
        if support[best] <= 0 or support[best] < least:
            break
        followers = near[:, best]
        mains.append(degrees[best] + np.average(away[followers, best], weights=remaining[followers]))
        remaining[np.abs(away[:, best]) < 2 * _SAME_DIRECTION] = 0
    return np.radians(mains) % (math.pi / 2)


def _turn(walls: _Points, mains: _Points, tolerance: float, angle: float) -> _Points:
    """Return the walls with those near a main direction turned into it."""
    if len(mains) == 0:
        return walls
    quarter = math.pi / 2
    turn = (mains[None, :] - walls[:, 2:3] + quarter / 2) % quarter - quarter / 2
    nearest = turn[np.arange(len(walls)), np.argmin(np.abs(turn), axis=1)]
    # A wall of length l whose ends are known to the tolerance has a direction known to about 2 tolerance / l.
    allowed = np.maximum(angle, np.arctan2(2 * tolerance, walls[:, 3]))
    turned = walls.copy()
    turned[:, 2] += np.where(np.abs(nearest) <= allowed, nearest, 0)
    return turned


def _ring(walls: _Points, tolerance: float) -> _Points | None:
    """Return the corners where neighbouring walls meet, shape (n, 2); None when less than a triangle remains."""
    merged = _merge_parallel(walls, tolerance)
    if len(merged) < 3:
        return None
    corners: list[_Points] = []
    for i, wall in enumerate(merged):
        following = merged[(i + 1) % len(merged)]
        cross = math.sin(following[2] - wall[2])
        if abs(cross) > math.sin(math.radians(10)):
            corners.append(_meet(wall, following))
            continue
        # A step between parallel walls, square to them, half way between their ends.
        along = np.array([math.cos(wall[2]), math.sin(wall[2])])
        end = wall[:2] + along * wall[3] / 2
        heading = np.array([math.cos(following[2]), math.sin(following[2])])
        start = following[:2] - heading * following[3] / 2
        middle = (end + start) / 2
        corners.append(wall[:2] + along * ((middle - wall[:2]) @ along))
        corners.append(following[:2] + heading * ((middle - following[:2]) @ heading))
    return np.array(corners)


def _merge_parallel(walls: _Points, tolerance: float) -> list[_Points]:
    """Return the walls with neighbours joined that run the same way less than the tolerance apart."""
    merged = list(walls)
    changed = True
    while changed and len(merged) > 3:
        changed = False
        for i in range(len(merged)):
            one, two = merged[i], merged[(i + 1) % len(merged)]
            turn = (two[2] - one[2] + math.pi) % (2 * math.pi) - math.pi
            offset = abs(math.cos(one[2]) * (two[1] - one[1]) - math.sin(one[2]) * (two[0] - one[0]))
            if abs(turn) < math.radians(2) and offset < tolerance:
                length = one[3] + two[3]
                centre = (one[:2] * one[3] + two[:2] * two[3]) / max(length, 1e-12)
                joined = np.array([*centre, (one if one[3] >= two[3] else two)[2], length])
                following = (i + 1) % len(merged)
                merged[i] = joined
                del merged[following]
                changed = True
                break
    return merged


def _meet(one: _Points, two: _Points) -> _Points:
    """Return where two lines meet."""
    direction = np.array([math.cos(one[2]), math.sin(one[2])])
    other = np.array([math.cos(two[2]), math.sin(two[2])])
    between = two[:2] - one[:2]
    along = (between[0] * other[1] - between[1] * other[0]) / (direction[0] * other[1] - direction[1] * other[0])
    meeting: _Points = one[:2] + along * direction
    return meeting
