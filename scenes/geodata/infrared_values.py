"""Whether the values of a band may be near infrared, or are those of a mask, a count or another band."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

__all__ = ["unlike_infrared"]

#: A band with fewer values is a mask or a count, where the colours have more.
_FEWEST_VALUES = 8
#: Share of the pixels that may be empty or white: masks with soft borders have few others.
_MOST_AT_ENDS = 0.5
#: Share of the pixels that may equal those of another band.
_MOST_EQUAL = 0.99
#: Share of the variance that a weighted sum of the other bands may explain: grey values are such a sum.
_MOST_EXPLAINED = 0.995
#: Pixels by which the sum is fitted.
_SAMPLE = 100_000

_Band = NDArray[np.unsignedinteger]


def unlike_infrared(values: _Band, others: Mapping[str, _Band]) -> str | None:
    """Return what shows that a band is not near infrared, as the end of a sentence; None where nothing does.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Of pixels that have data.
    others : mapping of str to ndarray, shape (n,)
        The colours of the same pixels, by band.

    Examples
    --------
    >>> band = np.arange(1, 200, dtype=np.uint8)
    >>> unlike_infrared(band // 100, {"red": band})
    'holds 2 values only, as a mask does'
    >>> unlike_infrared(np.full_like(band, 220), {"red": np.full_like(band, 200)}) is None
    True
    >>> unlike_infrared(band, {"red": band})
    'equals the red band'
    >>> unlike_infrared(band, {"red": band[::-1] // 2 * 3 % 200}) is None
    True
    """
    levels = np.unique(values)
    # Beside colours that are as flat, few values say nothing, and neither do equal ones.
    pictures = any(len(np.unique(other)) >= _FEWEST_VALUES for other in others.values())
    if len(levels) < _FEWEST_VALUES and (pictures or levels[-1] <= 1):
        return f"holds {len(levels)} value{'s' * (len(levels) != 1)} only, as a mask does"
    white = np.iinfo(values.dtype).max
    pictured = np.any([(other > 0) & (other < white) for other in others.values()], axis=0)
    at_ends = float(np.isin(values[pictured], (0, white)).mean()) if pictured.any() else 0.0
    if at_ends > _MOST_AT_ENDS:
        return f"is 0 or {white} in {at_ends:.0%} of the pixels, as a mask is"
    if not pictures:
        return None
    for name, other in others.items():
        if (other == values).mean() > _MOST_EQUAL:
            return f"equals the {name} band"
    if _explained(values, others) > _MOST_EXPLAINED:
        return f"is a sum of {', '.join(others)}, as grey values are"
    return None


def _explained(values: _Band, others: Mapping[str, _Band]) -> float:
    """Return the share of the variance of a band that the best weighted sum of the others explains."""
    every = slice(None, None, max(1, len(values) // _SAMPLE))
    target = values[every].astype(np.float64)
    columns = np.column_stack([np.ones(len(target)), *(other[every] for other in others.values())]).astype(np.float64)
    left = target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]
    spread = float(target.var())
    return 1 - float(left.var()) / spread if spread else 0.0
