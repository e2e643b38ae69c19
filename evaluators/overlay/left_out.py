"""Evaluation area and minimum size: which footprints count.

- A reference is left out when its centre lies outside the evaluation area, or when it is smaller than the minimum size.
- A detection without a match is left out when its centre lies outside the area, or when it overlaps only references
  that are left out.

What is left out is neither right nor wrong, and is reported.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.wording import counted
from ...scenes.geodata.footprints import Footprints
from ..tally import Tallies
from .overlaps import Overlaps, shared_areas
from .polygon_overlay import common_ground

__all__ = [
    "Counted",
    "LeftOut",
    "Measured",
    "Objects",
    "clipped",
    "counted_detections",
    "counted_references",
    "left_out_notes",
    "remeasured",
    "repair_notes",
]

_OUTSIDE = "left out: its centre lies outside the evaluation area"
_SMALL = "left out: smaller than the minimum area"
_ONLY_LEFT_OUT = "left out: overlaps only references that are left out"
_REASONS = np.array(["", _OUTSIDE, _SMALL, _ONLY_LEFT_OUT], dtype=object)


class Measured(Protocol):
    """Objects with areas and centres; `Footprints` are such."""

    @property
    def areas(self) -> NDArray[np.float64]:
        """Area of each object, m2, shape (n,)."""

    @property
    def centres(self) -> NDArray[np.float64]:
        """Centre of each object, m, shape (n, 2)."""

    def __len__(self) -> int: ...


class Objects(Measured, Protocol):
    """Objects of buildings, each with its row in its source; `Footprints` are such."""

    @property
    def ids(self) -> NDArray[np.int64]:
        """Row of each object in its source, shape (n,)."""

    @property
    def building_codes(self) -> NDArray[np.int64]:
        """Building of each object, shape (n,)."""


@dataclass(frozen=True, kw_only=True)
class LeftOut(Tallies):
    """Numbers of objects that are left out: detections, references outside the area, references that are too small."""

    detected: int = 0
    reference_outside: int = 0
    reference_small: int = 0

    @classmethod
    def of(cls, detections: Counted, references: Counted) -> LeftOut:
        """Count what is left out of both sides."""
        return cls(
            detected=int((~detections.mask).sum()),
            reference_outside=int((references.code == 1).sum()),
            reference_small=int((references.code == 2).sum()),
        )


@dataclass(frozen=True, eq=False)
class Counted:
    """Which footprints of one side count.

    Attributes
    ----------
    code : ndarray of int8, shape (n,)
        0 where the footprint counts; 1 outside the area, 2 too small, 3 on left-out references only.
    """

    code: NDArray[np.int8]

    @property
    def mask(self) -> NDArray[np.bool_]:
        """True where the footprint counts, shape (n,)."""
        counts: NDArray[np.bool_] = self.code == 0
        return counts

    @property
    def reasons(self) -> NDArray[np.object_]:
        """Why a footprint is left out, in words; empty where it counts."""
        return self.reasons_of(slice(None))

    def reasons_of(self, part: slice) -> NDArray[np.object_]:
        """Return why the footprints of some rows are left out; see `reasons`."""
        reasons: NDArray[np.object_] = _REASONS[self.code[part]]
        return reasons


def counted_references(
    reference: Measured, *, area: shapely.Geometry | None = None, minimum_area: float = 0.0
) -> Counted:
    """Return which references count.

    Parameters
    ----------
    reference : Measured
    area : polygon, optional
        Evaluation area.
    minimum_area : float
        Smaller references are left out, m2.
    """
    code = np.zeros(len(reference), dtype=np.int8)
    if minimum_area > 0:
        code[reference.areas < minimum_area] = 2
    if area is not None:
        code[~_centres_inside(reference, area)] = 1
    return Counted(code)


def counted_detections(
    detected: Measured,
    overlaps: Overlaps,
    references: Counted,
    *,
    matched: NDArray[np.bool_],
    area: shapely.Geometry | None = None,
) -> Counted:
    """Return which detections count.

    Parameters
    ----------
    detected : Measured
    overlaps : Overlaps
        Overlapping (detection, reference) pairs, left-out references included.
    references : Counted
    matched : ndarray of bool, shape (len(detected),)
        Detections with a match, which always count.
    area : polygon, optional
        Evaluation area.
    """
    overlapping, on_counted = np.zeros((2, len(detected)), dtype=bool)
    overlapping[overlaps.first] = True
    on_counted[overlaps.first[references.mask[overlaps.second]]] = True
    code = np.where(~matched & overlapping & ~on_counted, 3, 0).astype(np.int8)
    if area is not None:
        code[~matched & ~_centres_inside(detected, area)] = 1
    return Counted(code)


def _centres_inside(footprints: Measured, area: shapely.Geometry) -> NDArray[np.bool_]:
    centres = footprints.centres
    inside: NDArray[np.bool_] = shapely.intersects_xy(area, centres[:, 0], centres[:, 1])
    return inside


def clipped(footprints: Footprints, area: shapely.Geometry) -> Footprints:
    """Return the footprints cut at the evaluation area; those outside become empty."""
    crossing = ~shapely.contains_properly(area, footprints.polygons)
    inside = footprints.polygons.copy()
    inside[crossing] = common_ground(inside[crossing], area)
    return Footprints(polygons=inside, crs=footprints.crs, source=footprints.source)


def remeasured(footprints: Footprints, within: Overlaps) -> Overlaps:
    """Return the pairs of one set with the areas that they share after clipping."""
    area = shared_areas(footprints, footprints, within.first, within.second)
    return Overlaps(within.first, within.second, area, within.significant)


def left_out_notes(left_out: LeftOut) -> Iterator[str]:
    """Yield what was left out, in words."""
    if left_out.detected:
        yield (
            f"{counted(left_out.detected, 'detection')} left out: outside the evaluation area, "
            "or on references that are left out"
        )
    if left_out.reference_outside:
        yield f"{counted(left_out.reference_outside, 'reference')} outside the evaluation area left out"
    if left_out.reference_small:
        yield f"{counted(left_out.reference_small, 'reference')} below the minimum area left out"


def repair_notes(*sets: Footprints) -> Iterator[str]:
    """Yield which features of the input were repaired or left out, in words."""
    for footprints in sets:
        for action in dict.fromkeys(repair.action for repair in footprints.repairs):
            ids = [str(repair.id) for repair in footprints.repairs if repair.action == action]
            more = f" and {len(ids) - 10} more" if len(ids) > 10 else ""
            yield f"{footprints.source}: {counted(len(ids), 'feature')} {action}: {', '.join(ids[:10])}{more}"
