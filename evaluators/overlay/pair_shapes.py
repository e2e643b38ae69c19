"""How similar in shape two matched footprints are; every function measures many pairs at once.

`first` and `second` are arrays of polygons of one length, pair by pair; the results have that shape, too.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from .overlaps import shared_areas

__all__ = [
    "boundary_iou",
    "complexity_factor",
    "corner_counts",
    "hausdorff_distances",
    "largest_edge_angle_error",
    "orthogonal_edges",
    "simplicity_factor",
]

#: Numbers of corners at which simplicity is assessed.
_SIMPLICITY_CORNERS = (50, 90, 500)


def corner_counts(polygons: NDArray[np.object_]) -> NDArray[np.int64]:
    """Return the number of vertices of each polygon over all its rings, closing ones not counted."""
    parts, owner = shapely.get_parts(polygons, return_index=True)
    rings, part = shapely.get_rings(parts, return_index=True)
    counts = np.bincount(owner[part], weights=shapely.get_num_coordinates(rings) - 1, minlength=len(polygons))
    return counts.astype(np.int64)


def hausdorff_distances(first: NDArray[np.object_], second: NDArray[np.object_]) -> NDArray[np.float64]:
    """Return the largest distance of a vertex of either outline from the other outline, m.

    >>> float(hausdorff_distances(np.array([shapely.box(0, 0, 10, 10)]), np.array([shapely.box(1, 0, 13, 10)]))[0])
    3.0
    """
    distances: NDArray[np.float64] = shapely.hausdorff_distance(shapely.boundary(first), shapely.boundary(second))
    return distances


def boundary_iou(first: NDArray[np.object_], second: NDArray[np.object_], band: float) -> NDArray[np.float64]:
    """Return the IoU of the inner bands: each polygon without its erosion by `band` metres.

    Source: Cheng et al. 2021, doi:10.1109/CVPR46437.2021.01508, with a band in metres.

    >>> square = np.array([shapely.box(0, 0, 10, 10)])
    >>> round(float(boundary_iou(square, np.array([shapely.box(0, 0, 10, 12)]), 1.0)[0]), 3)  # 28 / (36 + 40 - 28)
    0.583
    """
    whole = [Footprints(polygons=polygons) for polygons in (first, second)]
    inner = [Footprints(polygons=shapely.buffer(polygons, -band, quad_segs=16)) for polygons in (first, second)]
    areas = [outer.areas - core.areas for outer, core in zip(whole, inner, strict=True)]
    # The bands need not be built: an erosion lies inside its polygon, so what two bands share follows from four areas.
    rows = np.arange(len(first))
    shared = (
        shared_areas(whole[0], whole[1], rows, rows)
        - shared_areas(inner[0], whole[1], rows, rows)
        - shared_areas(whole[0], inner[1], rows, rows)
        + shared_areas(inner[0], inner[1], rows, rows)
    )
    united = areas[0] + areas[1] - shared
    iou: NDArray[np.float64] = np.clip(shared / united, 0.0, 1.0)
    return iou


def complexity_factor(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 1 - |Nd - Nr|/(Nd + Nr), from numbers of corners (Zorzi, Bazrafkan, Habenschuss & Fraundorfer 2022).

    >>> complexity_factor(np.array([4.0]), np.array([6.0])).tolist()
    [0.8]
    """
    factor: NDArray[np.float64] = 1 - np.abs(first - second) / (first + second)
    return factor


def simplicity_factor(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean over N0 in {50, 90, 500} of (1 + e^(0.1 (3 - N0))) / (1 + e^(0.1 (N - N0))).

    >>> simplicity_factor(np.array([3.0])).tolist()
    [1.0]
    """
    factors = [
        # Written with tanh, which does not overflow: 1/(1 + e^x) = (1 - tanh(x/2))/2.
        (1 + np.exp(0.1 * (3 - limit))) * (1 - np.tanh(0.05 * (corners - limit))) / 2
        for limit in _SIMPLICITY_CORNERS
    ]
    mean: NDArray[np.float64] = np.mean(factors, axis=0)
    return mean


def largest_edge_angle_error(first: NDArray[np.object_], second: NDArray[np.object_]) -> NDArray[np.float64]:
    """Return the largest over the edges of `first` of the least angle to any edge of `second`, degrees.

    Directions count modulo 180 degrees. It is 0 for a square against a far smaller one: it compares directions only.

    >>> tilted = shapely.Polygon([(0, 0), (10, 1), (10, 11), (0, 10)])
    >>> error = largest_edge_angle_error(np.array([tilted]), np.array([shapely.box(0, 0, 10, 10)]))
    >>> round(float(error[0]), 2)
    5.71
    """
    errors = np.zeros(len(first))
    owners, angles = _edge_angles(first)
    other_owners, others = _edge_angles(second)
    start = np.searchsorted(owners, np.arange(len(first) + 1))
    other_start = np.searchsorted(other_owners, np.arange(len(first) + 1))
    for row in range(len(first)):
        own, other = angles[start[row] : start[row + 1]], others[other_start[row] : other_start[row + 1]]
        apart = np.abs(own[:, None] - other[None, :])
        errors[row] = np.minimum(apart, 180 - apart).min(axis=1).max()
    return errors


def orthogonal_edges(polygons: NDArray[np.object_], tolerance: float = 5.0) -> NDArray[np.float64]:
    """Return the share of edges within `tolerance` degrees of the axes of the minimum rotated rectangle."""
    owners, angles = _edge_angles(polygons)
    _, axes = _edge_angles(shapely.oriented_envelope(polygons))
    # Four edges each, in two directions a right angle apart.
    apart = np.abs(angles - axes[::4][owners]) % 90
    along = np.minimum(apart, 90 - apart) <= tolerance
    counts = np.bincount(owners, minlength=len(polygons))
    share: NDArray[np.float64] = np.bincount(owners, weights=along, minlength=len(polygons)) / np.maximum(counts, 1)
    return share


def _edge_angles(polygons: NDArray[np.object_]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the owner and the direction of each edge, degrees from 0 to 180, sorted by owner."""
    parts, owner = shapely.get_parts(polygons, return_index=True)
    rings, part = shapely.get_rings(parts, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    inside = ring[1:] == ring[:-1]
    steps = np.diff(points, axis=0)[inside]
    long = (steps != 0).any(axis=1)
    angles: NDArray[np.float64] = np.degrees(np.arctan2(steps[long, 1], steps[long, 0])) % 180.0
    return owner[part[ring[:-1][inside][long]]], angles
