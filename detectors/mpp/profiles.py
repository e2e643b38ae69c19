"""Profiles of roofs: means along a row and medians across it, where some values are not known.

A *profile* has a row for each *station* along a rectangle and a column for each *line* across it (`party_walls`); NaN
is unknown.
"""

from __future__ import annotations

import numpy as np

from .arrays import Floats

__all__ = ["line_medians", "station_means"]


def station_means(profile: Floats, reach: int) -> Floats:
    """Return the mean of the known heights of `reach` stations in a row, shape (stations - reach + 1, lines)."""
    known = np.isfinite(profile)
    sums = np.zeros((2, len(profile) + 1, profile.shape[1]))
    np.cumsum(np.where(known, profile, 0.0), axis=0, out=sums[0, 1:])
    np.cumsum(known, axis=0, dtype=np.float64, out=sums[1, 1:])
    total, number = sums[:, reach:] - sums[:, :-reach]
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def line_medians(values: Floats, nothing: float = 0.0) -> Floats:
    """Return the median of the known values of each station, shape (stations,); `nothing` without any.

    Sorting puts unknown values last, which takes a tenth of the time of `numpy.nanmedian`.
    """
    if values.shape[1] == 0:
        return np.full(len(values), nothing)
    ordered, number = np.sort(values, axis=1), np.isfinite(values).sum(axis=1)
    station = np.arange(len(values))
    middle = ordered[station, np.maximum(number - 1, 0) // 2] + ordered[station, number // 2]
    return np.where(number > 0, middle / 2, nothing)
