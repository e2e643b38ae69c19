"""Strips: rectangles along a much larger building, and slender ones along a larger one, are parts of it.

Nouns
-----
strip
    A rectangle whose long side lies, to `_ALONG` of its length, against a larger rectangle, and that is more than
    `slender` times as long as wide or has less than `part_share` of the area of the larger one: the eaves of a roof of
    two levels, a canopy along a wall, the rest of a wing beside a penthouse. A house in a row is none.

A strip is absorbed by the building that it lies against where the larger rectangle has less energy than that building
by itself, and left out otherwise. So the energy may rise: like the least side this is a rule about what a building is,
but it needs the neighbours, so it is applied after the sampling.
"""

from __future__ import annotations

import numpy as np
import shapely

from .arrays import Floats, Rectangles
from .energy import Model, overlaps, rectangle_energy
from .rectangles import corners
from .reshaping import hull
from .tables import Tables

__all__ = ["absorb_strips"]

#: Share of a strip's long side that lies against the building, and cells that may lie between.
_ALONG, _APART = 0.65, 1.5


def absorb_strips(
    tables: Tables, model: Model, rectangles: Rectangles, *, slender: float, part_share: float
) -> Rectangles:
    """Return the rectangles, shape (m, 5), after strips were absorbed or left out, the smallest first.

    Parameters
    ----------
    tables : Tables
    model : Model
    rectangles : ndarray, shape (n, 5)
        Grid frame.
    slender : float
        Ratio of the sides above which a rectangle along a larger one is a strip.
    part_share : float
        Share of the area of the larger one below which it is a strip whatever its sides are.
    """
    result = rectangles.copy()
    kept = np.ones(len(result), dtype=np.bool_)
    areas = result[:, 2:4].prod(axis=1)
    # The tree contains buildings as they were; none has grown by more than this.
    outlines = shapely.polygons(corners(result))
    tree, grown = shapely.STRtree(outlines), 0.0
    one, other = tree.query(outlines, predicate="dwithin", distance=_APART)
    beside = np.split(other, np.searchsorted(one, np.arange(1, len(result))))
    for strip in np.argsort(areas, kind="stable"):
        short, long = sorted(result[strip, 2:4])
        near = beside[strip]
        if grown > 0:
            near = tree.query(shapely.polygons(corners(result[strip]))[0], predicate="dwithin", distance=_APART + grown)
        near = near[kept[near] & (areas[near] > areas[strip])]
        larger = near[(long > slender * short) | (areas[strip] < part_share * areas[near])]
        if len(larger) == 0:
            continue
        along = _along(result[strip], result[larger])
        if along.max() < _ALONG:
            continue
        building = larger[np.argmax(along)]
        kept[strip] = False
        joined = np.empty(5)
        hull(result[building], result[strip], joined)
        if joined[2:4].max() > model.largest_side:
            continue
        around = tree.query(shapely.polygons(corners(joined))[0], predicate="dwithin", distance=grown)
        others = result[around[kept[around] & (around != building)]]
        before, after = (
            rectangle_energy(tables, one, model) + model.overlap * overlaps(others, len(others), one, -1, -1)
            for one in (result[building], joined)
        )
        if after < before:
            grown = max(grown, *(joined[2:4] - result[building, 2:4]))
            result[building], areas[building] = joined, joined[2:4].prod()
    return result[kept]


def _along(strip: Rectangles, buildings: Rectangles) -> Floats:
    """Return the share of the strip's better long side that lies against each building, shape (n,)."""
    place = corners(strip)[0]
    first = 0 if strip[2] >= strip[3] else 1
    long_sides = shapely.linestrings([place[[first, first + 1]], place[[first + 2, (first + 3) % 4]]])
    around = shapely.buffer(shapely.polygons(corners(buildings)), _APART, join_style="mitre")
    shares = shapely.length(shapely.intersection(long_sides[:, None], around)) / shapely.length(long_sides)[:, None]
    return shares.max(axis=0)  # type: ignore[no-any-return]
