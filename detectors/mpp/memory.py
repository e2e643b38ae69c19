"""Freed memory, returned to the operating system.

The C library of Linux keeps freed arrays below 32 MB for later use. The tables of large scenes do not fit into them, so
for scenes of some million cells a third of the resident set would be unused memory. For a small scene it is little, and
the time to return it and to get it again would count.
"""

from __future__ import annotations

import ctypes
import sys

__all__ = ["release_memory"]


#: Cells of the smallest scene whose memory is returned: some 20 MB of arrays.
_LARGE = 500_000


def release_memory(cells: int) -> None:
    """Return freed memory of a scene of so many cells to the system.

    Does nothing for small scenes, and where the C library is not GNU's.
    """
    if cells >= _LARGE and sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(ctypes.c_size_t(0))
