"""Geometric accuracy: how far the two outlines of a matched pair are apart.

Rectangles are compared corner by corner (RMSE, Awrangjeb et al. 2010, section 4.2.3). General polygons have no
corresponding corners; their distance is PoLiS, the mean distance from the vertices of each outline to the other
outline, taken in both directions (Avbelj, Müller & Bamler 2015, doi:10.1109/LGRS.2014.2330695).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from .overlaps import quadrilateral_rows

__all__ = ["PairDistances", "corner_distances", "pair_distances", "polis_distances"]

_CHUNK = 1 << 16

#: Vertices of an outline from which on distances from it are found by an index, and those of a piece in it.
_LONG, _PIECE = 2000, 32

#: From so many pairs of general outlines on, or of any, distances are computed by compiled code, which takes a moment
#: to load.
_MANY_OUTLINES, _MANY_PAIRS = 10_000, 50_000


@dataclass(frozen=True, eq=False)
class PairDistances:
    """Distances of matched pairs, m, each of shape (n,).

    Attributes
    ----------
    outline : ndarray
        Root mean square distance of the four corners of two quadrilaterals, else PoLiS.
    by_corners : ndarray of bool
        Whether `outline` was measured at corners.
    polis : ndarray
        PoLiS of every pair.
    """

    outline: NDArray[np.float64]
    by_corners: NDArray[np.bool_]
    polis: NDArray[np.float64]


def pair_distances(
    detected: Footprints, reference: Footprints, pairs: tuple[NDArray[np.int64], NDArray[np.int64]]
) -> PairDistances:
    """Measure matched pairs, given as rows (detections, references)."""
    rows = [
        quadrilateral_rows(footprints)[members]
        for footprints, members in zip((detected, reference), pairs, strict=True)
    ]
    both = (rows[0] >= 0) & (rows[1] >= 0)
    if len(both) > _MANY_PAIRS or np.count_nonzero(~both) > _MANY_OUTLINES:
        return _many_distances(detected, reference, pairs, both)
    corners = [footprints.quadrilaterals[1] for footprints in (detected, reference)]
    polis = np.empty(len(pairs[0]))
    outline = np.empty(len(pairs[0]))
    for start in range(0, len(both), _CHUNK):
        part = slice(start, start + _CHUNK)
        quick = np.flatnonzero(both[part]) + start
        one, two = corners[0][rows[0][quick]], corners[1][rows[1][quick]]
        outline[quick] = corner_distances(one, two)
        polis[quick] = (_vertices_to_edges(one, two) + _vertices_to_edges(two, one)) / 2
    general = np.flatnonzero(~both)
    for start in range(0, len(general), _CHUNK):
        few = general[start : start + _CHUNK]
        polis[few] = polis_distances(detected.polygons[pairs[0][few]], reference.polygons[pairs[1][few]])
    outline[general] = polis[general]
    return PairDistances(outline, both, polis)


def _many_distances(
    detected: Footprints,
    reference: Footprints,
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]],
    both: NDArray[np.bool_],
) -> PairDistances:
    """Measure many matched pairs; `both` is whether both outlines are convex quadrilaterals."""
    from .vertex_distances import ring_distances  # compiled code: a comparison of small files does without

    starts = detected.rings[0], reference.rings[0]
    sizes = [np.diff(start)[members] for start, members in zip(starts, pairs, strict=True)]
    # Compiled, the time of a pair is the product of the numbers of vertices.
    long = np.maximum(*sizes) > _LONG
    if not long.any():
        return PairDistances(*ring_distances(detected.rings, reference.rings, *pairs, both))
    outline, polis = np.empty(len(both)), np.empty(len(both))
    first, second = (members[~long] for members in pairs)
    outline[~long], _, polis[~long] = ring_distances(detected.rings, reference.rings, first, second, both[~long])
    outline[long] = polis[long] = polis_distances(detected.polygons[pairs[0][long]], reference.polygons[pairs[1][long]])
    return PairDistances(outline, both, polis)


def corner_distances(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the root mean square distance of four corner pairs under the best cyclic alignment.

    Parameters
    ----------
    first, second : ndarray, shape (n, 4, 2)
        Corners, both counter-clockwise.

    Examples
    --------
    >>> square = np.array([[[0.0, 0], [10, 0], [10, 10], [0, 10]]])
    >>> corner_distances(square, np.roll(square, 1, axis=1) + [3, 4])
    array([5.])
    """
    squares = [((first - np.roll(second, shift, axis=1)) ** 2).sum(axis=2).mean(axis=1) for shift in range(4)]
    distances: NDArray[np.float64] = np.sqrt(np.min(squares, axis=0))
    return distances


