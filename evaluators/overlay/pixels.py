"""Pixel areas: T, F and M counted on the lattice of the orthoimage.

A pixel belongs to a footprint when its centre lies inside (Awrangjeb et al. 2010, section 4.2.2). Edges are half open
(left and upper ones in), so footprints that touch share no pixel and leave none between them.

No raster is filled: each footprint becomes *spans*, runs of pixels in one row, and all set operations are sweeps over
span ends sorted by (row, column). Memory grows with the number of spans in a band of rows, not with the extent.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import ParameterError
from ...scenes.geodata.raster import Grid
from .areas import AreaTally

__all__ = ["pixel_areas"]

#: Edge-row crossings handled at once: about 200 MB of arrays.
_BAND_CROSSINGS = 2_000_000
#: Most edge-row crossings in all: about an hour. A million houses at 0.1 m have a tenth of it.
_MOST_CROSSINGS = 4e9


def pixel_areas(
    detected: NDArray[np.object_],
    reference: NDArray[np.object_],
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]],
    grid: Grid,
    *,
    false_positives: NDArray[np.int64],
    false_negatives: NDArray[np.int64],
    groups: NDArray[np.int64] | None = None,
) -> AreaTally:
    """Return T, F and M as pixel counts times the pixel's area, m2.

    Parameters
    ----------
    detected, reference : ndarray of polygons
    pairs : tuple of ndarray of int64
        Rows (detections, references) of the TP pairs.
    grid : Grid
        Its origin and GSD define the lattice, which continues beyond the image.
    false_positives, false_negatives : ndarray of int64
        Rows of the FP detections and of the FN references.
    groups : ndarray of int64, optional
        Group of each TP pair, FP and FN. A pixel counts once in each group; by default once in all.
    """
    # One object per TP pair, FP and FN; channel 0 is its detected, channel 1 its reference side.
    n_pairs, n_fp, n_fn = len(pairs[0]), len(false_positives), len(false_negatives)
    polygons = np.concatenate(
        [detected[pairs[0]], reference[pairs[1]], detected[false_positives], reference[false_negatives]]
    )
    objects = np.concatenate(
        [np.arange(n_pairs), np.arange(n_pairs), n_pairs + np.arange(n_fp), n_pairs + n_fp + np.arange(n_fn)]
    )
    channel = np.repeat([0, 1, 0, 1], [n_pairs, n_pairs, n_fp, n_fn])
    counted = np.zeros(6)
    for polygon, row, column, sign in _crossings(polygons, grid):
        counted += _count_band(objects[polygon], channel[polygon], (row, column, sign), n_pairs, groups)
    names = (each.name for each in fields(AreaTally))
    return AreaTally(**dict(zip(names, (counted * grid.gsd**2).tolist(), strict=True)))


def _crossings(polygons: NDArray[np.object_], grid: Grid) -> Iterator[tuple[NDArray[np.int64], ...]]:
    """Yield, band by band, where rows of pixel centres cross the outlines.

    Each crossing is (polygon, row, first column to the right of it, +1 for in or -1 for out).
    """
    parts, part_of = shapely.get_parts(polygons, return_index=True)
    rings, ring_of = shapely.get_rings(parts, return_index=True)
    coordinates, vertex_ring = shapely.get_coordinates(rings, return_index=True)
    if not len(coordinates):
        return
    row_position, column_position = grid.to_pixel(coordinates[:, 0], coordinates[:, 1])
    edge = np.flatnonzero(vertex_ring[:-1] == vertex_ring[1:])
    owner = part_of[ring_of[vertex_ring[edge]]]
    v0, v1 = row_position[edge] - 0.5, row_position[edge + 1] - 0.5
    u0, u1 = column_position[edge] - 0.5, column_position[edge + 1] - 0.5
    first = np.ceil(np.minimum(v0, v1)).astype(np.int64)
    last = np.ceil(np.maximum(v0, v1)).astype(np.int64)  # exclusive
    if (last - first).sum() > _MOST_CROSSINGS:
        raise ParameterError(
            f"pixels of {grid.gsd:g} m are too small for {len(polygons)} outlines: choose a larger gsd, or area=exact"
        )
    for low, high in _bands(first, last):
        start, stop = np.maximum(first, low), np.minimum(last, high)
        hit = np.flatnonzero(stop > start)
        repeats = (stop - start)[hit]
        which = np.repeat(hit, repeats)
        row = np.arange(len(which)) - np.repeat(np.cumsum(repeats) - repeats, repeats) + start[which]
        along = (row - v0[which]) / (v1[which] - v0[which])
        column = np.ceil(u0[which] + along * (u1[which] - u0[which])).astype(np.int64)
        item = owner[which]
        # Even-odd rule: sorted along a row, crossings of one polygon alternate between in and out.
        order = np.lexsort((column, row, item))
        item, row, column = item[order], row[order], column[order]
        sign = np.where(np.arange(len(item)) % 2 == 0, 1, -1)
        yield item, row, column, sign


def _bands(first: NDArray[np.int64], last: NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """Yield row ranges that hold about `_BAND_CROSSINGS` crossings each."""
    low, high = int(first.min()), int(last.max())
    if high <= low:
        return
    # Crossings per row from the starts and ends of the edges, without one array cell per row of a whole country.
    rows, change = np.unique(np.concatenate([first, last]), return_inverse=True)
    steps = np.bincount(change, weights=np.repeat([1, -1], [len(first), len(last)]), minlength=len(rows))
    active = np.cumsum(steps)[:-1]
    reached = np.concatenate([[0.0], np.cumsum(active * np.diff(rows))])
    cuts = np.arange(_BAND_CROSSINGS, reached[-1], _BAND_CROSSINGS)
    edges = np.unique(np.concatenate([[low], np.interp(cuts, reached, rows).astype(np.int64), [high]]))
    yield from zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)


def _count_band(
    objects: NDArray[np.int64],
    channel: NDArray[np.int64],
    crossings: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]],
    n_pairs: int,
    groups: NDArray[np.int64] | None,
) -> NDArray[np.float64]:
    """Return pixel counts (T, F, M, pair detected, pair reference, pair shared) of one band."""
    row, column, sign = crossings
    # First sweep, object by object: where only d, only r, or both cover.
    (span_row, span_object), begin, end, (of_d, of_r) = _sweep((column, row, objects), channel, sign, channels=2)
    by_d, by_r = of_d > 0, of_r > 0
    used = np.flatnonzero(by_d | by_r)
    span_row, span_object, begin, end = span_row[used], span_object[used], begin[used], end[used]
    by_d, by_r = by_d[used], by_r[used]
    kind = np.where(by_d & by_r, 0, np.where(by_d, 1, 2))
    # Second sweep, all objects (of a group) together: where candidates of T, F and M cover.
    slower = [span_row] if groups is None else [span_row, groups[span_object]]
    _, left, right, cover = _sweep(
        (np.concatenate([begin, end]), *(np.concatenate([key, key]) for key in slower)),
        np.concatenate([kind, kind]),
        np.repeat([1, -1], len(used)),
        channels=3,
    )
    length = (right - left).astype(np.float64)
    true = cover[0] > 0
    totals = [length[true].sum(), length[(cover[1] > 0) & ~true].sum(), length[(cover[2] > 0) & ~true].sum()]
    pair_length = np.where(span_object < n_pairs, end - begin, 0).astype(np.float64)
    totals += [pair_length[by_d].sum(), pair_length[by_r].sum(), pair_length[by_d & by_r].sum()]
    return np.array(totals)


def _sweep(
    keys: tuple[NDArray[np.int64], ...], channel: NDArray[np.int64], sign: NDArray[np.int64], *, channels: int
) -> tuple[list[NDArray[np.int64]], NDArray[np.int64], NDArray[np.int64], list[NDArray[np.int64]]]:
    """Cut rows at all span ends; return (row keys), first and end column, and the cover count of each channel.

    `keys` are (column, row[, object]): the last one is the slowest to change.
    """
    order = np.lexsort(keys)
    column, *slower = (key[order] for key in keys)
    channel, sign = channel[order], sign[order]
    # Ins and outs of one row cancel, so one running sum serves all rows.
    cover = [np.cumsum(np.where(channel == number, sign, 0))[:-1] for number in range(channels)]
    begin, end = column[:-1], column[1:]
    proper = end > begin
    for key in slower:
        proper &= key[:-1] == key[1:]
    return [key[:-1][proper] for key in slower], begin[proper], end[proper], [count[proper] for count in cover]
