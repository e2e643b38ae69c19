"""Point clouds: laser returns as arrays.

A *point* is one return of a laser pulse: x (east), y (north), z (up) in metres; *return number* and *number of
returns* count from 1 within its pulse; *classification* is the ASPRS code (2 ground, 6 building, 9 water). Detectors
never see the classification: it is an interpretation, not a measurement.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["PointCloud"]

#: Up to so many points are all looked at for repeats.
_FEW = 10_000


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Laser returns.

    Attributes
    ----------
    x, y, z : ndarray of float64, shape (n,)
        Metres.
    return_number, number_of_returns : ndarray of uint8, shape (n,), optional
        None when the file does not store them.
    intensity : ndarray of uint16, shape (n,), optional
    classification : ndarray of uint8, shape (n,), optional
    colour : ndarray of uint16, shape (n, 3) or (n, 4), optional
        Red, green, blue (, near infrared), full 16 bit range.
    source : ndarray of uint16, shape (n,), optional
        Point source id: the flight strip; None when all points have the same.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    return_number: NDArray[np.uint8] | None = None
    number_of_returns: NDArray[np.uint8] | None = None
    intensity: NDArray[np.uint16] | None = None
    classification: NDArray[np.uint8] | None = None
    colour: NDArray[np.uint16] | None = None
    source: NDArray[np.uint16] | None = None

    def __len__(self) -> int:
        return len(self.x)

    def take(self, index: NDArray[np.bool_] | NDArray[np.intp] | slice) -> PointCloud:
        """Return the points at `index` (a mask, integers, or a slice, which copies nothing)."""
        columns: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            column = getattr(self, field.name)
            columns[field.name] = None if column is None else column[index]
        return PointCloud(**columns)

    def window(self, extent: Sequence[float]) -> PointCloud:
        """Return the points in ``[xmin, ymin, xmax, ymax]``, its border included."""
        xmin, ymin, xmax, ymax = extent
        return self.take((self.x >= xmin) & (self.x <= xmax) & (self.y >= ymin) & (self.y <= ymax))

    def repeats(self) -> NDArray[np.bool_]:
        """Return which points equal an earlier one in all but the source, shape (n,): tiles that overlap have such.

        One point in 64 is looked at first, chosen by its coordinates so that all its copies are: points without any
        copy among those need no sorting.
        """
        repeated = np.zeros(len(self), dtype=np.bool_)
        code = _codes(self.x, self.y, self.z)
        sample = np.sort(code[code % np.uint64(64) == 0])
        if len(self) > _FEW and not (sample[1:] == sample[:-1]).any():
            return repeated
        order = np.argsort(code, kind="stable")
        same = code[order[1:]] == code[order[:-1]]
        later, earlier = order[1:][same], order[:-1][same]
        equal = np.ones(len(later), dtype=np.bool_)
        for field in dataclasses.fields(self):
            column = getattr(self, field.name)
            if column is not None and field.name != "source":
                agree = column[later] == column[earlier]
                equal &= agree if agree.ndim == 1 else agree.all(axis=1)
        repeated[later[equal]] = True
        return repeated

    def distinct(self) -> PointCloud:
        """Return the points without repeats; the cloud itself when it has none."""
        repeats = self.repeats()
        return self.take(~repeats) if repeats.any() else self

    def unclassified(self) -> PointCloud:
        """Return the same points without classification: what a detector may see."""
        return dataclasses.replace(self, classification=None)


def _codes(*coordinates: NDArray[np.float64]) -> NDArray[np.uint64]:
    """Return a number per point that equal points share and others hardly ever."""
    code = np.zeros(len(coordinates[0]), dtype=np.uint64)
    for values in coordinates:
        code ^= np.ascontiguousarray(values, dtype=np.float64).view(np.uint64)
        # Multiply and fold (Fibonacci hashing): the low bits of a float are mostly zero.
        code *= np.uint64(0x9E3779B97F4A7C15)
        code ^= code >> np.uint64(29)
    return code
