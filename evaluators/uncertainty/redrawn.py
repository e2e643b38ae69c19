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

__all__ = ["REDRAWS", "Redraws", "changes_of", "redraw", "redraw_changes", "redraw_differences", "require_error"]

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


def redraw(footprints: Footprints, error: float, rng: np.random.Generator) -> Footprints:
    """Return the footprints as they might have been digitised again.

    Each corner moves by a normal error in x and in y; a corner that several outlines share moves once. Corners are the
    vertices that remain when an outline is simplified by `error`. The vertices between two corners move with them, so
    that a curve stays a curve. Outlines that this makes invalid are repaired.

    Parameters
    ----------
    footprints : Footprints
    error : float
        Standard deviation of each coordinate, m.
    rng : numpy Generator
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
    shift = rng.normal(0.0, error, (len(places), 2))[identity[: len(xy)]]
    moved = xy + np.stack([np.interp(along, along[kept], shift[kept, axis]) for axis in (0, 1)], axis=1)
    redrawn = shapely.set_coordinates(rings.copy(), moved)
    outlines = _polygons(redrawn, part_of_ring, owner, len(footprints))
    found = Footprints.of(outlines, crs=footprints.crs, source=footprints.source)
    return dataclasses.replace(found, building_ids=_ids(footprints, found), ids=footprints.ids[found.ids], repairs=())


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
    stream = np.random.default_rng(seed)
    every = [chosen.evaluate(found, redraw(truth, error, stream), area=area, grid=grid) for _ in range(redraws)]
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

    Both are evaluated against the same redraws. A difference that is smaller than its change is not believed.
    """
    require_error(error)
    stream = np.random.default_rng(0)
    truths = [reference, *(redraw(reference, error, stream) for _ in range(redraws))]
    found: list[Mapping[str, float | None]] = []
    for truth in truths:
        one, two = (evaluator.evaluate(side, truth, area=area, grid=grid).values for side in (first, second))
        found.append({key: _difference(value, two[key]) for key, value in one.items()})
    return Redraws(error=error, redraws=redraws, changes=changes_of(found[0], found[1:]))


def _difference(one: float | None, two: float | None) -> float | None:
    return None if one is None or two is None else two - one


def require_error(error: float) -> None:
    """Raise `ParameterError` unless the error is a length that a digitiser may be off by."""
    if not 0 <= error <= 100:
        raise ParameterError(f"reference_error={error:g} is no digitising error: use metres from 0 to 100, such as 0.3")


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
