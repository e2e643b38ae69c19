"""Outlines as arrays: the one form of polygons that compiled code works on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.kernels import kernel
from ...scenes.geodata.footprints import Footprints
from .kept import kept_with_footprints

__all__ = ["Outlines", "outlines_of", "polygons_of"]


class Outlines(NamedTuple):
    """The vertices of many polygons.

    Attributes
    ----------
    start : ndarray of int64, shape (n + 1,)
        Polygon i has the rows ``start[i]`` to ``start[i + 1]`` of `points`.
    points : ndarray, shape (m, 2)
        x, y of the vertices, m: closed rings, the first one first. Further rings follow after a row of NaN.
    sign : ndarray, shape (n,)
        1 where the exterior runs counter-clockwise, -1 where it runs clockwise; holes run the other way.
    bounds : ndarray, shape (n, 4)
        xmin, ymin, xmax, ymax of each polygon, m.
    area : ndarray, shape (n,)
        m2.
    """

    start: NDArray[np.int64]
    points: NDArray[np.float64]
    sign: NDArray[np.float64]
    bounds: NDArray[np.float64]
    area: NDArray[np.float64]

    @classmethod
    def of(cls, start: NDArray[np.int64], points: NDArray[np.float64], area: NDArray[np.float64]) -> Outlines:
        """Return the outlines of these rings (as of `Footprints.rings`) and areas."""
        sign, bounds = np.empty(len(area)), np.empty((len(area), 4))
        _measure(start, points, sign, bounds)
        return cls(start, points, sign, bounds, area)


@kept_with_footprints
def outlines_of(footprints: Footprints) -> Outlines:
    """Return the outlines of footprints."""
    return Outlines.of(*footprints.rings, footprints.areas)


def polygons_of(outlines: Outlines, rows: NDArray[np.int64]) -> NDArray[np.object_]:
    """Return some outlines as polygons, for the few that compiled code leaves to GEOS."""
    polygons = np.empty(len(rows), dtype=object)
    for place, row in enumerate(rows.tolist()):
        points = outlines.points[outlines.start[row] : outlines.start[row + 1]]
        gaps = np.flatnonzero(np.isnan(points[:, 0]))
        rings = [part[~np.isnan(part[:, 0])] for part in np.split(points, gaps)]
        if len(rings) == 1:
            polygons[place] = shapely.Polygon(rings[0])
            continue
        # Of several rings, exteriors run counter-clockwise, and the holes of each one follow it.
        parts: list[list[NDArray[np.float64]]] = []
        for ring in rings:
            if shapely.is_ccw(shapely.linearrings(ring)):
                parts.append([])
            parts[-1].append(ring)
        solids = [shapely.Polygon(part[0], part[1:]) for part in parts]
        polygons[place] = solids[0] if len(solids) == 1 else shapely.MultiPolygon(solids)
    return polygons


@kernel
def _measure(
    start: NDArray[np.int64], points: NDArray[np.float64], sign: NDArray[np.float64], bounds: NDArray[np.float64]
) -> None:
    """Fill the sign and the bounds of each outline."""
    for i in range(len(sign)):
        low = start[i]
        if low == start[i + 1]:  # empty
            sign[i] = 1.0
            bounds[i] = np.nan
            continue
        x, y = points[low, 0], points[low, 1]
        xmin, ymin, xmax, ymax = x, y, x, y
        doubled = 0.0
        for k in range(low, start[i + 1] - 1):
            turn = (points[k, 0] - x) * (points[k + 1, 1] - y) - (points[k + 1, 0] - x) * (points[k, 1] - y)
            if turn == turn:  # no edge leads to or from the NaN between two rings
                doubled += turn
                xmin, ymin = min(xmin, points[k, 0]), min(ymin, points[k, 1])
                xmax, ymax = max(xmax, points[k, 0]), max(ymax, points[k, 1])
        sign[i] = 1.0 if doubled >= 0.0 else -1.0
        bounds[i, 0], bounds[i, 1], bounds[i, 2], bounds[i, 3] = xmin, ymin, xmax, ymax
