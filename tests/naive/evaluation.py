"""Slow, obvious oracles: every definition of the evaluation written as plain loops over shapely polygons."""

import math
from contextlib import contextmanager

import numpy as np
import shapely
from shapely.geometry import Polygon

#: Coordinates are rounded to these grids before areas are computed, m; None: floating precision. On each of them
#: GEOS 3.14 loses or keeps whole faces of near-coincident edges in one of some thousand sets, seldom the same on two.
GRIDS = (1e-10, None, 2e-10, 1e-9, 1e-8)

_grid = GRIDS[0]


@contextmanager
def on(grid):
    """Compute areas on another grid inside the block."""
    global _grid
    before, _grid = _grid, grid
    try:
        yield
    finally:
        _grid = before


def faces(geometry):
    """Return the polygons of a geometry, without the lines and points where outlines only touch."""
    return shapely.MultiPolygon([part for part in shapely.get_parts(geometry) if part.geom_type == "Polygon"])


def intersection(one, two):
    return faces(shapely.intersection(one, two, grid_size=_grid))


def difference(one, two):
    return faces(shapely.difference(one, two, grid_size=_grid))


def union(polygons):
    return faces(shapely.union_all(polygons, grid_size=_grid))


def centre(polygon):
    corners = list(polygon.exterior.coords)[:-1] if polygon.geom_type == "Polygon" else []
    if len(corners) == 4 and not polygon.interiors:
        first = shapely.LineString([corners[0], corners[2]])
        second = shapely.LineString([corners[1], corners[3]])
        crossing = first.intersection(second)
        if crossing.geom_type == "Point" and not crossing.is_empty:
            return crossing.x, crossing.y
    return polygon.centroid.x, polygon.centroid.y


def overlap(one, two):
    area = intersection(one, two).area
    return area if area > 1e-6 * min(one.area, two.area) else 0.0


def correspondence(detected, reference, matching="nearest"):
    """Return {detection: reference} and {detection: nearest overlapped reference}."""
    pairs = []
    for d, one in enumerate(detected):
        for r, two in enumerate(reference):
            area = overlap(one, two)
            if area:
                distance = round(math.dist(centre(one), centre(two)), 6)
                pairs.append((distance, -round(area, 6), r, d))
    nearest = {}
    for _, _, r, d in sorted(pairs):
        nearest.setdefault(d, r)
    matches = {}
    if matching == "one-pass":
        claimed = set()
        for _, _, r, d in sorted(pairs):
            if nearest[d] == r and r not in claimed:
                claimed.add(r)
                matches[d] = r
        return matches, nearest
    if matching == "overlap":
        pairs = [(area, distance, r, d) for distance, area, r, d in pairs]
    for _, _, r, d in sorted(pairs):
        if d not in matches and r not in matches.values():
            matches[d] = r
    return matches, nearest


def evaluate(detected, reference, building=None, **options):
    """Return counts, areas T, F, M and the sums of the pairs, as the definitions word them.

    Where two grids disagree, each number is the median of five grids.
    """
    found = []
    for grid in GRIDS:
        if len(found) == 2 and all(
            math.isclose(v, found[1][k], rel_tol=1e-9, abs_tol=1e-6) for k, v in found[0].items()
        ):
            return found[0]
        with on(grid):
            found.append(evaluate_once(detected, reference, building, **options))
    return {key: sorted(one[key] for one in found)[2] for key in found[0]}


def evaluate_once(detected, reference, building=None, *, matching="nearest", area=None, minimum_area=0.0):
    building = list(range(len(reference))) if building is None else list(building)
    counted_r = [
        r
        for r, polygon in enumerate(reference)
        if polygon.area >= minimum_area and (area is None or area.intersects(shapely.Point(centre(polygon))))
    ]
    matches, nearest = correspondence(detected, [reference[r] for r in counted_r], matching)
    matches = {d: counted_r[r] for d, r in matches.items()}
    nearest = {d: counted_r[r] for d, r in nearest.items()}
    counted_d = []
    for d, polygon in enumerate(detected):
        touches_any = any(overlap(polygon, other) for other in reference)
        outside = area is not None and not area.intersects(shapely.Point(centre(polygon)))
        if d in matches or not (outside or (touches_any and d not in nearest)):
            counted_d.append(d)
    multiple = [d for d in counted_d if d not in matches and d in nearest]
    false_positive = [d for d in counted_d if d not in matches and d not in nearest]
    false_negative = [r for r in counted_r if r not in matches.values()]

    overlapping = 0
    for one in counted_d:
        for two in counted_d:
            natural = one in matches and two in matches and building[matches[one]] == building[matches[two]]
            if one != two and overlap(detected[one], detected[two]) and not natural:
                overlapping += 1
                break
    cross_lapping = sum(
        len({building[r] for r in counted_r if overlap(detected[d], reference[r])}) > 1 for d in counted_d
    )
    cross_lapped = 0
    for r in counted_r:
        claimants = [d for d in counted_d if overlap(detected[d], reference[r])]
        own = [d for d in claimants if not (d in matches and matches[d] != r and building[matches[d]] == building[r])]
        cross_lapped += len(own) > 1

    def clip(polygon):
        # An empty buffer leaves out the lines and points where the polygon only touches the area.
        return polygon if area is None else intersection(polygon, area).buffer(0)

    pairs = [(clip(detected[d]), clip(reference[r])) for d, r in matches.items()]
    true = union([intersection(one, two) for one, two in pairs])
    commission = [difference(one, two) for one, two in pairs] + [clip(detected[d]) for d in false_positive]
    omission = [difference(two, one) for one, two in pairs] + [clip(reference[r]) for r in false_negative]
    return {
        "counts.detected": len(counted_d),
        "counts.reference": len(counted_r),
        "counts.true_positives": len(matches),
        "counts.false_positives": len(false_positive),
        "counts.false_negatives": len(false_negative),
        "counts.multiple_detections": len(multiple),
        "counts.overlapping_detections": overlapping,
        "counts.cross_lapping_detections": cross_lapping,
        "counts.cross_lapped_references": cross_lapped,
        "areas.true_positive": true.area,
        "areas.false_positive": difference(union(commission), true).area,
        "areas.false_negative": difference(union(omission), true).area,
        **literal_areas(
            matches, building, lambda d: clip(detected[d]), lambda r: clip(reference[r]), false_positive, false_negative
        ),
        "areas.pair_detected": sum(one.area for one, _ in pairs),
        "areas.pair_reference": sum(two.area for _, two in pairs),
        "areas.pair_shared": sum(intersection(one, two).area for one, two in pairs),
        "geometric.sum_squared": sum(outline_distance(detected[d], reference[r]) ** 2 for d, r in matches.items()),
        "geometric.sum_polis": sum(polis(detected[d], reference[r]) for d, r in matches.items()),
    }


