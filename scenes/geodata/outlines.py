"""Outlines: from a mask on a grid to polygons, for detections and for references alike.

Nouns
-----
coverage
    Share of each cell that belongs to an object, 0..1, shape (rows, columns). The outline is where the share,
    interpolated between cell centres, is one half: it is located to a fraction of a cell.

Coordinates are metres, x east and y north.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from .raster import Grid

__all__ = ["coverage_of_mask", "minimum_rectangles", "simplify", "trace"]

#: Fractions of a metre to which traced places are rounded: a power of two, so that an outline is the same to the last
#: bit in every window of a scene, and what is decided by ties (which vertex is farthest) is decided alike.
_FRACTIONS = 65536


def coverage_of_mask(mask: NDArray[np.bool_], share: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """Return the coverage whose outline encloses exactly the centres of a mask's cells.

    Parameters
    ----------
    mask : ndarray of bool, shape (rows, columns)
    share : ndarray of float32, shape (rows, columns), optional
        Measured share of each cell that is covered; it places the outline between the centres. NaN is unknown.

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
    """Return the polygons, with holes, where the coverage, which is known everywhere, exceeds one half.

    Objects that reach the border of the grid end there.
    """
    import contourpy

    x, y = grid.to_world(np.arange(-1, grid.rows + 1) + 0.5, np.arange(-1, grid.columns + 1) + 0.5)
    padded = np.zeros((grid.rows + 2, grid.columns + 2))
    padded[1:-1, 1:-1] = coverage
    # An array that only the call held is released.
    del coverage
    # Not contourpy.contour_generator, which takes longer to look for cells to leave out than to trace a small outline.
    no_mask: Any = None
    generator = contourpy.SerialContourGenerator(
        *np.meshgrid(x, y),
        padded,
        no_mask,
        corner_mask=True,
        line_type=contourpy.SerialContourGenerator.default_line_type,
        fill_type=contourpy.FillType.OuterOffset,
        quad_as_tri=False,
        z_interp=contourpy.ZInterp.Linear,
    )
    filled: Any = generator.filled(0.5, np.inf)
    rings, offsets = filled
    polygons = np.empty(len(rings), dtype=object)
    for number, (points, offset) in enumerate(zip(rings, offsets, strict=True)):
        places = np.round(points * _FRACTIONS) / _FRACTIONS
        parts = [shapely.linearrings(places[a:b]) for a, b in itertools.pairwise(offset.tolist())]
        polygons[number] = shapely.polygons(parts[0], parts[1:] or None)
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
