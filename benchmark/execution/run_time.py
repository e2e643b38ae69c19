"""Time, memory and failure of one run, as they are reported."""

from __future__ import annotations

import os
import time
from typing import Any, NamedTuple

from ...core.errors import RoofbenchError
from ...core.memory import highest_memory

__all__ = ["Stopwatch", "processor_time", "reason_of"]


def processor_time() -> float:
    """Return the processor time of this process and of the programs that it ran, seconds."""
    times = os.times()
    return time.process_time() + times.children_user + times.children_system


class Stopwatch(NamedTuple):
    """When something began: wall clock and processor time, seconds."""

    wall: float
    processor: float

    @classmethod
    def start(cls) -> Stopwatch:
        """Return one that starts now."""
        return cls(time.perf_counter(), processor_time())

    def read(self) -> dict[str, Any]:
        """Return the fields of a `Cost`: times since the start, and the highest memory of this process."""
        return {
            "seconds": time.perf_counter() - self.wall,
            "cpu_seconds": processor_time() - self.processor,
            "peak_memory": highest_memory(),
        }


def reason_of(error: Exception) -> str:
    """Return an error of a detector or an evaluator as one line."""
    reason = str(error) if isinstance(error, RoofbenchError) else f"{type(error).__name__}: {error}"
    if isinstance(error, MemoryError):
        reason = f"out of memory: {error}".rstrip(": ")
    return " ".join(reason.split())[:500]
