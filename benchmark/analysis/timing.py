"""Run time side by side: the code of a baseline's commit and the running code, alternating on one machine.

Times of another day or machine cannot be compared. Hence the old code is made available beside the new one (see
`old_code`). Where both sides would run the same code, the comparison is refused. Both sides execute the same runs
alternately (old, new, new, old, ...), each in a process of its own. The value of a scene is the ratio of the lowest
processor times; the paired test uses the logarithms of the ratios.
"""

from __future__ import annotations

import itertools
import math
import os
import statistics
import sys
from collections.abc import Mapping, Sequence

from ...core.errors import UnsupportedError
from ...core.processes import Limits
from ...evaluators.base import Index
from ..execution.isolation import IsolatedProcess
from ..execution.tasks import Task
from ..identity.recipes import PluginRecipe, SceneRecipe
from ..store.outcomes import Outcome
from .baseline import Baseline
from .inference import LEVEL, bootstrap_interval, lowest_p, scenes_needed, sign_flip_p
from .old_code import changed_detectors, restored, same_framework
from .results import Conclusion, IndexConclusion

__all__ = ["SPEED", "time_side_by_side"]

SPEED = Index(
    key="cost.cpu_ratio",
    title="CPU time ratio",
    symbol="t",
    better="lower",
    unit="ratio",
    range=(0.0, math.inf),
    meaning="processor time of the candidate divided by that of the baseline",
    source="roofbench",
)


def time_side_by_side(
    baseline: Baseline, candidate: Baseline, *, repeats: int = 3, margin: float = 0.1, level: float = LEVEL
) -> list[IndexConclusion]:
    """Return a conclusion on the run time of every detector of a baseline whose code or parameters changed.

    Parameters
    ----------
    baseline : Baseline
        Where roofbench has changed since, its commit must be in the repository of the running code.
    candidate : Baseline
        Of the running code, with detectors named as in the baseline.
    repeats : int
        Number of runs of each side on every scene; the fastest counts.
    margin : float
        Share by which the geometric mean of the ratios may differ from 1: 0.1 is 10 %.

    Raises
    ------
    UnsupportedError
        Both sides would run the same code, or the old code is not available.
    """
    changed = changed_detectors(baseline, candidate)
    scenes = [scene.recipe.absolute() for scene in baseline.scenes.values()]
    with restored(baseline, changed, framework=not same_framework(baseline, candidate)) as old_code:
        old_path = os.pathsep.join([*map(str, old_code.places), *(entry for entry in sys.path if entry)])
        old, new = IsolatedProcess(python_path=old_path), IsolatedProcess()
        try:
            conclusions = []
            for label in changed:
                # Made here, the recipe has absolute paths: the process works in another folder.
                recipe = PluginRecipe.of(candidate.detectors[label].recipe.detector())
                sides = {old: old_code.recipes[label], new: recipe}
                ratios = _log_ratios(label, scenes, sides, baseline.detectors[label].seeds[0], repeats)
                conclusions.append(_conclusion(label, ratios, margin, level))
            return conclusions
        finally:
            old.close()
            new.close()


def _log_ratios(
    label: str,
    scenes: Sequence[SceneRecipe],
    sides: Mapping[IsolatedProcess, PluginRecipe],
    seed: int,
    repeats: int,
) -> list[float]:
    """Return the logarithm of new by old processor time of every scene on which both sides ran.

    `sides` are the old and the new process, in this order, each with its recipe of the detector.

    Raises
    ------
    UnsupportedError
        A side fails on every scene.
    """
    old, new = sides
    ratios: list[float] = []
    failures: dict[str, str] = {}
    for number, scene in enumerate(scenes):
        tasks = {
            side: Task(scene=scene, detector=recipe, seed=seed, evaluators=()).to_json()
            for side, recipe in sides.items()
        }
        if number == 0:  # compilation and first reads are not measured
            for side, task in tasks.items():
                side.call(task, Limits())
        seconds: dict[IsolatedProcess, list[float]] = {old: [], new: []}
        turns = itertools.islice(itertools.cycle([old, new, new, old]), 2 * repeats)
        for side in turns:
            outcome = Outcome.from_bytes(side.call(tasks[side], Limits()))
            if outcome.status == "ok":
                seconds[side].append(outcome.cost.cpu_seconds)
            else:
                failures.setdefault("the code of the baseline" if side is old else "the new code", outcome.reason)
        if seconds[old] and seconds[new] and min(seconds[old]) > 0 and min(seconds[new]) > 0:
            ratios.append(math.log(min(seconds[new]) / min(seconds[old])))
    if failures and not ratios:
        reasons = "; ".join(f"{side}: {reason}" for side, reason in failures.items())
        raise UnsupportedError(
            f"the run time of {label} cannot be compared, since no scene ran on both sides: {reasons}"
        )
    return ratios


def _conclusion(label: str, ratios: Sequence[float], margin: float, level: float) -> IndexConclusion:
    """Return the conclusion on log ratios; positive is slower."""
    bound = math.log1p(margin)
    mean = statistics.fmean(ratios) if ratios else None
    low, high = bootstrap_interval(ratios) or (None, None)
    conclusion: Conclusion = "undecided"
    p: float | None = None
    if mean is None or low is None or high is None or lowest_p(len(ratios)) > level:
        conclusion = "not measurable"
    elif mean > bound:
        p = min(1.0, 2 * sign_flip_p([bound - ratio for ratio in ratios]))
        conclusion = "worse" if p <= level else "undecided"
    elif mean < -bound:
        p = min(1.0, 2 * sign_flip_p([ratio + bound for ratio in ratios]))
        conclusion = "better" if p <= level else "undecided"
    elif -bound <= low and high <= bound:
        conclusion = "equal"
    return IndexConclusion(
        detector=label,
        index=SPEED,
        conclusion=conclusion,
        baseline=1.0,
        candidate=None if mean is None else math.exp(mean),
        effect=None if mean is None else 1 - math.exp(mean),
        low=None if high is None else 1 - math.exp(high),
        high=None if low is None else 1 - math.exp(low),
        p=p,
        margin=margin,
        scenes=len(ratios),
        scenes_needed=scenes_needed(1, level) if conclusion == "not measurable" else 0,
    )
