"""A batch of footprints as outlines: what a comparison in parts needs of each of them, without geometry objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from .footprints import Footprints
from .polygon_repair import Repair
from .ring_measures import centres_of, quadrilaterals_of

if TYPE_CHECKING:  # its compiled code takes a moment to load
    from .simple_rings import PlainOutlines

__all__ = ["OutlineBatch"]


@dataclass(frozen=True, eq=False)
class OutlineBatch:
    """Some footprints of a file.

    Attributes
    ----------
    ids : ndarray of int64, shape (n,)
        Row of each footprint in its file.
    start, points : ndarray
        As of `Footprints.rings`.
    areas : ndarray, shape (n,)
        m2.
    repairs : tuple of Repair
        What was repaired or left out on the way in.
    """

    ids: NDArray[np.int64]
    start: NDArray[np.int64]
    points: NDArray[np.float64]
    areas: NDArray[np.float64]
    repairs: tuple[Repair, ...] = ()

    def __len__(self) -> int:
        return len(self.ids)

    @classmethod
    def of(cls, footprints: Footprints) -> Self:
        """Return the outlines of footprints."""
        return cls(footprints.ids, *footprints.rings, footprints.areas, footprints.repairs)

    @classmethod
    def joined(cls, plain: PlainOutlines, others: Footprints, first: int) -> Self:
        """Return plain outlines and footprints in the order of their rows; `first` is added to their numbers."""
        rest = cls.of(others)
        repairs = tuple(Repair(repair.id + first, repair.problem, repair.action) for repair in rest.repairs)
        if not len(rest):
            return cls(plain.rows + first, plain.start, plain.points, plain.areas, repairs)
        ids = np.concatenate([plain.rows, rest.ids])
        order = np.argsort(ids)
        counts = np.concatenate([np.diff(plain.start), np.diff(rest.start)])[order]
        start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        of_plain = np.repeat(order < len(plain.rows), counts)
        points = np.empty((start[-1], 2))
        points[of_plain], points[~of_plain] = plain.points, rest.points
        return cls(ids[order] + first, start, points, np.concatenate([plain.areas, rest.areas])[order], repairs)

    def shape(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the centre of each footprint, m, shape (n, 2), and which are convex quadrilaterals, shape (n,)."""
        found = quadrilaterals_of(self.start, self.points)
        convex = np.zeros(len(self), dtype=bool)
        convex[found[0]] = True
        return centres_of(self.start, self.points, found), convex
