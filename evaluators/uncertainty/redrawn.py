"""Redrawn references: how far the indices move when the reference is digitised again.

A reference is drawn by hand, with an error. A difference between two detections is not significant where
another drawing of the same buildings would change the scores by more.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import ParameterError
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.raster import Grid
from ..base import Evaluator
from ..given_footprints import GivenFootprints, GivenReference, given_sets
from ..registry import DEFAULT, make_evaluator

__all__ = [
    "REDRAWS",
    "Redraws",
    "changes_of",
    "redraw",
    "redraw_changes",
    "redraw_differences",
    "require_error",
    "value_differences",
]

#: Default number of redraws.
REDRAWS = 50

#: Share of the redraws that change an index by no more than what is reported.
_SHARE = 0.95


@dataclass(frozen=True, kw_only=True)
class Redraws:
    """How far each index moves when the reference is redrawn.

    Attributes
    ----------
    error : float
        Standard deviation of each coordinate of a redrawn corner, m.
    redraws : int
    changes : mapping of str to float or None
        By the key of the index: 95 % of the redraws change it by no more than this. None where it is undefined.
    """

    error: float
    redraws: int
    changes: Mapping[str, float | None] = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON holds."""
        return {"error": self.error, "redraws": self.redraws, "changes": dict(self.changes)}


def redraw(footprints: Footprints, error: float, *, number: int, seed: int = 0) -> Footprints:
    """Return the footprints as they might have been digitised again.

    Each corner moves by a normal error in x and in y; a corner that several outlines share moves once. Corners are the
    vertices that remain when an outline is simplified by `error`. The vertices between two corners move with them, so
    that a curve stays a curve. Outlines that this makes invalid are repaired. The error of a corner follows from its
    coordinates, so footprints that are redrawn a few at a time are the same as all at once.

    Parameters
    ----------
    footprints : Footprints
    error : float
        Standard deviation of each coordinate, m.
    number : int
        Of the redraw.
    seed : int
    """
    if not len(footprints) or not error:
        return footprints
    parts, owner = shapely.get_parts(footprints.polygons, return_index=True)
    rings, part_of_ring = shapely.get_rings(parts, return_index=True)
    xy, ring_of_point = shapely.get_coordinates(rings, return_index=True)
    corners, ring_of_corner = shapely.get_coordinates(shapely.simplify(rings, error), return_index=True)
    places, identity = np.unique(np.concatenate([xy, corners]), axis=0, return_inverse=True)
    identity = identity.ravel()
    keys = [
        ring * len(places) + who
        for ring, who in ((ring_of_point, identity[: len(xy)]), (ring_of_corner, identity[len(xy) :]))
    ]
    # The first vertex of a ring always remains, and closes it: positions along all rings never interpolate across two.
    kept = np.isin(*keys)
    first = np.append(True, np.diff(ring_of_point) != 0)
    kept |= first | np.append(first[1:], True)
    steps = np.hypot(*np.diff(xy, axis=0, prepend=xy[:1]).T)
    along = np.cumsum(np.where(first, 1.0, steps))
    shift = error * _normal_errors(xy, number, seed)
    moved = xy + np.stack([np.interp(along, along[kept], shift[kept, axis]) for axis in (0, 1)], axis=1)
    redrawn = shapely.set_coordinates(rings.copy(), moved)
    outlines = _polygons(redrawn, part_of_ring, owner, len(footprints))
    found = Footprints.of(outlines, crs=footprints.crs, source=footprints.source)
    return dataclasses.replace(found, building_ids=_ids(footprints, found), ids=footprints.ids[found.ids], repairs=())


