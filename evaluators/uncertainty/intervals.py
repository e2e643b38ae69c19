"""Intervals of every index of one comparison, by a spatial block bootstrap.

Each block is evaluated once; a resample adds the tallies of the blocks that were drawn, as many times as they were
drawn, and derives the indices from the sum. So it works for every evaluator, and a resample costs an addition.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import ParameterError
from ...core.resampling import expanded_level, resampling_weights
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.raster import Grid
from ..base import Evaluation, Evaluator
from ..given_footprints import GivenFootprints, GivenReference, given_sets
from ..registry import DEFAULT, make_evaluator
from ..tally import Tallies
from .blocks import Blocks, spatial_blocks

__all__ = [
    "RESAMPLES",
    "Interval",
    "Intervals",
    "block_intervals",
    "block_tallies",
    "interval_of",
    "require_level",
    "resampled_values",
]

#: Default number of resamples.
RESAMPLES = 1000

#: Lower and upper end; None where an index has no interval.
Interval = tuple[float, float] | None


@dataclass(frozen=True, kw_only=True)
class Intervals:
    """Intervals of the indices of one comparison.

    Attributes
    ----------
    level : float
        Percent.
    blocks, groups : int
        Number of blocks that were drawn, and of connected groups in them.
    resamples : int
    ends : mapping of str to (float, float) or None
        By the key of the index. None where fewer than two blocks exist, where the index is undefined in a resample, or
        where it does not follow from the sum of the blocks' tallies (a mean over scenes, for instance).
    """

    level: float
    blocks: int
    groups: int
    resamples: int
    ends: Mapping[str, Interval] = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON holds."""
        return {
            "level": self.level,
            "blocks": self.blocks,
            "connected_groups": self.groups,
            "resamples": self.resamples,
            "ends": {key: None if ends is None else list(ends) for key, ends in self.ends.items()},
        }


def block_intervals(
    detected: GivenFootprints,
    reference: GivenReference,
    *,
    evaluator: str | Evaluator = DEFAULT,
    area: shapely.Geometry | None = None,
    grid: Grid | None = None,
    level: float = 95.0,
    resamples: int = RESAMPLES,
) -> Intervals:
    """Return the interval of every index of a comparison, by a spatial block bootstrap over connected groups.

    Parameters
    ----------
    detected : Footprints, GeoDataFrame, GeoSeries, path, or iterable of polygons
    reference : the same, or Scene
        Both in one projected CRS, metres.
    evaluator : str or Evaluator
    area : polygon, optional
        Evaluation area.
    grid : Grid, optional
        Grid of the orthoimage.
    level : float
        Percent, more than 0 and less than 100.
    resamples : int

    Raises
    ------
    ParameterError
        The level is no percentage between 0 and 100.

    Notes
    -----
    Percentiles are expanded for few blocks (Hesterberg 2015). An index that is the same in every block, such as a
    correctness of 100 %, has an interval of width 0: no resample contains an error that the sample does not contain.

    Examples
    --------
    >>> reference = Footprints.of([shapely.box(20 * k, 0, 20 * k + 9, 9) for k in range(40)])
    >>> found = block_intervals(reference.take(np.arange(30)), reference)
    >>> found.blocks, [round(end, 2) for end in found.ends["object.completeness"]]
    (32, [0.58, 0.9])
    """
    require_level(level)
    chosen = make_evaluator(evaluator)
    (found,), (truth, area, grid) = given_sets([detected], reference, area, grid)
    blocks = spatial_blocks([found, truth])
    every = block_tallies(chosen, (found, truth), (0, 1), blocks, area=area, grid=grid)
    whole = chosen.evaluate(found, truth, area=area, grid=grid)
    values = resampled_values(whole, every, resamples)
    return Intervals(
        level=level,
        blocks=blocks.count,
        groups=blocks.groups,
        resamples=resamples,
        ends={key: interval_of(column, blocks.count, level) for key, column in values.items()},
    )


def require_level(level: float) -> None:
    """Raise `ParameterError` unless the level is a percentage between 0 and 100."""
    if not 0 < level < 100:
        raise ParameterError(
            f"interval={level:g} is not a level in percent: use a number between 0 and 100, such as 95"
        )


def block_tallies(
    evaluator: Evaluator,
    sets: tuple[Footprints, Footprints],
    places: tuple[int, int],
    blocks: Blocks,
    *,
    area: shapely.Geometry | None = None,
    grid: Grid | None = None,
) -> list[Tallies]:
    """Return the tallies of each block.

    Parameters
    ----------
    evaluator : Evaluator
    sets : tuple of Footprints
        Detections and references.
    places : tuple of int
        Their places among the sets of `blocks`.
    blocks : Blocks
    area : polygon, optional
    grid : Grid, optional
    """
    parts = [blocks.parts(place, footprints) for place, footprints in zip(places, sets, strict=True)]
    return [
        evaluator.evaluate(detected, reference, area=area, grid=grid).tallies
        for detected, reference in zip(*parts, strict=True)
    ]


def resampled_values(
    whole: Evaluation, every: Sequence[Tallies], resamples: int = RESAMPLES
) -> dict[str, NDArray[np.float64]]:
    """Return the values of every index in each resample, NaN where undefined.

    The same number of blocks gives the same draws, so two detections of one place are paired when their blocks are.

    Parameters
    ----------
    whole : Evaluation
        Of all blocks together.
    every : sequence of Tallies
        Of each block.
    resamples : int

    Returns
    -------
    dict of str to ndarray, shape (resamples,)
        All NaN for an index that does not follow from the sum of the tallies of the blocks.
    """
    indices = whole.evaluator.indices
    columns = np.full((len(indices), resamples), np.nan)
    if len(every) > 1:
        kind = type(whole.tallies)
        weights = np.concatenate([np.ones((1, len(every)), dtype=np.int64), resampling_weights(len(every), resamples)])
        sums = kind.resampled(every, weights)
        total = next(sums)
        for place, tallies in enumerate(sums):
            columns[:, place] = [_number(index.formula(tallies)) for index in indices]
        for row, index in enumerate(indices):
            if not _same(index.formula(total), whole.values[index.key]):
                columns[row] = np.nan
    return {index.key: column for index, column in zip(indices, columns, strict=True)}


def interval_of(values: NDArray[np.float64], blocks: int, level: float) -> Interval:
    """Return the expanded percentile interval of resampled values; None where any is undefined (NaN)."""
    if blocks < 2 or np.isnan(values).any():
        return None
    if (values == values[0]).all():
        return float(values[0]), float(values[0])
    tail = expanded_level(blocks, 1 - level / 100)
    low, high = np.quantile(values, [tail, 1 - tail])
    return float(low), float(high)


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _same(one: float | None, two: float | None) -> bool:
    if one is None or two is None:
        return one is two
    return math.isclose(one, two, rel_tol=1e-6, abs_tol=1e-9)
