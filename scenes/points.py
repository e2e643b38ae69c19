"""Point clouds: laser returns as arrays.

A *point* is one return of a laser pulse: x (east), y (north), z (up) in metres; *return number* and *number of
returns* count from 1 within its pulse; *classification* is the ASPRS code (2 ground, 6 building, 9 water). Detectors
never see the classification: it is somebody's answer, not a measurement.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["PointCloud"]


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Laser returns.

    Attributes
    ----------
    x, y, z : ndarray of float64, shape (n,)
        Metres.
    return_number, number_of_returns : ndarray of uint8, shape (n,), optional
        None when the file does not tell.
    intensity : ndarray of uint16, shape (n,), optional
    classification : ndarray of uint8, shape (n,), optional
    colour : ndarray of uint16, shape (n, 3) or (n, 4), optional
        Red, green, blue (, near infrared), full 16 bit range.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    return_number: NDArray[np.uint8] | None = None
    number_of_returns: NDArray[np.uint8] | None = None
    intensity: NDArray[np.uint16] | None = None
    classification: NDArray[np.uint8] | None = None
    colour: NDArray[np.uint16] | None = None

    def __len__(self) -> int:
        return len(self.x)

    def take(self, index: NDArray[np.bool_] | NDArray[np.intp] | slice) -> PointCloud:
        """Return the points at `index` (a mask, integers, or a slice, which copies nothing)."""
        columns: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            column = getattr(self, field.name)
            columns[field.name] = None if column is None else column[index]
        return PointCloud(**columns)

    def unclassified(self) -> PointCloud:
        """Return the same points without classification: what a detector may see."""
        return dataclasses.replace(self, classification=None)
