"""Values that are derived from footprints and kept for as long as these are in memory."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from ...scenes.geodata.footprints import Footprints

__all__ = ["kept_with_footprints"]

_Value = TypeVar("_Value")


def kept_with_footprints(make: Callable[[Footprints], _Value]) -> Callable[[Footprints], _Value]:
    """Return a function that derives its value once for each set of footprints; sets never change.

    Examples
    --------
    >>> import shapely
    >>> total = kept_with_footprints(lambda footprints: [footprints.areas.sum()])
    >>> houses = Footprints.of([shapely.box(0, 0, 10, 10)])
    >>> total(houses) is total(houses)
    True
    """
    kept: WeakKeyDictionary[Footprints, _Value] = WeakKeyDictionary()

    @wraps(make)
    def value(footprints: Footprints) -> _Value:
        if footprints not in kept:
            kept[footprints] = make(footprints)
        return kept[footprints]

    return value
