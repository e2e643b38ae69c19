"""Memory of processes: the highest resident memory, bytes, and a bound on what one may allocate.

Linux records the highest resident memory itself, so that no peak between two checks is missed. On other systems only
the present memory is known. Programs that a detector starts count with the process that started them.
"""

from __future__ import annotations

from contextlib import suppress

__all__ = ["bound_allocations", "count_program_memory", "highest_memory", "reset_highest_memory", "tree_memory"]

_ALLOCATION_SLACK = 1 << 30  # bytes that libraries may reserve without using them

#: Highest memory of a program that this process ran since the last reset.
_programs = [0]


def highest_memory(process: int | None = None) -> int:
    """Return the highest resident memory of a process (by default this one); 0 where the system does not report it.

    For this process the programs that it ran are added.
    """
    more = _programs[0] if process is None else 0
    with suppress(OSError, ValueError, StopIteration), open(f"/proc/{process or 'self'}/status") as status:
        line = next(line for line in status if line.startswith("VmHWM"))
        return int(line.split()[1]) * 1024 + more
    import psutil

    with suppress(psutil.Error):
        return int(psutil.Process(process).memory_info().rss) + more
    return more


def tree_memory(process: int) -> int:
    """Return the highest resident memory of a process and of its living descendants, summed."""
    import psutil

    total = highest_memory(process)
    with suppress(psutil.Error):
        total += sum(highest_memory(child.pid) for child in psutil.Process(process).children(recursive=True))
    return total


def count_program_memory(peak: int) -> None:
    """Add the memory of a program that this process ran to `highest_memory` of this process."""
    _programs[0] = max(_programs[0], peak)


def reset_highest_memory() -> None:
    """Reset the kernel's record of the highest resident memory of this process (Linux only)."""
    _programs[0] = 0
    with suppress(OSError), open("/proc/self/clear_refs", "w") as control:
        control.write("5")


def bound_allocations(process: int, memory: int) -> None:
    """Make a huge allocation fail immediately, before the next check of the memory (Linux only)."""
    import psutil

    if hasattr(psutil, "RLIMIT_DATA"):
        bound = memory + _ALLOCATION_SLACK
        with suppress(psutil.Error, OSError):
            psutil.Process(process).rlimit(psutil.RLIMIT_DATA, (bound, psutil.RLIM_INFINITY))
