"""Freed memory, returned to the operating system.

The C library of Linux keeps freed arrays below 32 MB for later use. The tables of large scenes do not fit into them, so
for scenes of some million cells a third of the resident set would be unused memory.
"""

from __future__ import annotations

import ctypes
import sys

__all__ = ["release_memory"]


def release_memory() -> None:
    """Return freed memory to the system; does nothing where the C library is not GNU's."""
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(ctypes.c_size_t(0))
