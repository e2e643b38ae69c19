"""Places: the extents that a map shows where footprints lie far apart, since on one map of all nothing is seen."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

__all__ = ["Extent", "places_of"]

#: ``(xmin, ymin, xmax, ymax)``; None stands for all footprints.
Extent = tuple[float, float, float, float] | None

_MOST = 9


def places_of(polygons: NDArray[np.object_]) -> tuple[list[Extent], int]:
    """Return the extents to draw, at most nine, and how many there are: one, unless footprints are too small to see."""
    if not len(polygons):
        return [None], 1
    xmin, ymin, xmax, ymax = shapely.total_bounds(polygons)
    span = max(xmax - xmin, ymax - ymin)
    if np.sqrt(np.median(shapely.area(polygons))) > span / 300:
        return [None], 1
    from scipy import ndimage

    centres = shapely.get_coordinates(shapely.centroid(polygons))
    cells = np.floor((centres - [xmin, ymin]) / span * 50).astype(int)
    occupied = np.zeros((52, 52), dtype=bool)
    occupied[cells[:, 0], cells[:, 1]] = True
    label = ndimage.label(occupied, structure=np.ones((3, 3)))[0][cells[:, 0], cells[:, 1]]
    numbers, counts = np.unique(label, return_counts=True)
    extents = [tuple(shapely.total_bounds(polygons[label == number])) for number in numbers[np.argsort(-counts)]]
    covered = sum((extent[2] - extent[0]) * (extent[3] - extent[1]) for extent in extents[:_MOST])
    if covered > 0.3 * (xmax - xmin) * (ymax - ymin):
        return [None], 1
    return list(extents[:_MOST]), len(extents)
