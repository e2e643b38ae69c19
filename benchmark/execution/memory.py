"""Memory of a process: the highest resident memory, bytes, and a bound on what it may allocate.

Linux records the highest resident memory itself, so that no peak between two checks is missed. On other systems only
the present memory is known.
"""

from __future__ import annotations

from contextlib import suppress

__all__ = ["bound_allocations", "highest_memory", "reset_highest_memory"]

_ALLOCATION_SLACK = 1 << 30  # bytes that libraries may reserve without using them


def highest_memory(process: int | None = None) -> int:
    """Return the highest resident memory of a process (by default this one); 0 where the system does not report it."""
    with suppress(OSError, ValueError, StopIteration), open(f"/proc/{process or 'self'}/status") as status:
        line = next(line for line in status if line.startswith("VmHWM"))
        return int(line.split()[1]) * 1024
    import psutil

    with suppress(psutil.Error):
        return int(psutil.Process(process).memory_info().rss)
    return 0


def reset_highest_memory() -> None:
    """Reset the kernel's record of the highest resident memory of this process (Linux only)."""
    with suppress(OSError), open("/proc/self/clear_refs", "w") as control:
        control.write("5")


def bound_allocations(process: int, memory: int) -> None:
    """Make a huge allocation fail immediately, before the next check of the memory (Linux only)."""
    import psutil

    if hasattr(psutil, "RLIMIT_DATA"):
        bound = memory + _ALLOCATION_SLACK
        with suppress(psutil.Error, OSError):
            psutil.Process(process).rlimit(psutil.RLIMIT_DATA, (bound, psutil.RLIM_INFINITY))
