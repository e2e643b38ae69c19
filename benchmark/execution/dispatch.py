"""Dispatch: the order in which runs are given to slots.

Opening a scene often costs more than detecting on it, and a worker keeps the scene that it opened last. Hence the runs
of one scene stay on one worker as long as there are other scenes for the other workers. Among these runs, those of
detectors that run nowhere else come first, so that each kernel is compiled once.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from ..plan import PlannedRun
from .executors import Slot

__all__ = ["Dispatcher"]


class Dispatcher:
    """The waiting runs, by scene."""

    def __init__(self, runs: Iterable[PlannedRun]) -> None:
        self._waiting: dict[str, deque[PlannedRun]] = {}
        for run in runs:
            self._waiting.setdefault(run.identity.scene_key, deque()).append(run)
        self._held: dict[Slot, str] = {}
        self._at: dict[Slot, str] = {}

    def next_for(self, slot: Slot) -> PlannedRun | None:
        """Return the next run for a slot: of its present scene, else of a free scene, else of the longest queue."""
        scene = self._held.get(slot)
        if scene not in self._waiting:
            if not self._waiting:
                return None
            others = {held for other, held in self._held.items() if other is not slot}
            free = [key for key in self._waiting if key not in others]
            scene = free[0] if free else max(self._waiting, key=lambda key: len(self._waiting[key]))
            self._held[slot] = scene
        runs = self._waiting[scene]
        elsewhere = {label for other, label in self._at.items() if other is not slot}
        index = next((index for index, run in enumerate(runs) if run.identity.label not in elsewhere), 0)
        run = runs[index]
        del runs[index]
        self._at[slot] = run.identity.label
        if not runs:
            del self._waiting[scene]
        return run