def polis_distances(first: NDArray[np.object_], second: NDArray[np.object_]) -> NDArray[np.float64]:
    """Return PoLiS of each pair of polygons, m; the closing vertex of a ring is not counted twice.

    Examples
    --------
    >>> square = shapely.box(0, 0, 10, 10)
    >>> polis_distances(np.array([square]), np.array([shapely.box(1, 0, 11, 10)]))
    array([0.5])
    """
    distances: NDArray[np.float64] = (_one_way(first, second) + _one_way(second, first)) / 2
    return distances


def _one_way(first: NDArray[np.object_], second: NDArray[np.object_]) -> NDArray[np.float64]:
    """Return the mean distance of the vertices of `first` from the boundary of `second`."""
    parts, part_of = shapely.get_parts(first, return_index=True)
    rings, ring_of = shapely.get_rings(parts, return_index=True)
    coordinates, vertex_ring = shapely.get_coordinates(rings, return_index=True)
    closing = np.append(vertex_ring[1:] != vertex_ring[:-1], True)[: len(vertex_ring)]
    owner = part_of[ring_of[vertex_ring[~closing]]]
    vertices, boundaries = coordinates[~closing], shapely.boundary(second)
    long = shapely.get_num_coordinates(boundaries) > _LONG
    distances = np.empty(len(vertices))
    short = ~long[owner]
    distances[short] = shapely.distance(shapely.points(vertices[short]), boundaries[owner[short]])
    for row in np.flatnonzero(long):
        own = np.flatnonzero(owner == row)
        distances[own] = _distances_from_long(vertices[own], boundaries[row])
    count = np.bincount(owner, minlength=len(first))
    means: NDArray[np.float64] = np.bincount(owner, weights=distances, minlength=len(first)) / np.maximum(count, 1)
    return means


def _distances_from_long(points: NDArray[np.float64], boundary: shapely.Geometry) -> NDArray[np.float64]:
    """Return the distance of each point, shape (n, 2), from a long line; only its pieces nearby are measured."""
    pieces: list[NDArray[np.object_]] = []
    for line in shapely.get_parts(boundary):
        xy = shapely.get_coordinates(line)
        step = _PIECE - 1
        whole = (len(xy) - 1) // step
        cuts = np.arange(whole)[:, None] * step + np.arange(_PIECE)
        pieces.append(shapely.linestrings(xy[cuts]))
        if whole * step < len(xy) - 1:
            pieces.append(np.array([shapely.LineString(xy[whole * step :])]))
    tree = shapely.STRtree(np.concatenate(pieces))
    distances = np.empty(len(points))
    for start in range(0, len(points), _CHUNK):
        part = shapely.points(points[start : start + _CHUNK])
        (asked, _), distances_of_asked = tree.query_nearest(part, return_distance=True, all_matches=False)
        distances[start + asked] = distances_of_asked
    return distances


def _vertices_to_edges(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean distance of the corners of `first` from the edges of `second`, shape (n,)."""
    edges = np.roll(second, -1, axis=1) - second
    lengths = (edges**2).sum(axis=2)
    total = np.zeros(len(first))
    for corner in range(4):
        offset = first[:, corner, None, :] - second
        along = np.clip((offset * edges).sum(axis=2) / lengths, 0, 1)
        nearest = offset - along[..., None] * edges
        total += np.sqrt((nearest**2).sum(axis=2).min(axis=1))
    return total / 4
