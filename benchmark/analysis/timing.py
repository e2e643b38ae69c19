"""Run time side by side: the code of a baseline's commit and the running code, alternating on one machine.

Times of another day or machine cannot be compared. Hence the old code is made available beside the new one: roofbench
by the baseline's commit where it has changed, plugins by the sources that the baseline keeps. Where both sides would
run the same code, the comparison is refused. Both sides execute the same runs alternately (old, new, new, old, ...),
each in a process of its own. The value of a scene is the ratio of the lowest processor times; the paired test uses the
logarithms of the ratios.
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
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

from ...core.errors import UnsupportedError
from ...core.package import FOLDER, NAME
from ...core.processes import Limits
from ...evaluators.base import Index
from ..execution.isolation import IsolatedProcess
from ..execution.tasks import Task
from ..identity.recipes import PluginRecipe
from ..store.outcomes import Outcome
from .baseline import Baseline, BaselineScene, Measured
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
    changed = _changed(baseline, candidate)
    with tempfile.TemporaryDirectory(prefix="roofbench-") as name:
        folder = Path(name)
        recipes = {label: _old_recipe(label, baseline.detectors[label], folder) for label in changed}
        unchanged = _same_framework(baseline, candidate)
        framework: AbstractContextManager[Path | None] = (
            nullcontext(None) if unchanged else _unpacked(baseline.version.commit)
        )
        with framework as old_roofbench:
            places = [place for place in (folder / "packages", old_roofbench) if place is not None]
            old_path = os.pathsep.join([*map(str, places), *(entry for entry in sys.path if entry)])
            old, new = IsolatedProcess(python_path=old_path), IsolatedProcess()
            try:
                conclusions = []
                for label in changed:
                    sides = {old: recipes[label], new: candidate.detectors[label].recipe}
                    seed = baseline.detectors[label].seeds[0]
                    ratios = _log_ratios(label, list(baseline.scenes.values()), sides, seed, repeats)
                    conclusions.append(_conclusion(label, ratios, margin, level))
                return conclusions
            finally:
                old.close()
                new.close()


def _changed(baseline: Baseline, candidate: Baseline) -> list[str]:
    """Return the detectors whose code or parameters differ between the sides, or refuse where none does."""
    changed = []
    for label, before in baseline.detectors.items():
        after = candidate.detectors[label]
        if before.code is None or after.code is None:
            raise UnsupportedError(
                f"the baseline does not say which code of {label} it measured, as those of version 0.1 do not: save it "
                "again, or leave out time=True"
            )
        if before.code.fingerprint or after.code.fingerprint:
            raise UnsupportedError(
                f"{label} runs a program or reads a file, of which the baseline keeps no copy: its run time cannot be "
                "compared side by side; leave out time=True"
            )
        if (before.code.digest, before.recipe.parameters) != (after.code.digest, after.recipe.parameters):
            changed.append(label)
    if not changed:
        codes = ", ".join(
            f"{label} {found.code.digest[:10]}" for label, found in baseline.detectors.items() if found.code
        )
        raise UnsupportedError(
            f"both sides would run the same code ({codes}), so there is no run time to compare: leave out time=True"
        )
    return changed


def _same_framework(baseline: Baseline, candidate: Baseline) -> bool:
    """Return whether all detectors depend on the same modules of roofbench on both sides."""
    codes = ((found.code, candidate.detectors[label].code) for label, found in baseline.detectors.items())
    return all(old is not None and new is not None and old.framework == new.framework for old, new in codes)


def _old_recipe(label: str, measured: Measured, folder: Path) -> PluginRecipe:
    """Return the recipe of a detector as it was; the kept sources of a plugin are written below `folder`."""
    code, recipe = measured.code, measured.recipe
    if code is None or not code.plugin:
        return recipe
    if not code.sources:
        raise UnsupportedError(f"the baseline keeps no source of {label}: save it again, or leave out time=True")
    path, colon, name = recipe.use.rpartition(":")
    if not path.endswith(".py"):
        code.unpack(folder / "packages")
        return recipe
    place = folder / f"plugin-{len(list(folder.iterdir()))}"
    code.unpack(place)
    return replace(recipe, use=f"{place / Path(path).name}{colon}{name}")


@contextmanager
def _unpacked(commit: str | None) -> Iterator[Path]:
    """Yield a folder that holds the package as it was at a commit."""
    if commit is None:
        raise UnsupportedError(
            "the baseline names no commit, and roofbench itself has changed since: its old code is not available; save "
            "the baseline again, or leave out time=True"
        )
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
        if not (target / Path(*__package__.split(".")[1:-1]) / "execution" / "isolation.py").is_file():
            raise UnsupportedError(
                f"the commit {commit[:10]} of the baseline is older than the present layout and cannot run beside it: "
                "save the baseline again, or leave out time=True"
            )
        yield Path(name)


def _log_ratios(
    label: str,
    scenes: Sequence[BaselineScene],
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
            side: Task(scene=scene.recipe, detector=recipe, seed=seed, evaluators=()).to_json()
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
