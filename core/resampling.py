"""Bootstrap resampling: how often each unit is drawn, and at which percentiles an interval ends.

Everything is deterministic: the draws follow from the number of units, so the same numbers give the same interval.

Source: Hesterberg 2015, What Teachers Should Know About the Bootstrap, The American Statistician 69(4): the expanded
percentile interval.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["expanded_level", "resampling_weights"]


@lru_cache(maxsize=64)
def resampling_weights(count: int, resamples: int = 4000) -> NDArray[np.int64]:
    """Return how often each of `count` units (scenes, blocks) is drawn in each resample, shape (resamples, count)."""
    rng = np.random.default_rng(np.random.SeedSequence([count, resamples]))
    weights = rng.multinomial(count, np.full(count, 1 / count), size=resamples)
    weights.flags.writeable = False  # shared by all callers
    return weights


@lru_cache(maxsize=256)
def expanded_level(count: int, level: float = 0.05) -> float:
    """Return the tail probability at which percentiles of `count` resampled values cover as a t interval does.

    Plain percentiles are too narrow for few values; for many, this tends to ``level / 2``.
    """
    from scipy import special  # importing scipy.stats takes a second

    return float(special.ndtr(-math.sqrt(count / (count - 1)) * special.stdtrit(count - 1, 1 - level / 2)))