def _normal_errors(points: NDArray[np.float64], number: int, seed: int) -> NDArray[np.float64]:
    """Return two standard normal numbers for each point, which follow from its coordinates (Box-Muller)."""
    x, y = np.ascontiguousarray((points + 0.0).T).view(np.uint64)  # -0.0 becomes 0.0
    stream = _mixed(_mixed(np.array([seed], dtype=np.uint64)) + np.uint64(number))
    key = _mixed(x ^ _mixed(y ^ stream))
    uniform = [(_mixed(key + np.uint64(k)) >> np.uint64(11)).astype(np.float64) * 2.0**-53 for k in (1, 2)]
    radius, angle = np.sqrt(-2.0 * np.log1p(-uniform[0])), 2.0 * np.pi * uniform[1]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _mixed(keys: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return keys whose bits are mixed (the finaliser of SplitMix64)."""
    keys = keys + np.uint64(0x9E3779B97F4A7C15)
    keys = (keys ^ (keys >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    keys = (keys ^ (keys >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return keys ^ (keys >> np.uint64(31))


def _polygons(
    rings: NDArray[np.object_], part_of_ring: NDArray[np.int64], owner: NDArray[np.int64], count: int
) -> NDArray[np.object_]:
    """Return polygons of rings (outline first, then holes), parts of one footprint joined."""
    bounds = np.searchsorted(part_of_ring, np.arange(len(owner) + 1))
    parts = [
        shapely.Polygon(rings[low], list(rings[low + 1 : high]))
        for low, high in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)
    ]
    ends = np.searchsorted(owner, np.arange(count + 1)).tolist()
    polygons = np.empty(count, dtype=object)
    for row, (low, high) in enumerate(itertools.pairwise(ends)):
        polygons[row] = parts[low] if high == low + 1 else shapely.MultiPolygon(parts[low:high])
    return polygons


def _ids(footprints: Footprints, found: Footprints) -> NDArray[Any] | None:
    """Return the building ids of what is left: an outline that collapses is left out."""
    return None if footprints.building_ids is None else footprints.building_ids[found.ids]


def redraw_changes(
    detected: GivenFootprints,
    reference: GivenReference,
    *,
    error: float,
    evaluator: str | Evaluator = DEFAULT,
    area: shapely.Geometry | None = None,
    grid: Grid | None = None,
    redraws: int = REDRAWS,
    seed: int = 0,
) -> Redraws:
    """Return how far every index moves when the reference is redrawn with a digitising error.

    Parameters
    ----------
    detected : Footprints, GeoDataFrame, GeoSeries, path, or iterable of polygons
    reference : the same, or Scene
    error : float
        Standard deviation of each coordinate of a redrawn corner, m; see `redraw`.
    evaluator : str or Evaluator
    area : polygon, optional
        Evaluation area.
    grid : Grid, optional
        Grid of the orthoimage.
    redraws : int
    seed : int

    Raises
    ------
    ParameterError
        The error is no length from 0 to 100 m.

    Examples
    --------
    >>> reference = Footprints.of([shapely.box(0, 0, 10, 10)])
    >>> redraw_changes(reference, reference, error=0.0).changes["pixel.quality"]
    0.0
    """
    require_error(error)
    chosen = make_evaluator(evaluator)
    (found,), (truth, area, grid) = given_sets([detected], reference, area, grid)
    whole = chosen.evaluate(found, truth, area=area, grid=grid)
    truths = (redraw(truth, error, number=number, seed=seed) for number in range(redraws))
    every = [chosen.evaluate(found, redrawn, area=area, grid=grid) for redrawn in truths]
    return Redraws(error=error, redraws=redraws, changes=changes_of(whole.values, [one.values for one in every]))


def redraw_differences(
    first: Footprints,
    second: Footprints,
    reference: Footprints,
    *,
    error: float,
    evaluator: Evaluator,
    area: shapely.Geometry | None = None,
    grid: Grid | None = None,
    redraws: int = REDRAWS,
) -> Redraws:
    """Return how far the differences between two detections move when the reference is redrawn; see `redraw_changes`.

    Both are evaluated against the same redraws. A difference that is smaller than its change is not reliable.
    """
    require_error(error)
    found: list[Mapping[str, float | None]] = []
    for truth in (reference, *(redraw(reference, error, number=number) for number in range(redraws))):
        one, two = (evaluator.evaluate(side, truth, area=area, grid=grid).values for side in (first, second))
        found.append(value_differences(one, two))
    return Redraws(error=error, redraws=redraws, changes=changes_of(found[0], found[1:]))


def value_differences(one: Mapping[str, float | None], two: Mapping[str, float | None]) -> dict[str, float | None]:
    """Return by how much the values of B exceed those of A; None where either is undefined."""
    return {
        key: None if first is None or second is None else second - first
        for (key, first), second in zip(one.items(), two.values(), strict=True)
    }


def require_error(error: float) -> None:
    """Raise `ParameterError` unless the error is a length that a digitiser may be off by."""
    if not 0 <= error <= 100:
        raise ParameterError(
            f"reference_error={error:g} is not a digitising error: use metres from 0 to 100, such as 0.3"
        )


def changes_of(given: Mapping[str, float | None], redrawn: list[Mapping[str, float | None]]) -> dict[str, float | None]:
    """Return the change of each value that 95 % of the redraws do not exceed; None where undefined in any."""
    changes: dict[str, float | None] = {}
    for key, value in given.items():
        others = [found[key] for found in redrawn]
        known = [other for other in others if other is not None]
        if value is None or len(known) < len(others):
            changes[key] = None
        else:
            changes[key] = float(np.quantile(np.abs(np.array(known) - value), _SHARE))
    return changes
