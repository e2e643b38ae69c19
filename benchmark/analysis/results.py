"""Results: what analyses return, as frozen data without any drawing.

Nouns
-----
leaderboard
    Detectors compared by one evaluator over common scenes. It has one entry per detector and way of pooling:
    ``pooled`` (counts and areas of all scenes added, then the ratio) and ``mean`` (mean over scenes of the scenes'
    values).
conclusion
    What the gate says of one index of one detector, from the paired differences over scenes.
comparison
    Two results stores, paired by detector and scene.

Values are fractions, metres, seconds and bytes; None where undefined. `reports` turns them into text.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from ...evaluators.base import Index

__all__ = [
    "CONCLUSIONS",
    "Cell",
    "ComparedRow",
    "Conclusion",
    "Entry",
    "GateResult",
    "IndexConclusion",
    "Leaderboard",
    "StoreComparison",
    "UnsuccessfulRun",
]

Conclusion: TypeAlias = Literal["better", "worse", "equal", "undecided", "not measurable"]
#: Every conclusion, the good ones first.
CONCLUSIONS: tuple[Conclusion, ...] = ("better", "worse", "equal", "undecided", "not measurable")


@dataclass(frozen=True)
class Cell:
    """One index of one entry.

    Attributes
    ----------
    value : float, optional
        None where undefined.
    scenes : int
        Number of scenes behind the value.
    low, high : float, optional
        Bootstrap interval over scenes (95 %); None for fewer than two scenes.
    """

    value: float | None
    scenes: int
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One line of a leaderboard.

    Attributes
    ----------
    label, detector : str
        Name with changed parameters, and name alone.
    parameters : mapping
    pooling : {"pooled", "mean"}
    rank : int, optional
        By the leaderboard's index; None for a detector without a result on every scene.
    group : str
        Letters shared by detectors whose difference is not significant; empty where that was not tested.
    scenes, runs, failed, skipped : int
        Scenes with a result, and runs by status.
    detected, reference : int
        Objects behind the values, over all runs.
    cpu_seconds : float, optional
        Median processor time of a run.
    peak_memory : int, optional
        Highest of all runs, bytes.
    cells : mapping of str to Cell
        By index key.
    benchmark : str
        Versions of the benchmark of its runs, the newest first: ``1``, ``unknown`` or ``2+1``.
    """

    label: str
    detector: str
    parameters: Mapping[str, Any]
    pooling: Literal["pooled", "mean"]
    rank: int | None
    group: str
    scenes: int
    runs: int
    failed: int
    skipped: int
    detected: int
    reference: int
    cpu_seconds: float | None
    peak_memory: int | None
    cells: Mapping[str, Cell]
    benchmark: str


@dataclass(frozen=True, kw_only=True)
class UnsuccessfulRun:
    """A run that failed or was skipped, with its reason and the command that repeats it."""

    status: str
    label: str
    scene: str
    seed: int
    reason: str
    command: str


