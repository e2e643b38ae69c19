"""Shears: the direction in which the roofs of a row repeat, where its party walls are oblique to the street.

The rise of the roofs along the row is averaged over the lines of a lattice (`lattices`), moved against each other by
each shear. Steps, valleys and ridges that lie along the moved stations add up, others cancel out: the *agreement* of a
shear is the sum of the squares of these means. It needs no threshold of what a step is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .arrays import Floats
from .lattices import SPACING
from .profiles import station_means

__all__ = ["likely_shear"]

#: Degrees: greatest shear and distance between two that are tried; smaller ones than the least gain nothing.
_GREATEST, _APART, _LEAST = 30, 5, 10
#: How many times the agreement without a shear it must be.
_CLEARLY = 1.1
#: Metres: shortest row and shallowest roof.
_SHORTEST, _SHALLOWEST = 12.0, 4.0
#: Stations that a mean reaches, and metres above which a rise is no more evidence than below.
_REACH, _MOST = 2, 1.0


def likely_shear(roof: Floats) -> float:
    """Return the shear along which roofs agree best; 0 where no other one is clearly better.

    Parameters
    ----------
    roof : ndarray, shape (stations, lines)
        Heights, m, on a lattice without a shear; NaN is unknown.
    """
    count, lines = roof.shape
    if count * SPACING < _SHORTEST or lines * SPACING < _SHALLOWEST:
        return 0.0
    degrees = np.arange(_LEAST, _GREATEST + 1, _APART)
    shears = np.tan(np.radians(np.concatenate([[0], -degrees[::-1], degrees])))
    found = _agreement(roof, shears)
    best = int(np.argmax(found))
    return float(shears[best]) if found[best] >= _CLEARLY * found[0] else 0.0


def _agreement(roof: Floats, shears: Floats) -> Floats:
    """Return the agreement of each shear, m2, shape (shears,)."""
    means = station_means(roof, _REACH)
    rise = means[_REACH:] - means[:-_REACH]
    rise = np.where(np.isfinite(rise), np.clip(rise, -_MOST, _MOST), 0.0)
    lines = np.arange(roof.shape[1]) - (roof.shape[1] - 1) / 2
    agreement: Floats = _added_up(rise, np.rint(shears[:, None] * lines).astype(np.int64))
    return agreement


@kernel
def _added_up(rise: Floats, moved: NDArray[np.int64]) -> Floats:
    """Return the sum of the squares of the means over lines that are moved by some stations, shape (len(moved),)."""
    count, lines = rise.shape
    agreement = np.zeros(len(moved))
    for k in range(len(moved)):
        for station in range(count):
            mean = 0.0
            for line in range(lines):
                place = station + moved[k, line]
                if 0 <= place < count:
                    mean += rise[place, line]
            mean /= lines
            agreement[k] += mean * mean
    return agreement
