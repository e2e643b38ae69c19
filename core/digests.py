"""Digests of values that JSON can hold, the same on any machine."""

from __future__ import annotations

import hashlib
import json
from typing import Any

__all__ = ["canonical", "digest"]


def canonical(value: Any) -> str:
    """Return JSON that is the same for equal values: sorted keys, no spaces."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False)


def digest(value: Any) -> str:
    """Return the SHA-256 of a value that JSON can hold, as 64 hexadecimal digits."""
    return hashlib.sha256(canonical(value).encode()).hexdigest()
