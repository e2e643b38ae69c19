"""Slow, obvious oracles of the other evaluation systems: their definitions as plain loops over shapely polygons."""

import shapely

from naive.evaluation import overlap


def covered_share(polygon, others):
    """Return which share of a polygon lies inside any of the others that overlap it."""
    inside = [polygon.intersection(other) for other in others if overlap(polygon, other)]
    return shapely.union_all(inside).area / polygon.area if inside else 0.0


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
