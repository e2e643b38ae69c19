"""Overlaps of two stores, part by part.

A pair of footprints is found in every part that holds both of them, and is owned by one: the part of the tile in which
the lower left corner of the common bounds lies. So each pair is measured once, by the same code and from the same
numbers as in memory, and the graph of all pairs is whole, however the plane is divided.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import InputError
from .bounds_index import meeting_bounds, meeting_bounds_within
from .groups import Members
from .outline_arrays import Outlines, polygons_of
from .outline_overlaps import shared_by_outlines, shared_within
from .outline_store import OutlineStore, part_of_points
from .overlaps import NUMERICAL_ZERO, Overlaps
from .polygon_overlay import common_ground
from .united import united_areas
from .vertex_distances import ring_distances

__all__ = ["PairTable", "united_from_stores", "whole_graph"]

#: Most pairs of one part whose bounds meet.
_MOST_PAIRS = 5e7
#: Members whose outlines are in memory at a time.
_MOST_MEMBERS = 1 << 20

_BETWEEN = np.dtype([("first", "<i8"), ("second", "<i8"), ("area", "<f8"), ("outline", "<f8"), ("polis", "<f8")])
_WITHIN = np.dtype([("first", "<i8"), ("second", "<i8"), ("area", "<f8")])


@dataclass(frozen=True, eq=False)
class PairTable:
    """Pairs (detection, reference) that share area, with their distances, sorted by (first, second).

    Attributes
    ----------
    overlaps : Overlaps
    outline, polis : ndarray, shape (n,)
        As of `PairDistances`, m; NaN where the pair shares no more than rounding.
    """

    overlaps: Overlaps
    outline: NDArray[np.float64]
    polis: NDArray[np.float64]

    def places(self, first: NDArray[np.int64], second: NDArray[np.int64], width: int) -> NDArray[np.int64]:
        """Return where these pairs stand; `width` is the number of references."""
        keys = self.overlaps.first * width + self.overlaps.second
        places: NDArray[np.int64] = np.searchsorted(keys, first * width + second)
        return places


def whole_graph(
    detected: OutlineStore, reference: OutlineStore, folder: Path, progress: Callable[[int, int], None]
) -> tuple[PairTable, tuple[Overlaps, Overlaps]]:
    """Return the pairs between two stores and within each of them.

    What is found in a part is kept in `folder`; parts that are there already are not computed again.

    Parameters
    ----------
    detected, reference : OutlineStore
        Complete, of one division.
    folder : Path
    progress : callable
        Takes the number of finished parts and of all.

    Raises
    ------
    InputError
        So many footprints lie on each other that their pairs would fill the memory.
    """
    folder.mkdir(exist_ok=True)
    parts = detected.division.parts
    for number in range(parts):
        if not (folder / f"{number}.npz").is_file():
            found = _pairs_of_part(detected, reference, number)
            temporary = folder / "unfinished.npz"
            np.savez(temporary, allow_pickle=False, **found)
            temporary.replace(folder / f"{number}.npz")
        progress(number + 1, parts)
    between = _collected(folder, parts, "between")
    sizes = detected.objects.areas, reference.objects.areas
    table = PairTable(
        Overlaps.of(between["first"].copy(), between["second"].copy(), between["area"].copy(), sizes),
        between["outline"].copy(),
        between["polis"].copy(),
    )
    del between
    within = []
    for name, areas in zip(("detected", "reference"), sizes, strict=True):
        rows = _collected(folder, parts, name)
        within.append(Overlaps.of(rows["first"].copy(), rows["second"].copy(), rows["area"].copy(), (areas, areas)))
    return table, (within[0], within[1])


def _pairs_of_part(detected: OutlineStore, reference: OutlineStore, number: int) -> dict[str, NDArray[Any]]:
    (rows_one, one), (rows_two, two) = detected.part(number), reference.part(number)
    first, second = _few(meeting_bounds(one.bounds, two.bounds, most=_MOST_PAIRS), detected)
    owned = _owned(detected, one, two, first, second, number)
    first, second = first[owned], second[owned]
    area = shared_by_outlines(one, two, first, second)
    shares = area > 0
    first, second, area = first[shares], second[shares], area[shares]
    between = np.empty(len(first), dtype=_BETWEEN)
    between["first"], between["second"], between["area"] = rows_one[first], rows_two[second], area
    between["outline"] = between["polis"] = np.nan
    overlap = np.flatnonzero(area > NUMERICAL_ZERO * np.minimum(one.area[first], two.area[second]))
    quadrilateral = (
        detected.objects.quadrilateral[rows_one[first[overlap]]]
        & reference.objects.quadrilateral[rows_two[second[overlap]]]
    )
    outline, _, polis = ring_distances(one[:2], two[:2], first[overlap], second[overlap], quadrilateral)
    between["outline"][overlap], between["polis"][overlap] = outline, polis
    found = {"between": between}
    for name, store, rows, outlines in (
        ("detected", detected, rows_one, one),
        ("reference", reference, rows_two, two),
    ):
        first, second = _few(meeting_bounds_within(outlines.bounds, most=_MOST_PAIRS), store)
        owned = _owned(store, outlines, outlines, first, second, number)
        first, second = first[owned], second[owned]
        area = shared_within(outlines, first, second)
        shares = area > 0
        within = np.empty(np.count_nonzero(shares), dtype=_WITHIN)
        within["first"], within["second"], within["area"] = rows[first[shares]], rows[second[shares]], area[shares]
        found[name] = within
    return found


def _few(
    pairs: tuple[NDArray[np.int64], NDArray[np.int64]] | None, store: OutlineStore
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    if pairs is None:
        raise InputError(
            f"{store.facts.get('source', 'footprints')}: footprints of one part of the plane lie on each other or on "
            f"others in more than {_MOST_PAIRS:,.0f} pairs: is it a stack of duplicates, or of candidates before their "
            "selection?"
        )
    return pairs


def _owned(
    store: OutlineStore,
    one: Outlines,
    two: Outlines,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    number: int,
) -> NDArray[np.bool_]:
    corner = np.maximum(one.bounds[first, :2], two.bounds[second, :2])
    owned: NDArray[np.bool_] = part_of_points(corner, store.division) == number
    return owned


def _collected(folder: Path, parts: int, name: str) -> NDArray[Any]:
    """Return the rows of all parts, sorted by (first, second)."""
    rows = []
    for number in range(parts):
        with np.load(folder / f"{number}.npz", allow_pickle=False) as found:
            rows.append(found[name])
    table = np.concatenate(rows)
    del rows
    return table[np.lexsort((table["second"], table["first"]))]


def united_from_stores(
    detected: OutlineStore, reference: OutlineStore, kind: str, members: Members
) -> NDArray[np.float64]:
    """Return the area of the union of each group, from outlines on disk; see `tally_areas`."""
    sides = (reference, reference) if kind == "reference" else (detected, reference)
    areas = np.empty(len(members.start) - 1)
    begin = 0
    while begin < len(areas):
        # As many whole groups as fit, at least one.
        end = int(np.searchsorted(members.start, members.start[begin] + _MOST_MEMBERS, side="right")) - 1
        end = min(max(end, begin + 1), len(areas))
        part = slice(members.start[begin], members.start[end])
        rows_one, one = np.unique(members.one[part], return_inverse=True)
        has = members.two[part] >= 0
        rows_two, two_of = np.unique(members.two[part][has], return_inverse=True)
        two = np.full(len(has), -1, dtype=np.int64)
        two[has] = two_of
        outlines = sides[0].outlines(rows_one), sides[1].outlines(rows_two)
        few = Members(members.start[begin : end + 1] - members.start[begin], one.astype(np.int64), two)
        areas[begin:end] = united_areas(*outlines, few)
        for group in np.flatnonzero(np.isnan(areas[begin:end])).tolist():
            inside = slice(few.start[group], few.start[group + 1])
            ground = polygons_of(outlines[0], few.one[inside])
            if kind == "pairs":
                ground = common_ground(ground, polygons_of(outlines[1], few.two[inside]))
            areas[begin + group] = reduce(shapely.union, ground).area
        begin = end
    return areas
