"""The gate tested on itself: how often it calls identical code worse.

Nouns
-----
null comparison
    A gate run whose two sides are runs of the same code. The runs of a scene, made with different seeds (those of a
    detector without seeds: made twice), are dealt at random to baseline and candidate, equally many to each; scenes
    are drawn with replacement. Whatever differs is chance, so that every `worse` is a false alarm.
rate of false alarms
    Share of the null comparisons that the gate would end with exit code 1.
bound
    What the theory of the gate promises for that rate: half of the level for each detector whose runs differ.

The rate is that of these runs and scenes: its interval covers the random deals, not other scenes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...evaluators.base import Index
from ..identity.recipes import PluginRecipe
from ..suite import Suite
from .baseline import Baseline, Measured
from .gate import compare
from .inference import wilson_interval

__all__ = ["ALL_DETECTORS", "FalseAlarms", "SelfTest", "self_test", "with_other_seeds"]

#: Name of the row that counts a null comparison once, whichever detector is called worse.
ALL_DETECTORS = "all detectors"

_Runs = dict[tuple[str, int], Mapping[str, float | None] | None]


@dataclass(frozen=True, kw_only=True)
class FalseAlarms:
    """How many null comparisons were called worse.

    Attributes
    ----------
    detector : str
        Label, or `ALL_DETECTORS`.
    margins : {"gated", "none"}
        With the margins of the gate, or with margins of zero, which shows the level of the test itself.
    alarms, comparisons : int
    differ : bool
        Whether runs of identical code differ at all; where they do not, every comparison has the same result.
    bound : float
        Highest rate that the gate promises; 0 where runs do not differ.
    """

    detector: str
    margins: Literal["gated", "none"]
    alarms: int
    comparisons: int
    differ: bool
    bound: float

    @property
    def rate(self) -> float:
        """Share of the null comparisons."""
        return self.alarms / self.comparisons

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the rate; the rate itself where runs do not differ."""
        return wilson_interval(self.alarms, self.comparisons) if self.differ else (self.rate, self.rate)

    @property
    def holds(self) -> bool:
        """Whether the rate is compatible with the bound."""
        return self.interval[0] <= self.bound


@dataclass(frozen=True, kw_only=True)
class SelfTest:
    """Rates of false alarms of every detector and of all together.

    Attributes
    ----------
    version : str
        The code that ran on both sides.
    evaluator : str
    level : float
    scenes : int
    rows : tuple of FalseAlarms
    measurable : bool
        False where the scenes are too few for any conclusion, so that no alarm was possible.
    """

    version: str
    evaluator: str
    level: float
    scenes: int
    rows: tuple[FalseAlarms, ...]
    measurable: bool

    @property
    def exit_code(self) -> int:
        """4 where no conclusion was possible, 1 where a rate is above its bound, else 0."""
        if not self.measurable:
            return 4
        return 0 if all(row.holds for row in self.rows) else 1


def with_other_seeds(suite: Suite) -> Suite:
    """Return the suite with as many other seeds of each detector: the second side of a self-test."""
    entries = tuple(
        replace(entry, seeds=tuple(max(entry.seeds) + 1 + number for number in range(len(entry.seeds))))
        for entry in suite.detectors
    )
    return replace(suite, detectors=entries)


def self_test(
    first: Baseline,
    second: Baseline,
    *,
    indices: Sequence[Index],
    margins: Mapping[str, float],
    level: float,
    comparisons: int = 1000,
    seed: int = 0,
) -> SelfTest:
    """Return how often the gate calls random deals of the runs of two measurements worse.

    Parameters
    ----------
    first, second : Baseline
        The same detectors on the same scenes by the same code, with equally many runs of other seeds.
    indices, margins, level
        Of the gate.
    comparisons : int
        Number of null comparisons.
    seed : int
        Of the random deals.
    """
    rng = np.random.default_rng(seed)
    kinds: dict[Literal["gated", "none"], Mapping[str, float]] = {
        "gated": margins,
        "none": dict.fromkeys(margins, 0.0),
    }
    pools = {label: _pool(found, second.detectors[label]) for label, found in first.detectors.items()}
    differing = [label for label, pool in pools.items() if any(_differ(runs) for runs in pool.values())]
    alarms = {(label, kind): 0 for label in (*differing, ALL_DETECTORS) for kind in kinds}
    scenes = list(first.scenes)

    def conclude(before: Baseline, after: Baseline, kind: Literal["gated", "none"]) -> int:
        return compare(before, after, indices=indices, margins=kinds[kind], level=level).exit_code

    for _ in range(comparisons if differing else 0):
        drawn = [scenes[place] for place in rng.integers(0, len(scenes), len(scenes))]
        called: dict[str, set[str]] = {kind: set() for kind in kinds}
        for label in differing:
            before, after = (replace(first, detectors={label: side}) for side in _dealt(pools[label], drawn, rng))
            for kind in kinds:
                if conclude(before, after, kind) == 1:
                    called[kind].add(label)
                    alarms[label, kind] += 1
        for kind in kinds:
            alarms[ALL_DETECTORS, kind] += bool(called[kind])
    bounds = dict.fromkeys(differing, level / 2) | {ALL_DETECTORS: min(1.0, len(differing) * level / 2)}
    rows = tuple(
        FalseAlarms(
            detector=label,
            margins=kind,
            alarms=alarms.get((label, kind), 0),
            comparisons=comparisons,
            differ=label in bounds and bool(differing),
            bound=bounds.get(label, 0.0),
        )
        for label in (*pools, ALL_DETECTORS)
        for kind in kinds
    )
    return SelfTest(
        version=str(first.version),
        evaluator=first.evaluator.use,
        level=level,
        scenes=len(scenes),
        rows=rows,
        measurable=conclude(first, first, "gated") != 4,
    )


def _pool(*sides: Measured) -> dict[str, list[Mapping[str, float | None] | None]]:
    """Return the runs of all sides by scene."""
    pool: dict[str, list[Mapping[str, float | None] | None]] = {}
    for side in sides:
        for (scene, _), values in side.runs.items():
            pool.setdefault(scene, []).append(values)
    return pool


def _differ(runs: Sequence[Mapping[str, float | None] | None]) -> bool:
    return any(run != runs[0] for run in runs)


def _dealt(
    pool: Mapping[str, Sequence[Mapping[str, float | None] | None]], scenes: Sequence[str], rng: np.random.Generator
) -> tuple[Measured, Measured]:
    """Return two sides: of each scene drawn, half of its runs each."""
    sides: tuple[_Runs, _Runs] = ({}, {})
    for place, scene in enumerate(scenes):
        order = rng.permutation(len(pool[scene]))
        half = len(order) // 2
        for number in range(2 * half):
            sides[number // half][f"{place}", number % half] = pool[scene][order[number]]
    before, after = (Measured(PluginRecipe("same code", {}), (), runs) for runs in sides)
    return before, after
