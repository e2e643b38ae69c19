"""The trace of one detection: every intermediate result, to count, to show and to test.

The *outcome* of a line says why it made no rectangle, or that it did.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.raster import Grid, Image
from .boxes import Boxes
from .masks import Masks
from .orientation import Oriented
from .texture import Texture

__all__ = ["Adjusted", "Outcome", "Trace", "Votes"]

#: Votes v1 to v4 of each line (see `voting`), shape (n, 4), NaN without a vote.
Votes = NDArray[np.float64]


class Outcome(IntEnum):
    """Why a line made no rectangle, or that it did; `label` says it in words."""

    RECTANGLE = 0, "made a rectangle"
    BORDER = 1, "on the border of the points or the image"
    VEGETATION = 2, "vegetation beside it"
    UNADJUSTED = 3, "neither parallel nor perpendicular to a reference"
    OUTVOTED = 4, "outvoted"
    INSIDE = 5, "inside another line's rectangle"
    NARROW = 6, "rectangle with a side under the minimum"
    NO_SIDE = 7, "no building on either side"

    label: str

    def __new__(cls, value: int, label: str) -> Outcome:
        """Make a member with its label."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.label = label
        return member


@dataclass(frozen=True, eq=False)
class Adjusted:
    """Lines after adjustment and extension.

    Attributes
    ----------
    lines : ndarray, shape (n, 8)
    shapes : ndarray of int64, shape (n,)
        Black shape of each line.
    rotation : ndarray, shape (n,)
        Angle by which each was adjusted, radians; NaN for lines that were not.
    remaining : ndarray of bool, shape (n,)
        Lines that no earlier step dropped.
    """

    lines: Boxes
    shapes: NDArray[np.int64]
    rotation: NDArray[np.float64]
    remaining: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Trace:
    """Intermediate results of a line detector, pixel coordinates.

    Attributes
    ----------
    image : Image
    masks : Masks
    vegetation : ndarray of int32, shape (rows, columns + 1)
        Row prefix sums of the vegetation index.
    fitted, lines : ndarray, shape (n, 8)
        Lines as fitted, and adjusted and extended (as far as they came).
    shapes, outcomes : ndarray of int64, shape (n,)
        Black shape of each line, and its `Outcome`.
    smooth_green : ndarray of bool, shape (n,)
        Lines that the vegetation index alone would have dropped, kept because their entropy is low.
    initial : ndarray, shape (m, 8)
        Initial rectangles.
    candidate_of : ndarray of int64, shape (m,)
        Index of the candidate of each initial rectangle, -1 when it lay inside one.
    candidates : ndarray, shape (k, 8)
        Extended rectangles.
    duplicates : ndarray of bool, shape (k,)
        Candidates with the texture of a building that larger ones cover.
    kept : ndarray of bool, shape (k,)
        Which candidates are buildings and no duplicates.
    votes : ndarray, shape (n, 4), optional
    texture : Texture or Oriented, optional
        Edge orientation histograms and tests of the candidates, or their scores.
    """

    image: Image
    masks: Masks
    vegetation: NDArray[np.int32]
    fitted: Boxes
    lines: Boxes
    shapes: NDArray[np.int64]
    outcomes: NDArray[np.int64]
    smooth_green: NDArray[np.bool_]
    initial: Boxes
    candidate_of: NDArray[np.int64]
    candidates: Boxes
    duplicates: NDArray[np.bool_]
    kept: NDArray[np.bool_]
    votes: Votes | None = None
    texture: Texture | Oriented | None = None

    @property
    def grid(self) -> Grid:
        """Grid of the orthoimage."""
        return self.image.grid

    @property
    def final(self) -> Boxes:
        """The candidates that are buildings."""
        return np.asarray(self.candidates[self.kept])

    def counts(self) -> dict[str, Any]:
        """Return how many lines and rectangles each step left, for the metadata of the footprints."""
        counted: dict[str, Any] = {"lines": len(self.outcomes)}
        counted |= {f"lines {outcome.label}": int((self.outcomes == outcome).sum()) for outcome in Outcome}
        counted["lines kept by entropy"] = int(self.smooth_green.sum())
        counted["initial rectangles"] = len(self.initial)
        counted["initial rectangles inside a final one"] = int((self.candidate_of < 0).sum())
        counted["final rectangles that larger ones cover"] = int(self.duplicates.sum())
        counted["final rectangles"] = int(self.kept.sum())
        if self.texture is not None:
            counted["candidates without texture of a building"] = int((~self.kept & ~self.duplicates).sum())
        if isinstance(self.texture, Texture):
            passed = self.texture.passed
            alone = passed & (passed.sum(axis=1) == 1)[:, None]
            counted |= {f"candidates kept by test {k + 1} alone": int(alone[:, k].sum()) for k in range(6)}
        return counted
