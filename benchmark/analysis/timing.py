"""Run time side by side: the code of a baseline's commit and the running code, alternating on one machine.

Times of another day or machine cannot be compared. Hence the baseline's commit is unpacked beside the working tree,
and both execute the same runs alternately (old, new, new, old, ...), each in a process of its own. The value of a scene
is the ratio of the lowest processor times; the paired test uses the logarithms of the ratios.
"""

from __future__ import annotations

import itertools
import math
import os
import statistics
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ...core.errors import UnsupportedError
from ...core.package import FOLDER, NAME
from ...evaluators.base import Index
from ..execution.isolation import IsolatedProcess, Limits
from ..execution.tasks import Task
from ..store.outcomes import Outcome
from .baseline import Baseline
from .inference import LEVEL, bootstrap_interval, lowest_p, scenes_needed, sign_flip_p
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
    """Return a conclusion on the run time of every detector of a baseline.

    Parameters
    ----------
    baseline : Baseline
        Its commit must be in the repository of the running code.
    candidate : Baseline
        Of the running code, with detectors named as in the baseline.
    repeats : int
        Number of runs of each side on every scene; the fastest counts.
    margin : float
        Share by which the geometric mean of the ratios may differ from 1: 0.1 is 10 %.

    Raises
    ------
    UnsupportedError
        The baseline names no commit, or the running code is no git checkout with that commit.
    """
    with _unpacked(baseline.version.commit) as folder:
        old_path = os.pathsep.join([str(folder), *(entry for entry in sys.path if entry)])
        old, new = IsolatedProcess(python_path=old_path), IsolatedProcess()
        try:
            return [
                _conclusion(label, _log_ratios(baseline, candidate, label, old, new, repeats), margin, level)
                for label in baseline.detectors
            ]
        finally:
            old.close()
            new.close()


@contextmanager
def _unpacked(commit: str | None) -> Iterator[Path]:
    """Yield a folder that holds the package as it was at a commit."""
    if commit is None:
        raise UnsupportedError("the baseline names no commit: run time can be compared only within a git repository")
    with tempfile.TemporaryDirectory(prefix="roofbench-") as name:
        archive, target = Path(name) / "code.tar", Path(name) / NAME
        command = ["git", "-C", str(FOLDER), "archive", "--format=tar", "-o", str(archive), commit]
        try:
            subprocess.run(command, check=True, capture_output=True, timeout=60)  # noqa: S603 - a list, no shell
        except (OSError, subprocess.SubprocessError) as error:
            raise UnsupportedError(
                f"the commit {commit[:10]} of the baseline is not in this repository: fetch it (in CI, a checkout "
                "with its whole history), or leave out time=True"
            ) from error
        with tarfile.open(archive) as packed:
            packed.extractall(target, filter="data")
        yield Path(name)


def _log_ratios(
    baseline: Baseline, candidate: Baseline, label: str, old: IsolatedProcess, new: IsolatedProcess, repeats: int
) -> list[float]:
    """Return the logarithm of new by old processor time of every scene on which both sides ran."""
    sides = {old: baseline.detectors[label], new: candidate.detectors[label]}
    ratios = []
    for number, scene in enumerate(baseline.scenes.values()):
        tasks = {
            side: Task(scene=scene.recipe, detector=found.recipe, seed=found.seeds[0], evaluators=()).to_json()
            for side, found in sides.items()
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
        if seconds[old] and seconds[new] and min(seconds[old]) > 0 and min(seconds[new]) > 0:
            ratios.append(math.log(min(seconds[new]) / min(seconds[old])))
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
