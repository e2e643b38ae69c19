"""Areas of combinations of polygons in rational numbers, by vertical slabs between all vertices and crossings."""

import itertools
from fractions import Fraction

import numpy as np
import shapely

#: Coordinates are multiples of one over this.
LATTICE = 64


def snapped(polygon):
    """Return the polygon with vertices on the lattice, or None where that leaves no valid one."""
    moved = shapely.transform(polygon, lambda xy: np.round(xy * LATTICE) / LATTICE)
    usable = moved.is_valid and moved.area > 0 and moved.geom_type in ("Polygon", "MultiPolygon")
    return moved if usable else None


def _edges(polygon):
    """Return edges that are not vertical, from left to right, in units of the lattice."""
    found = []
    for ring in shapely.get_rings(shapely.get_parts(polygon)):
        points = [(int(x), int(y)) for x, y in np.round(shapely.get_coordinates(ring) * LATTICE)]
        found += [(min(a, b), max(a, b)) for a, b in itertools.pairwise(points) if a[0] != b[0]]
    return found


def _height(edge, x):
    (ax, ay), (bx, by) = edge
    return ay + Fraction(by - ay, bx - ax) * (x - ax)


def _crossing(one, two):
    """Return the x at which two edges cross, None where they do not or are parallel."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = *one, *two
    turn = (bx - ax) * (dy - cy) - (by - ay) * (dx - cx)
    left, right = max(ax, cx), min(bx, dx)
    if turn == 0 or left >= right:
        return None
    x = ax + Fraction(((cx - ax) * (dy - cy) - (cy - ay) * (dx - cx)) * (bx - ax), turn)
    return x if left < x < right else None


def exact_areas(polygons, conditions):
    """Return the exact area where each condition holds, as fractions, square metres.

    A condition is a function of the set of the numbers of the polygons that a point lies in.
    """
    edges = [(edge, number) for number, polygon in enumerate(polygons) for edge in _edges(polygon)]
    places = {Fraction(end[0]) for edge, _ in edges for end in edge}
    for k, (one, _) in enumerate(edges):
        places.update(x for two, _ in edges[:k] if (x := _crossing(one, two)) is not None)
    areas = [Fraction(0)] * len(conditions)
    slabs = sorted(places)
    for left, right in itertools.pairwise(slabs):
        middle = (left + right) / 2
        across = sorted(
            (_height(edge, middle), number) for edge, number in edges if edge[0][0] <= left and edge[1][0] >= right
        )
        inside = set()
        for (low, number), (high, _) in itertools.pairwise(across):
            inside ^= {number}
            # In a slab no edges cross: the height in its middle is the mean height of each trapezoid.
            for place, condition in enumerate(conditions):
                if inside and condition(inside):
                    areas[place] += (high - low) * (right - left)
    return [area / LATTICE**2 for area in areas]
