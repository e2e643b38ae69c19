"""Selection: order statistics of values, such as their median."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel

__all__ = ["ordered_value"]

_Value = TypeVar("_Value", np.int32, np.float32)


@kernel
def ordered_value(values: NDArray[_Value], count: int, place: int) -> _Value:
    """Return the value at a place of the sorted first `count` values, which are reordered in place.

    Quickselect (Hoare 1961). ``np.partition`` returns the same, but takes seconds to compile.
    """
    low, high = 0, count - 1
    while low < high:
        pivot = values[(low + high) // 2]
        i, j = low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                kept = values[i]
                values[i] = values[j]
                values[j] = kept
                i += 1
                j -= 1
        if place <= j:
            high = j
        elif place >= i:
            low = i
        else:
            break
    found: _Value = values[place]
    return found
