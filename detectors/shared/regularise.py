"""Regularisation of traced outlines: straight walls and right angles.

Nouns
-----
wall
    A straight part of an outline between two corners: a line fitted to the traced points there. A ring's walls are an
    array of shape (n, 4): centre x and y in metres, direction in radians, length in metres; in order round the ring.
main directions
    The few directions, modulo 90 degrees, that most of the length of an outline follows.

Coordinates are metres, x east and y north; angles are counted from x towards y.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.outlines import simplify

__all__ = ["regularise"]

_Points = NDArray[np.float64]
#: A wall that is worked on by itself: four numbers as in the arrays, without the overhead of small arrays.
_Wall = tuple[float, float, float, float]
_Place = tuple[float, float]

#: Largest angle between walls of one direction (degrees), least share of the length for a main direction, their number.
_SAME_DIRECTION, _MAIN_SHARE, _MOST_DIRECTIONS = 5.0, 0.15, 4
#: Angle of neighbouring walls below which they are parallel (radians), and sine of the one below which their lines meet
#: too far away.
_PARALLEL, _GRAZING = math.radians(2), math.sin(math.radians(10))


def regularise(
    polygons: NDArray[np.object_],
    tolerance: float,
    *,
    angle: float = 15.0,
    least_agreement: float = 0.85,
    reach: float = math.inf,
) -> NDArray[np.object_]:
    """Return the polygons with walls along their main directions and right angles between them.

    Each polygon is simplified and its walls are fitted to the traced points between the corners. Walls within `angle`
    of a main direction, and short walls whose direction is uncertain, are rotated into it. Parallel neighbouring walls
    are merged or joined by a step; corners are where neighbouring walls meet. A polygon whose result is invalid, or has
    an intersection over union below `least_agreement` with the traced one, is only simplified.

    Parameters
    ----------
    polygons : ndarray of Polygon, shape (n,)
        As traced, with all their vertices.
    tolerance : float
        Largest distance of traced points from a wall, metres.
    angle : float
        Degrees.
    least_agreement : float
        0..1.
    reach : float
        Metres. In a polygon longer than twice that, the main directions of a wall are those of the walls whose centres
        are so near, so that what a wall becomes does not depend on a far end that a window of a scene may not show.
    """
    simple = simplify(polygons, tolerance)
    regular = np.empty(len(polygons), dtype=object)
    for number, (traced, plain) in enumerate(zip(polygons, simple, strict=True)):
        regular[number] = _regular(traced, plain, tolerance, math.radians(angle), reach)
    # None is not valid.
    valid = np.flatnonzero(shapely.is_valid(regular))
    common = shapely.area(shapely.intersection(regular[valid], polygons[valid]))
    together = shapely.area(regular[valid]) + shapely.area(polygons[valid]) - common
    agreeing = valid[common >= least_agreement * together]
    simple[agreeing] = regular[agreeing]
    return simple


def _regular(traced: Any, simple: Any, tolerance: float, angle: float, reach: float) -> Any | None:
    """Return one regularised polygon, or None when its exterior ring has fewer than three corners."""
    bounds = shapely.bounds(traced)
    origin = bounds[:2]
    sources, corners = ([ring - origin for ring in _rings(polygon)] for polygon in (traced, simple))
    is_long = max(bounds[2] - bounds[0], bounds[3] - bounds[1]) > 2 * reach
    if is_long:
        corners = [_corners_by_squares(ring, origin, tolerance, reach) for ring in sources]
        corners = [ring for number, ring in enumerate(corners) if number == 0 or len(ring) >= 3]
    rings = []
    for ring in corners:
        walls = _fit_walls(ring, sources)
        if walls is None:
            return None
        rings.append(walls)
    together = np.concatenate(rings)
    mains = np.empty((0, 0)) if is_long else _main_directions(together)
    outlines = []
    for walls in rings:
        if is_long:
            turned = _turned_by_neighbours(walls, together, tolerance, angle, reach)
        else:
            turned = _turned(walls, mains, tolerance, angle)
        merged = _merged([(x, y, along, length) for x, y, along, length in turned.tolist()], tolerance)
        outlines.append(_corners(_merged(_without_jogs(merged, tolerance), tolerance), tolerance))
    if len(outlines[0]) < 3:
        return None
    shell, *holes = [shapely.linearrings(ring + origin) for ring in outlines if len(ring) >= 3]
    return shapely.polygons(shell, holes or None)


def _rings(polygon: Any) -> list[_Points]:
    """Return the places of each ring, the exterior one first, each place once."""
    places = shapely.get_coordinates(polygon)
    if shapely.get_num_interior_rings(polygon) == 0:
        return [places[:-1]]
    ends = np.cumsum(shapely.get_num_coordinates(shapely.get_rings(polygon)))
    return [places[first : end - 1] for first, end in itertools.pairwise([0, *ends.tolist()])]


def _corners_by_squares(ring: _Points, origin: _Points, tolerance: float, side: float) -> _Points:
    """Return the corners of a traced ring, simplified between the places where it enters a square of a fixed grid."""
    square = np.floor((ring + origin) / side)
    entered = np.flatnonzero((square != np.roll(square, 1, axis=0)).any(axis=1))
    if len(entered) < 2:
        whole: _Points = shapely.get_coordinates(shapely.simplify(shapely.LinearRing(ring), tolerance))
        return whole[:-1]
    ring = np.roll(ring, -entered[0], axis=0)
    ends = np.append(entered - entered[0], len(ring))
    closed = np.concatenate([ring, ring[:1]])
    arcs = [shapely.LineString(closed[one : other + 1]) for one, other in itertools.pairwise(ends)]
    return np.concatenate([shapely.get_coordinates(arc)[:-1] for arc in shapely.simplify(np.array(arcs), tolerance)])


def _turned_by_neighbours(walls: _Points, others: _Points, tolerance: float, angle: float, reach: float) -> _Points:
    """Return the walls, each rotated into the main directions of the walls around it."""
    turned = walls.copy()
    for number, wall in enumerate(walls):
        near = np.hypot(others[:, 0] - wall[0], others[:, 1] - wall[1]) <= reach
        turned[number] = _turned(walls[number : number + 1], _main_directions(others[near]), tolerance, angle)[0]
    return turned


def _fit_walls(corners: _Points, sources: list[_Points]) -> _Points | None:
    """Return the walls between the corners, fitted to the traced ring that the corners are points of.

    Total least-squares lines, weighted by the length of each traced step; a wall of few steps joins its corners. None
    when no ring contains all corners.
    """
    for ring in sources:
        position = _positions(corners, ring)
        if position is not None:
            break
    else:
        return None
    if ((np.concatenate([position[1:], position[:1]]) - position) % len(ring)).sum() != len(ring):
        # The simplified ring runs the other way round.
        ring = ring[::-1]
        position = len(ring) - 1 - position
    # Start at a corner, so that the steps of each wall are contiguous.
    first = int(position[0])
    ring = np.concatenate([ring[first:], ring[: first + 1]])
    step = ring[1:] - ring[:-1]
    ring = ring[:-1]
    start = (position - first) % len(ring)
    length = np.hypot(step[:, 0], step[:, 1])
    middle = ring + step / 2
    total = np.maximum(np.add.reduceat(length, start), 1e-12)
    centre = np.add.reduceat(middle * length[:, None], start) / total[:, None]
    steps = np.append(start[1:], len(ring)) - start
    wall = np.repeat(np.arange(len(start)), steps)
    x, y = (middle - centre[wall]).T
    xx, xy, yy = (np.add.reduceat(length * product, start) for product in (x * x, x * y, y * y))
    across = np.roll(corners, -1, axis=0) - corners
    chord = np.arctan2(across[:, 1], across[:, 0])
    fitted = np.arctan2(2 * xy, xx - yy) / 2
    fitted += np.pi * np.round((chord - fitted) / np.pi)
    few = steps < 4
    direction = np.where(few, chord, fitted)
    centre[few] = (corners + across / 2)[few]
    return np.column_stack([centre, direction, np.hypot(across[:, 0], across[:, 1])])


def _positions(corners: _Points, ring: _Points) -> NDArray[np.intp] | None:
    """Return the indices of the corners in a ring, or None when one is missing."""
    ring_keys, keys = ring[:, 0] + 1j * ring[:, 1], corners[:, 0] + 1j * corners[:, 1]
    order = np.argsort(ring_keys)
    found = order[np.searchsorted(ring_keys[order], keys).clip(max=len(ring) - 1)]
    return found if np.array_equal(ring_keys[found], keys) else None


def _main_directions(walls: _Points) -> _Points:
    """Return the main directions, radians in 0..pi/2, the most frequent first."""
    degrees = np.degrees(walls[:, 2]) % 90
    # Long walls determine a direction better than several short ones of the same total length.
    remaining = walls[:, 3] ** 1.5
    least = _MAIN_SHARE * remaining.sum()
    away = (degrees[:, None] - degrees[None, :] + 45) % 90 - 45
    near = np.abs(away) < _SAME_DIRECTION
    mains: list[float] = []
    while len(mains) < _MOST_DIRECTIONS:
        support = (near * remaining[:, None]).sum(axis=0)
        best = int(np.argmax(support))
        if support[best] <= 0 or support[best] < least:
            break
        followers = near[:, best]
        weights = remaining[followers]
        mains.append(degrees[best] + (away[followers, best] * weights).sum() / weights.sum())
        remaining[np.abs(away[:, best]) < 2 * _SAME_DIRECTION] = 0
    return np.radians(mains) % (math.pi / 2)


def _turned(walls: _Points, mains: _Points, tolerance: float, angle: float) -> _Points:
    """Return the walls, with those near a main direction rotated into it."""
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


def _merged(walls: list[_Wall], tolerance: float) -> list[_Wall]:
    """Return the walls with parallel neighbours less than the tolerance apart merged."""
    merged: list[_Wall] = []
    for wall in walls:
        merged.append(wall)
        while len(merged) > 1 and _continues(merged[-2], merged[-1], tolerance):
            merged[-2:] = [_joined(merged[-2], merged[-1])]
    # The first wall may continue the last one: a ring may start within a wall.
    while len(merged) > 1 and _continues(merged[-1], merged[0], tolerance):
        merged[0] = _joined(merged.pop(), merged[0])
    return merged


def _continues(one: _Wall, two: _Wall, tolerance: float) -> bool:
    turn = (two[2] - one[2] + math.pi) % (2 * math.pi) - math.pi
    if abs(turn) >= _PARALLEL:
        return False
    return abs(math.cos(one[2]) * (two[1] - one[1]) - math.sin(one[2]) * (two[0] - one[0])) < tolerance


def _joined(one: _Wall, two: _Wall) -> _Wall:
    length = one[3] + two[3]
    x, y = ((one[axis] * one[3] + two[axis] * two[3]) / max(length, 1e-12) for axis in (0, 1))
    return x, y, (one if one[3] >= two[3] else two)[2], length


def _without_jogs(walls: list[_Wall], tolerance: float) -> list[_Wall]:
    """Return the walls without short ones that cut a corner or shift a wall by less than the tolerance."""
    kept = list(walls)
    position = 0
    while position < len(kept) and len(kept) > 3:
        wall, before, after = kept[position], kept[position - 1], kept[(position + 1) % len(kept)]
        if wall[3] < 6 * tolerance and _close_up(before, after, wall, tolerance):
            del kept[position]
        else:
            position += 1
    return kept


def _close_up(before: _Wall, after: _Wall, wall: _Wall, tolerance: float) -> bool:
    """Return whether the neighbours of a wall continue each other, or meet near it."""
    meeting = _meeting(before, after)
    if meeting is None:
        return _continues(before, after, tolerance)
    right, up = meeting[0] - wall[0], meeting[1] - wall[1]
    cos, sin = math.cos(wall[2]), math.sin(wall[2])
    return abs(cos * up - sin * right) < 2.5 * tolerance and abs(cos * right + sin * up) < wall[3] / 2 + tolerance


def _meeting(one: _Wall, two: _Wall) -> _Place | None:
    """Return where the lines of two walls meet; None when they are nearly parallel."""
    cos, sin, onward_cos, onward_sin = math.cos(one[2]), math.sin(one[2]), math.cos(two[2]), math.sin(two[2])
    cross = cos * onward_sin - sin * onward_cos
    if abs(cross) < _GRAZING:
        return None
    gap = (two[0] - one[0]) * onward_sin - (two[1] - one[1]) * onward_cos
    return one[0] + cos * gap / cross, one[1] + sin * gap / cross


def _corners(walls: list[_Wall], tolerance: float) -> _Points:
    """Return the corners of a ring, shape (n, 2): where neighbouring walls meet, or the two ends of a step."""
    corners: list[_Place] = []
    for wall, following in zip(walls, [*walls[1:], *walls[:1]], strict=True):
        cos, sin, onward_cos, onward_sin = (
            math.cos(wall[2]), math.sin(wall[2]), math.cos(following[2]), math.sin(following[2])
        )  # fmt: skip
        x = (wall[0] + cos * wall[3] / 2 + following[0] - onward_cos * following[3] / 2) / 2
        y = (wall[1] + sin * wall[3] / 2 + following[1] - onward_sin * following[3] / 2) / 2
        meeting = _meeting(wall, following)
        if meeting is not None and math.hypot(meeting[0] - x, meeting[1] - y) < 4 * tolerance:
            corners.append(meeting)
        else:
            # Walls that are parallel, or meet far away, are joined by a step.
            along = (x - wall[0]) * cos + (y - wall[1]) * sin
            onward = (x - following[0]) * onward_cos + (y - following[1]) * onward_sin
            corners.append((wall[0] + cos * along, wall[1] + sin * along))
            corners.append((following[0] + onward_cos * onward, following[1] + onward_sin * onward))
    return np.array(corners)
