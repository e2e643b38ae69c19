"""Shared areas of many pairs of outlines: by fans, and by overlay where both outlines have very many vertices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .fans import fan_areas, in_canonical_order
from .outline_arrays import Outlines, polygons_of
from .polygon_overlay import overlay_areas

__all__ = ["shared_by_outlines", "shared_within"]

#: A fan costs the product of the numbers of vertices; beyond so many an overlay is faster.
_LARGEST_FAN = 1 << 18


def shared_by_outlines(
    one: Outlines, two: Outlines, first: NDArray[np.int64], second: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the area that outline `first` of one set shares with `second` of the other, m2, shape (n,)."""
    cost = np.diff(one.start)[first] * np.diff(two.start)[second]
    small = cost <= _LARGEST_FAN
    if small.all():
        return fan_areas(one, two, first, second)
    areas = np.empty(len(first))
    areas[small] = fan_areas(one, two, first[small], second[small])
    large = []
    for outlines, rows in ((one, first[~small]), (two, second[~small])):
        own, place = np.unique(rows, return_inverse=True)
        large.append((polygons_of(outlines, own), place))
    (polygons_one, rows_one), (polygons_two, rows_two) = large
    areas[~small] = overlay_areas(polygons_one, polygons_two, rows_one, rows_two)
    return areas


def shared_within(outlines: Outlines, first: NDArray[np.int64], second: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the area that outline `first` shares with `second` of the same set, whichever is given first."""
    return shared_by_outlines(outlines, outlines, *in_canonical_order(outlines, first, second))