def literal_areas(matches, building, one_of, two_of, false_positive, false_negative):
    """Return T, F and M entity by entity, what parts of one building share once."""
    true = omission = 0.0
    commission = sum(one_of(d).area for d in false_positive)
    for label in dict.fromkeys(building):
        own = [(one_of(d), two_of(r)) for d, r in matches.items() if building[r] == label]
        missed = [two_of(r) for r in false_negative if building[r] == label]
        found = union([intersection(one, two) for one, two in own])
        true += found.area
        commission += difference(union([one for one, _ in own]), found).area
        omission += difference(union([*(two for _, two in own), *missed]), found).area
    return {
        "literal_areas.true_positive": true,
        "literal_areas.false_positive": commission,
        "literal_areas.false_negative": omission,
    }


def is_convex_quadrilateral(polygon):
    if polygon.geom_type != "Polygon" or polygon.interiors or len(polygon.exterior.coords) != 5:
        return False
    return math.isclose(polygon.convex_hull.area, polygon.area, rel_tol=1e-12)


def outline_distance(one, two):
    if is_convex_quadrilateral(one) and is_convex_quadrilateral(two):
        return corner_distance(one, two)
    return polis(one, two)


def corner_distance(one, two):
    first = np.array(shapely.geometry.polygon.orient(one).exterior.coords)[:-1]
    second = np.array(shapely.geometry.polygon.orient(two).exterior.coords)[:-1]
    best = min(np.mean([math.dist(first[i], second[(i + shift) % 4]) ** 2 for i in range(4)]) for shift in range(4))
    return math.sqrt(best)


def polis(one, two):
    def vertices(polygon):
        parts = polygon.geoms if polygon.geom_type == "MultiPolygon" else [polygon]
        rings = [ring for part in parts for ring in (part.exterior, *part.interiors)]
        return [point for ring in rings for point in list(ring.coords)[:-1]]

    def one_way(first, second):
        return np.mean([second.boundary.distance(shapely.Point(point)) for point in vertices(first)])

    return (one_way(one, two) + one_way(two, one)) / 2


def pixel_areas(detected, reference, matches, false_positive, false_negative, west, north, gsd):
    """Return T, F, M in m2 by asking every pixel centre of the bounding box."""
    everything = [*detected, *reference]
    xmin, ymin, xmax, ymax = shapely.total_bounds(np.array(everything, dtype=object))
    columns = range(math.floor((xmin - west) / gsd) - 1, math.ceil((xmax - west) / gsd) + 1)
    rows = range(math.floor((north - ymax) / gsd) - 1, math.ceil((north - ymin) / gsd) + 1)
    column, row = np.meshgrid(columns, rows)
    x, y = west + (column + 0.5) * gsd, north - (row + 0.5) * gsd

    def mask(polygon):
        return shapely.contains_xy(polygon, x, y)

    empty = np.zeros(x.shape, dtype=bool)
    true, commission, omission = empty.copy(), empty.copy(), empty.copy()
    for d, r in matches.items():
        one, two = mask(detected[d]), mask(reference[r])
        true |= one & two
        commission |= one & ~two
        omission |= two & ~one
    for d in false_positive:
        commission |= mask(detected[d])
    for r in false_negative:
        omission |= mask(reference[r])
    cell = gsd * gsd
    return true.sum() * cell, (commission & ~true).sum() * cell, (omission & ~true).sum() * cell


def rectangle(x, y, length, width, angle):
    c, s = math.cos(angle), math.sin(angle)
    corners = [(-length / 2, -width / 2), (length / 2, -width / 2), (length / 2, width / 2), (-length / 2, width / 2)]
    return Polygon([(x + c * u - s * v, y + s * u + c * v) for u, v in corners])
