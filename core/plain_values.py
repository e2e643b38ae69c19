"""Plain values: numbers, texts and None, as text formats and SQLite hold them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

__all__ = ["plain_value"]


def plain_value(value: Any) -> Any:
    """Return a value as Python number, text or None; NaN becomes None.

    Examples
    --------
    >>> plain_value(np.float32(0.5)), plain_value(np.int64(3)), plain_value(float("nan"))
    (0.5, 3, None)
    """
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return None if math.isnan(value) else value
    return None if value is None or type(value).__name__ == "NAType" else str(value)
