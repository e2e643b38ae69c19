"""Memory that was let go of, handed back to the operating system.

The C library of Linux keeps arrays below 32 MB, once freed, for later; the tables are too large to be laid there, so
that for scenes of some million cells a third of the resident set would serve nobody.
"""

from __future__ import annotations

import ctypes
import sys

__all__ = ["give_back"]


def give_back() -> None:
    """Hand freed memory back; does nothing where the C library is not GNU's."""
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(ctypes.c_size_t(0))
