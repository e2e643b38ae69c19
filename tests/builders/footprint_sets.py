"""Random footprint sets with everything that makes evaluation hard: L shapes, chains, nests, rows, duplicates."""

import math

import numpy as np
import shapely
from naive.evaluation import rectangle
from shapely import affinity


def random_reference(rng, *, general=False):
    """Return polygons and building ids of one small scene, some 2 to 14 polygons."""
    polygons, building = [], []

    def add(new, label):
        polygons.extend(new)
        building.extend([label] * len(new))

    for label in range(rng.integers(1, 6)):
        x, y, angle = rng.uniform(0, 60), rng.uniform(0, 60), rng.uniform(0, math.pi)
        kind = rng.choice(["single", "L", "row", "nest", "courtyard", "irregular"])
        if kind == "L":
            wing = rectangle(x + 4 * math.cos(angle), y + 4 * math.sin(angle), 6, 14, angle)
            add([rectangle(x, y, 14, 6, angle), wing], label)
        elif kind == "row":
            parts = [shapely.box(7 * k, 0, 7 * (k + 1), 9) for k in range(rng.integers(2, 5))]
            for number, part in enumerate(parts):
                turned = affinity.rotate(part, math.degrees(angle), origin=(0, 0))
                add([affinity.translate(turned, x, y)], 100 * (label + 1) + number)
        elif kind == "nest":
            add([rectangle(x, y, 20, 15, angle)], label)
            add([rectangle(x + 1, y, 6, 5, angle)], label + 1000)
        elif kind == "courtyard" and general:
            add([rectangle(x, y, 22, 18, angle).difference(rectangle(x, y, 9, 7, angle))], label)
        elif kind == "irregular" and general:
            turns = np.sort(rng.uniform(0, 2 * math.pi, rng.integers(5, 12)))
            radii = rng.uniform(3, 9, len(turns))
            ring = np.stack([x + radii * np.cos(turns), y + radii * np.sin(turns)], axis=1)
            polygon = shapely.make_valid(shapely.Polygon(ring))
            if polygon.geom_type in ("Polygon", "MultiPolygon") and polygon.area > 1:
                add([polygon], label)
        else:
            add([rectangle(x, y, rng.uniform(4, 20), rng.uniform(4, 12), angle)], label)
    return polygons, building


def random_detections(rng, reference):
    """Return detections that are shifted, split, merged, duplicated, missing or false."""
    detected = []
    for polygon in reference:
        fate = rng.choice(["shift", "exact", "miss", "split", "double", "grow"], p=[0.4, 0.1, 0.15, 0.1, 0.15, 0.1])
        dx, dy = rng.normal(0, 1.5, 2)
        if fate == "shift":
            detected.append(affinity.translate(polygon, dx, dy))
        elif fate == "exact":
            detected.append(polygon)
        elif fate == "split":
            x, y = polygon.centroid.coords[0]
            detected += [rectangle(x - 3, y, 5, 6, 0.3), rectangle(x + 3, y, 5, 6, 0.3)]
        elif fate == "double":
            detected += [polygon, affinity.translate(polygon, dx / 3, dy / 3)]
        elif fate == "grow":
            detected.append(affinity.scale(polygon, 1.7, 1.4))
    for _ in range(rng.integers(0, 3)):
        x, y = rng.uniform(0, 60, 2)
        detected.append(rectangle(x, y, rng.uniform(2, 8), rng.uniform(2, 8), rng.uniform(0, 3)))
    return [detected[k] for k in rng.permutation(len(detected))]


def footprints_on_a_lattice(rng, count):
    """Return footprints at half metres: edges that coincide, courtyards with a house in them, pieces, duplicates."""
    polygons = []
    for _ in range(count):
        x, y = np.round(rng.uniform(0, 40, 2) * 2) / 2
        width, depth = rng.integers(2, 16, 2)
        whole = shapely.box(x, y, x + width, y + depth)
        court = shapely.box(x + width / 4, y + depth / 4, x + 3 * width / 4, y + 3 * depth / 4)
        kind = rng.choice(["plain", "courtyard", "pieces", "nest", "duplicate"], p=[0.35, 0.15, 0.15, 0.15, 0.2])
        if kind == "courtyard":
            polygons.append(whole - court)
        elif kind == "pieces":
            polygons.append(whole | shapely.box(x + width + 3, y, x + width + 6, y + 4))
        elif kind == "nest":
            polygons.append((whole - court) | affinity.scale(court, 0.5, 0.5))
        elif kind == "duplicate" and polygons:
            polygons.append(polygons[rng.integers(len(polygons))])
        else:
            polygons.append(whole)
    return polygons
