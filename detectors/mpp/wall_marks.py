"""Marks of party walls in a profile: steps, valleys and edges of colour, as far as they depend on no rule.

See `party_walls` for what they are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats
from .profiles import line_medians, station_means

__all__ = ["Marks", "colour_marks", "roof_marks"]

#: Stations that a mean reaches on either side, and that lie between a valley and its shoulders.
_REACH, _SHOULDER = 2, 2
#: Stations that the mean of colours reaches on either side: they are blurred by a pixel, and pixels are displaced.
_COLOUR_REACH = 3


class Marks(NamedTuple):
    """A step, a valley or an edge of colour before each station, as far as it does not depend on a rule.

    Attributes
    ----------
    values : ndarray, shape (stations, lines)
        Its size in each line, in the direction of the median; NaN is unknown.
    size : ndarray, shape (stations,)
        Of the median.
    known : ndarray of int64, shape (stations,)
        Number of lines where it is known.
    """

    values: Floats
    size: Floats
    known: NDArray[np.int64]

    def strength(self, least: float, share: float, noise: float, known: float) -> Floats:
        """Return the size where it counts, shape (stations,), else 0.

        A mark counts that is known in a share of the lines, has a least size, and exceeds the noise in another share of
        the lines where it is known.
        """
        seen = (self.known / max(self.values.shape[1], 1) >= known) & (self.size >= least)
        seen[seen] = (self.values[seen] > noise).sum(axis=1) / self.known[seen] >= share
        return np.where(seen, self.size, 0.0)


def roof_marks(profile: Floats) -> tuple[Marks, Marks] | None:
    """Return the steps and the valleys of heights, shape (stations, lines); None where they are too few."""
    count = len(profile)
    if count < 2 * (_REACH + _SHOULDER):
        return None
    means = station_means(profile, _REACH)  # of stations i to i + _REACH - 1
    before, behind = np.full_like(profile, np.nan), np.full_like(profile, np.nan)
    before[_REACH:], behind[: len(means)] = means[: count - _REACH], means
    step = behind - before - _slope(before, behind)
    middle = line_medians(step)
    steps = Marks(step * np.sign(middle)[:, None], np.abs(middle), np.isfinite(step).sum(axis=1))

    low = np.full_like(profile, np.nan)
    low[1:] = np.fmin(profile[1:], profile[:-1])
    left, right = np.full_like(profile, np.nan), np.full_like(profile, np.nan)
    far = _REACH + _SHOULDER
    left[far:] = means[: count - far]
    right[: len(means) - _SHOULDER] = means[_SHOULDER:]
    valley = (left + right) / 2 - low
    return steps, Marks(valley, line_medians(valley), np.isfinite(valley).sum(axis=1))


def colour_marks(shares: Floats) -> Marks | None:
    """Return the edges of colour in shares of red and blue, shape (2, stations, lines); None where there are none."""
    _, count, lines = shares.shape
    if count < 2 * _COLOUR_REACH or not np.isfinite(shares).any():
        return None
    edges = np.full((2, count, lines), np.nan)
    for edge, share in zip(edges, shares, strict=True):
        means = station_means(share, _COLOUR_REACH)
        edge[_COLOUR_REACH : 1 - _COLOUR_REACH] = means[_COLOUR_REACH:] - means[:-_COLOUR_REACH]
    middle = np.stack([line_medians(edge) for edge in edges])
    size = np.hypot(*middle)
    along = (edges * middle[:, :, None]).sum(axis=0) / np.maximum(size, 1e-12)[:, None]
    return Marks(along, size, np.isfinite(along).sum(axis=1))


def _slope(before: Floats, behind: Floats) -> Floats:
    """Return by how much a roof rises from just before a station to just behind it where no step is, m."""
    rises = np.full((2, *before.shape), np.nan)
    rises[0, _REACH:], rises[1, :-_REACH] = before[_REACH:] - before[:-_REACH], behind[_REACH:] - behind[:-_REACH]
    known = np.isfinite(rises)
    mean: Floats = np.where(known, rises, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return mean
