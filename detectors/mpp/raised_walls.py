"""Raised walls: party walls that stand above the roofs on both sides, as parapets or by their chimneys.

Nouns
-----
rise
    How far a place of a profile (`party_walls`) lies above the roofs on both sides of it along the row: above the
    higher of their means one to two metres away. Not known where the roofs are not level along the row, as beside
    gables that face the street.
parapet
    A station whose rise stands out from those of the other stations, through most of the lines.
chimney
    A compact area of high rise, narrower along the row than a dormer and not at the eaves.
series
    Chimneys of one roof at multiples of one width, that of a house. One chimney says nothing: houses of all kinds have
    one. Chimneys that repeat stand on the party walls of a row.

The thresholds were chosen on synthetic rows with chimneys and parapets (docs/results/real-scenes.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats
from .profiles import line_medians, station_means

__all__ = ["chimneys", "parapet_strength", "repeated", "rises", "series"]

#: Stations (half metres) from a place to the roof on one side: the nearest and the farthest.
_NEAR, _FAR = 2, 4
#: Metres by which the roofs beside a place may rise or fall over one metre along the row.
_LEVEL = 0.25
#: Metres: rise of a chimney, and of the places that belong to it.
_CHIMNEY, _STACK = 0.6, 0.4
#: Stations that a chimney takes along the row, and lines across it, at most.
_WIDE, _DEEP = 3, 5
#: Stations that two chimneys of one wall are apart at most.
_SAME = 2
#: Metres: houses of a row, and how far a chimney of a series stands from its wall at most.
_NARROWEST, _WIDEST, _OFF = 4.0, 10.0, 0.75
#: Fewest chimneys of a series, least share of the chimneys of the roof that stand at its places, and widths between two
#: of them at most.
_FEWEST, _MOST, _GAP = 3, 0.75, 2
#: Metres that a rise differs from the usual one by chance, and share of the lines that must have one.
_NOISE, _KNOWN = 0.08, 0.5
#: Standard deviations by which the rise of a parapet exceeds those of other stations.
_BEYOND = 2.0
#: Metres between stations and between lines.
_LATTICE = 0.5


def rises(profile: Floats) -> Floats:
    """Return how far each place lies above the roofs on both sides, m, shape (stations, lines); NaN where unknown."""
    count = len(profile)
    rise = np.full_like(profile, np.nan)
    first, last = _FAR + _NEAR, count - _FAR - _NEAR
    if first >= last:
        return rise
    means = station_means(profile, _FAR - _NEAR + 1)  # of stations i to i + _FAR - _NEAR
    before, behind = means[first - _FAR :][: last - first], means[first + _NEAR :][: last - first]
    far_before, far_behind = means[: last - first], means[first + _FAR :][: last - first]
    slope = np.maximum(
        np.abs(line_medians(before - far_before, np.inf)), np.abs(line_medians(behind - far_behind, np.inf))
    )
    level = slope < _LEVEL
    rise[first:last][level] = (profile[first:last] - np.maximum(before, behind))[level]
    return rise


def parapet_strength(rise: Floats, share: float, least: float) -> Floats:
    """Return the evidence of parapets for a wall before each station, m, shape (stations,); 0 where there is none.

    Parameters
    ----------
    rise : ndarray, shape (stations, lines)
        See `rises`.
    share : float
        Least share of the lines that show it.
    least : float
        Least rise above the usual one, m.
    """
    strength = np.zeros(len(rise))
    both = np.full_like(rise, np.nan)
    both[1:] = np.fmax(rise[1:], rise[:-1])
    known = np.isfinite(both)
    enough = known.mean(axis=1) >= _KNOWN
    if not enough.any():
        return strength
    middle = line_medians(both)
    usual = float(np.median(middle[enough]))
    spread = 1.4826 * float(np.median(np.abs(middle[enough] - usual)))
    beyond = middle - usual
    for station in np.flatnonzero(enough & (beyond >= max(least, _BEYOND * spread))).tolist():
        if (both[station] > usual + _NOISE).sum() >= share * known[station].sum():
            strength[station] = beyond[station]
    return strength


def chimneys(rise: Floats) -> Floats:
    """Return the stations (fractions allowed) of the chimneys, in order.

    Parameters
    ----------
    rise : ndarray, shape (stations, lines)
        See `rises`; the outermost lines are the eaves.
    """
    from scipy import ndimage

    if not (rise >= _CHIMNEY).any():
        return np.empty(0)
    stack = np.isfinite(rise) & (rise > _STACK)
    stack &= ~_long_runs(stack, _WIDE + 1)
    labels, _ = ndimage.label(stack, structure=np.ones((3, 3)))
    found: list[list[float]] = []
    for number, (along, across) in enumerate(ndimage.find_objects(labels), start=1):
        inside = labels[along, across] == number
        part = np.where(inside, rise[along, across], 0.0)
        at_eaves = across.stop <= 1 or across.start >= rise.shape[1] - 1
        if at_eaves or across.stop - across.start > _DEEP or along.stop - along.start > _WIDE + 1:
            continue
        if part.max() >= _CHIMNEY:
            middle = float((part.sum(axis=1) * np.arange(along.start, along.stop)).sum() / part.sum()) + 0.5
            found.append([middle])
    found.sort()
    walls: list[list[float]] = []
    for one in found:
        if walls and one[0] - walls[-1][-1] < _SAME:
            walls[-1] += one
        else:
            walls.append(one)
    return np.array([float(np.mean(wall)) for wall in walls])


def _long_runs(mask: NDArray[np.bool_], length: int) -> NDArray[np.bool_]:
    """Return the places of runs of at least `length` stations, shape of the mask."""
    runs = np.zeros_like(mask)
    if len(mask) < length:
        return runs
    full = np.asarray(np.lib.stride_tricks.sliding_window_view(mask, length, axis=0).all(axis=2))
    for shift in range(length):
        runs[shift : shift + len(full)] |= full
    return runs


def series(stations: Floats) -> Floats:
    """Return those of some chimneys, in order, that stand at multiples of one width; empty without a series."""
    places = _LATTICE * np.asarray(stations, dtype=np.float64)
    best: list[int] = []
    for i in range(len(places)):
        for j in range(i + 1, len(places)):
            for houses in range(1, _GAP + 1):
                width = (places[j] - places[i]) / houses
                if _NARROWEST <= width <= _WIDEST:
                    fitting = _fitting(places, places[i], width)
                    best = max(best, fitting, key=len)
    return np.asarray(stations)[best] if len(best) >= _FEWEST else np.empty(0)


def repeated(strength: Floats) -> Floats:
    """Return the evidence at those places that are a series, shape (stations,)."""
    strong = strength > 0
    first = np.flatnonzero(strong & ~np.append(False, strong[:-1]))
    last = np.flatnonzero(strong & ~np.append(strong[1:], False))
    kept = np.zeros_like(strength)
    chosen = series((first + last) / 2)
    for begin, end in zip(first, last, strict=True):
        if (begin + end) / 2 in chosen:
            kept[begin : end + 1] = strength[begin : end + 1]
    return kept


def _fitting(places: Floats, first: float, width: float) -> list[int]:
    """Return the longest series of places at `first` and multiples of a width from it; empty if too few fit."""
    number = np.rint((places - first) / width)
    fits = np.flatnonzero(np.abs(places - first - number * width) < _OFF)
    if len(fits) < _MOST * len(places):
        return []
    # Of two places with one number the first counts.
    fits = fits[np.unique(number[fits], return_index=True)[1]]
    pieces = np.split(fits, np.flatnonzero(np.diff(number[fits]) > _GAP) + 1)
    longest: list[int] = max(pieces, key=len).tolist()
    return longest
