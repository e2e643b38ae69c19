"""References that overlap although they are of different buildings: in a correct reference there are none.

Awrangjeb et al. 2010, section 4.1: references overlap only where they are parts of one building. Duplicates and
references inside references make an evaluation count one building twice.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...core.wording import counted
from ...scenes.geodata.footprints import Footprints
from .left_out import Objects, repair_notes
from .overlaps import Overlaps, overlaps_within

__all__ = ["input_notes", "reference_overlap_notes", "reference_warnings"]

#: Share of an outline from which on it counts as covered.
_COVERED = 0.999

#: Most pairs that are named.
_NAMED = 5


def input_notes(detected: Footprints, reference: Footprints, within: Overlaps | None = None) -> Iterator[str]:
    """Yield what is wrong with the sets themselves: repaired and unusable features, and overlaps of the reference.

    Parameters
    ----------
    detected, reference : Footprints
    within : Overlaps, optional
        Pairs of references that share area, where they are known already.
    """
    yield from repair_notes(detected, reference)
    yield from reference_warnings(reference) if within is None else reference_overlap_notes(reference, within)


def reference_warnings(reference: Footprints) -> tuple[str, ...]:
    """Return which references of different buildings overlap, are duplicates, or lie inside each other, in words."""
    return tuple(reference_overlap_notes(reference, overlaps_within(reference)))


def reference_overlap_notes(reference: Objects, within: Overlaps) -> Iterator[str]:
    """Yield which references of different buildings overlap, in words, the largest overlaps first.

    Parameters
    ----------
    reference : Objects
    within : Overlaps
        Pairs of references that share area.

    Examples
    --------
    >>> import shapely
    >>> from ...scenes.geodata.footprints import Footprints
    >>> from .overlaps import overlaps_within
    >>> reference = Footprints.of([shapely.box(0, 0, 9, 9), shapely.box(3, 3, 6, 6), shapely.box(8, 0, 18, 9)])
    >>> for note in reference_overlap_notes(reference, overlaps_within(reference)):
    ...     print(note)
    1 pair of references of different buildings, one inside the other: 1 in 0
    1 pair of references of different buildings overlaps: 0 and 2 (11 %)
    """
    codes = reference.building_codes
    pairs = within.only_significant
    pairs = pairs.where(codes[pairs.first] != codes[pairs.second])
    if not len(pairs):
        return
    one, two = (pairs.area / reference.areas[rows] for rows in (pairs.first, pairs.second))
    share = np.maximum(one, two)
    equal = np.minimum(one, two) >= _COVERED
    inside = ~equal & (share >= _COVERED)
    first, second = reference.ids[pairs.first].tolist(), reference.ids[pairs.second].tolist()

    def named(rows: NDArray[np.bool_], words: str) -> str:
        chosen = np.flatnonzero(rows)
        chosen = chosen[np.lexsort((chosen, -np.round(share[chosen], 9)))]
        texts = []
        for k in chosen[:_NAMED].tolist():
            inner, outer = (second[k], first[k]) if two[k] >= one[k] else (first[k], second[k])
            percent = f"{100 * share[k]:.0f}" if share[k] >= 0.01 else "below 1"
            texts.append(words.format(first=first[k], second=second[k], inner=inner, outer=outer, percent=percent))
        return ", ".join(texts) + (f" and {len(chosen) - _NAMED} more" if len(chosen) > _NAMED else "")

    for rows, words, what in (
        (equal, "{first} and {second}", "duplicates of each other"),
        (inside, "{inner} in {outer}", "one inside the other"),
    ):
        if rows.any():
            yield f"{_pairs(rows)} of references of different buildings, {what}: {named(rows, words)}"
    rest = ~equal & ~inside
    if rest.any():
        verb = "overlaps" if rest.sum() == 1 else "overlap"
        words = "{first} and {second} ({percent} %)"
        yield f"{_pairs(rest)} of references of different buildings {verb}: {named(rest, words)}"


def _pairs(rows: NDArray[np.bool_]) -> str:
    return counted(int(rows.sum()), "pair")
