"""Memory of a process: the highest resident memory, bytes, and a bound on what it may allocate.

Linux counts the highest resident memory itself, so no spike is missed between two looks; elsewhere a look sees the
present memory only.
"""

from __future__ import annotations

from contextlib import suppress

__all__ = ["bound_allocations", "highest_memory", "reset_highest_memory"]

_ALLOCATION_SLACK = 1 << 30  # bytes that libraries may reserve without using them


def highest_memory(process: int | None = None) -> int:
    """Return the highest resident memory of a process (of this one by default); 0 where the system does not tell."""
    with suppress(OSError, ValueError, StopIteration), open(f"/proc/{process or 'self'}/status") as status:
        line = next(line for line in status if line.startswith("VmHWM"))
        return int(line.split()[1]) * 1024
    import psutil

    with suppress(psutil.Error):
        return int(psutil.Process(process).memory_info().rss)
    return 0


def reset_highest_memory() -> None:
    """Let the kernel count the highest resident memory of this process anew (Linux only)."""
    with suppress(OSError), open("/proc/self/clear_refs", "w") as control:
        control.write("5")


def bound_allocations(process: int, memory: int) -> None:
    """Let one huge allocation fail at once, before a look at the memory could notice it (Linux only)."""
    import psutil

    if hasattr(psutil, "RLIMIT_DATA"):
        bound = memory + _ALLOCATION_SLACK
        with suppress(psutil.Error, OSError):
            psutil.Process(process).rlimit(psutil.RLIMIT_DATA, (bound, psutil.RLIM_INFINITY))
