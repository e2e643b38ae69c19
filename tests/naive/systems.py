"""Slow, obvious oracles of the other evaluation systems: their definitions as plain loops over shapely polygons."""

import cmath
import itertools
import math

import shapely

from naive.evaluation import difference, intersection, overlap, union


def covered_share(polygon, others):
    """Return which share of a polygon lies inside any of the others that overlap it."""
    inside = [intersection(polygon, other) for other in others if overlap(polygon, other)]
    return union(inside).area / polygon.area if inside else 0.0


def touched(polygon, others):
    return [row for row, other in enumerate(others) if overlap(polygon, other)]


def main_partner(polygon, others):
    """Return the row of the polygon that shares the most area, None without any."""
    areas = {row: overlap(polygon, others[row]) for row in touched(polygon, others)}
    return max(areas, key=lambda row: (areas[row], -row)) if areas else None


def groups(detected, reference):
    """Return the connected groups of the overlap graph as (detections, references)."""
    left, found = set(range(len(reference))), []
    free = set(range(len(detected)))
    while left or free:
        ds, rs = (set(), {left.pop()}) if left else ({free.pop()}, set())
        grown = True
        while grown:
            more_d = {d for r in rs for d in touched(reference[r], detected)} - ds
            more_r = {r for d in ds for r in touched(detected[d], reference)} - rs
            ds, rs, grown = ds | more_d, rs | more_r, bool(more_d or more_r)
        left -= rs
        free -= ds
        found.append((sorted(ds), sorted(rs)))
    return found


def iou(one, two):
    shared = overlap(one, two)
    return round(min(shared / (one.area + two.area - shared), 1.0), 9)


def greedy(detected, reference, confidence, threshold):
    """Return {detection: reference}: by falling confidence, each takes the best remaining reference."""
    best = [max((iou(one, two) for two in reference), default=0.0) for one in detected]
    order = sorted(range(len(detected)), key=lambda d: (-(best if confidence is None else confidence)[d], -best[d]))
    matches, free = {}, set(range(len(reference)))
    for d in order:
        found = [(iou(detected[d], reference[r]), -r) for r in free]
        found = [pair for pair in found if pair[0] >= threshold and overlap(detected[d], reference[-pair[1]])]
        if found:
            matches[d] = -max(found)[1]
            free.remove(matches[d])
    return matches


def outline_points(polygon):
    parts = polygon.geoms if polygon.geom_type == "MultiPolygon" else [polygon]
    return [list(ring.coords) for part in parts for ring in (part.exterior, *part.interiors)]


def corners(polygon):
    return sum(len(ring) - 1 for ring in outline_points(polygon))


def hausdorff(one, two):
    """Return the largest distance of a vertex of either outline from the other outline."""
    ways = ((one, two), (two, one))
    return max(b.boundary.distance(shapely.Point(p)) for a, b in ways for ring in outline_points(a) for p in ring)


def band_iou(one, two, width):
    bands = [difference(polygon, polygon.buffer(-width)) for polygon in (one, two)]
    shared = intersection(*bands).area
    return shared / (bands[0].area + bands[1].area - shared)


def directions(polygon):
    pairs = [pair for ring in outline_points(polygon) for pair in itertools.pairwise(ring) if pair[0] != pair[1]]
    return [math.degrees(math.atan2(b[1] - a[1], b[0] - a[0])) % 180 for a, b in pairs]


def angle(one, two):
    return min(abs(one - two), 180 - abs(one - two))


def edge_angle_error(one, two):
    return max(min(angle(a, b) for b in directions(two)) for a in directions(one))


def turning_function(polygon):
    """Return the places (0 to 1) of the vertices of a ring, and the direction that follows each, growing by turns."""
    points = [complex(x, y) for x, y in shapely.orient_polygons(polygon).exterior.coords]
    edges = [b - a for a, b in itertools.pairwise(points)]
    places = [sum(map(abs, edges[:k])) / sum(map(abs, edges)) for k in range(len(edges))]
    turns = [cmath.phase(b / a) for a, b in itertools.pairwise(edges)]
    return places, list(itertools.accumulate([cmath.phase(edges[0]), *turns]))


def turning_distance(one, two):
    """Return the least root mean square difference of two turning functions, over all vertices as starting points."""
    (s, a), (u, b) = turning_function(one), turning_function(two)

    def at(places, directions, way):
        round_, rest = divmod(way, 1.0)
        return directions[max(k for k, place in enumerate(places) if place <= rest)] + 2 * math.pi * round_

    squares = []
    for shift in (x - y for x in s for y in u):
        cuts = sorted({0.0, 1.0, *u, *((x - shift) % 1.0 for x in s)})
        pieces = [(high - low, (low + high) / 2) for low, high in itertools.pairwise(cuts)]
        steps = [(width, at(s, a, middle + shift) - at(u, b, middle)) for width, middle in pieces]
        mean = sum(width * step for width, step in steps)
        squares.append(sum(width * (step - mean) ** 2 for width, step in steps))
    return math.sqrt(min(squares))


def matched_corners(one, two, radius):
    """Return the distances of the corners that are matched one to one, the nearest first."""
    sides = [[p for ring in outline_points(polygon) for p in ring[:-1]] for polygon in (one, two)]
    near = [(round(math.dist(p, q), 9), i, j) for i, p in enumerate(sides[0]) for j, q in enumerate(sides[1])]
    free, found = [set(range(len(side))) for side in sides], []
    for distance, i, j in sorted(near):
        if distance <= radius and i in free[0] and j in free[1]:
            free[0].remove(i)
            free[1].remove(j)
            found.append(distance)
    return found


def orthogonality(polygon):
    axis = directions(polygon.minimum_rotated_rectangle)[0]
    own = directions(polygon)
    return sum(min(angle(a, axis), angle(a, (axis + 90) % 180)) <= 5 for a in own) / len(own)
