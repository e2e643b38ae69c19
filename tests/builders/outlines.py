"""Random outlines: star-shaped polygons around random centres."""

import numpy as np
import shapely

from roofbench.scenes.geodata.footprints import Footprints


def star(rng, vertices, centre, radius=7.0):
    angle = np.sort(rng.uniform(0, 2 * np.pi, vertices))
    reach = rng.uniform(0.3, 1.0, vertices) * radius
    return shapely.Polygon(np.stack([reach * np.cos(angle), reach * np.sin(angle)], axis=1) + centre)


def stars(seed, count, vertices, offset=0.0):
    rng = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        polygon = star(rng, vertices, rng.uniform(-4, 4, 2) + offset)
        if polygon.is_valid:
            found.append(polygon)
    return Footprints.of(found)