@dataclass(frozen=True, kw_only=True)
class Leaderboard:
    """Detectors compared by one evaluator over common scenes.

    Attributes
    ----------
    title : str
    evaluator : str
        Name with the parameters that decide the values, such as the matching.
    rank_by : Index
    indices : tuple of Index
        The columns of the wide table.
    summary : tuple of Index
        The columns of the narrow table, the one that ranks first.
    entries : tuple of Entry
        Both poolings of every detector, in the order of rank.
    scenes : tuple of str
        Those that the values are over.
    by_scene : mapping of str to mapping of str to float
        Scene, also of those that are left out of `scenes`, to detector label to the mean over seeds of the index that
        ranks; None where that is undefined, absent where the detector has no result.
    cues : mapping of str to mapping of str to tuple of str
        Detector label to cue to the scenes on which it carried information and was used; under ``""`` the scenes on
        which the detector named its cues. Detectors that name none are absent.
    notes : tuple of str
    unsuccessful : tuple of UnsuccessfulRun
        Failures, then skips.
    """

    title: str
    evaluator: str
    rank_by: Index
    indices: tuple[Index, ...]
    summary: tuple[Index, ...]
    entries: tuple[Entry, ...]
    scenes: tuple[str, ...]
    by_scene: Mapping[str, Mapping[str, float | None]]
    cues: Mapping[str, Mapping[str, tuple[str, ...]]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    unsuccessful: tuple[UnsuccessfulRun, ...] = ()


@dataclass(frozen=True, kw_only=True)
class IndexConclusion:
    """What the gate says of one index of one detector.

    Attributes
    ----------
    detector : str
    index : Index
    conclusion : {"better", "worse", "equal", "undecided", "not measurable"}
    baseline, candidate : float, optional
        Means over the paired scenes.
    effect : float, optional
        Mean paired difference, positive is better.
    low, high : float, optional
        Its 95 % bootstrap interval.
    p : float, optional
        Holm-adjusted p of the test against the margin that the mean difference exceeds; None where it exceeds none.
    margin : float
        Differences up to this count as no difference.
    scenes : int
        Number of pairs.
    scenes_needed : int
        Pairs that a test at this level needs; 0 where there are enough.
    undefined : int
        Scenes where the index is undefined for the candidate and not for the baseline.
    seeds_share : float, optional
        Share of the variance of the mean difference that comes from the seeds, where the gate is undecided.
    """

    detector: str
    index: Index
    conclusion: Conclusion
    baseline: float | None
    candidate: float | None
    effect: float | None
    low: float | None
    high: float | None
    p: float | None
    margin: float
    scenes: int
    scenes_needed: int = 0
    undefined: int = 0
    seeds_share: float | None = None


@dataclass(frozen=True, kw_only=True)
class GateResult:
    """All conclusions of a gate.

    Attributes
    ----------
    baseline, candidate : str
        What was compared: version with commit.
    evaluator : str
        Name of the evaluator whose indices are gated.
    conclusions : tuple of IndexConclusion
    failures : tuple of str
        Runs that the candidate failed where the baseline had a result.
    level : float
    """

    baseline: str
    candidate: str
    evaluator: str
    conclusions: tuple[IndexConclusion, ...]
    failures: tuple[str, ...]
    level: float

    @property
    def exit_code(self) -> int:
        """1 for a regression, 4 when no index of quality could be measured, else 0."""
        if self.failures or any(found.conclusion == "worse" for found in self.conclusions):
            return 1
        quality = [found for found in self.conclusions if not found.index.key.startswith("cost.")]
        return 4 if all(found.conclusion == "not measurable" for found in quality) else 0


@dataclass(frozen=True, kw_only=True)
class ComparedRow:
    """One index of one detector in both stores.

    Attributes
    ----------
    detector : str
    index : Index
    first, second : float
        Means over the scenes that both stores have.
    difference : float
        Mean paired difference, second minus first.
    low, high : float, optional
        Its 95 % bootstrap interval; None for fewer than two scenes.
    scenes : int
    """

    detector: str
    index: Index
    first: float
    second: float
    difference: float
    low: float | None
    high: float | None
    scenes: int

    @property
    def conclusion(self) -> str:
        """``same`` to the last bit, ``unclear`` when the interval contains zero, else better, worse or different."""
        if self.difference == 0 and (self.low, self.high) in ((0, 0), (None, None)):
            return "same"
        if self.low is None or self.high is None or self.low <= 0 <= self.high:
            return "unclear"
        if self.index.better == "neither":
            return "different"
        return "better" if (self.difference > 0) == (self.index.better == "higher") else "worse"


@dataclass(frozen=True, kw_only=True)
class StoreComparison:
    """Two stores compared.

    Attributes
    ----------
    first, second : str
        Names of the stores.
    evaluator : str
    rows : tuple of ComparedRow
    notes : tuple of str
        What could not be compared.
    """

    first: str
    second: str
    evaluator: str
    rows: tuple[ComparedRow, ...]
    notes: tuple[str, ...]
