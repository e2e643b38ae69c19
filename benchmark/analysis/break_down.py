"""Break-down points: where the mean of an index first passes a level for the worse along a numeric axis."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from ...evaluators.base import Index

__all__ = ["BreakDown", "find_break_down"]


@dataclass(frozen=True, kw_only=True)
class BreakDown:
    """Where a detector breaks down on an axis.

    Attributes
    ----------
    detector, axis : str
    index : Index
    level : float
    value : float, optional
        Place on the axis; None when the index never passes the level.
    at_start : bool
        The first point is beyond the level already.
    """

    detector: str
    axis: str
    index: Index
    level: float
    value: float | None
    at_start: bool = False


def find_break_down(
    points: Sequence[tuple[float, float]], *, detector: str, axis: str, index: Index, level: float
) -> BreakDown | None:
    """Return the first place where an index passes a level, by linear interpolation between points.

    Parameters
    ----------
    points : sequence of (float, float)
        Place on the axis and value of the index, in any order.
    detector, axis : str
    index : Index
    level : float

    Returns
    -------
    found : BreakDown or None
        None without points, and for an index without a better direction.
    """
    if not points or index.better == "neither":
        return None
    sign = -1.0 if index.better == "lower" else 1.0
    margins = [(place, sign * (value - level)) for place, value in sorted(points)]
    place, at_start = None, margins[0][1] < 0
    if at_start:
        place = margins[0][0]
    else:
        for (before, good), (after, bad) in itertools.pairwise(margins):
            if bad < 0:
                place = before + good / (good - bad) * (after - before)
                break
    return BreakDown(detector=detector, axis=axis, index=index, level=level, value=place, at_start=at_start)
