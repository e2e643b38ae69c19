"""Running from Python: `run` and `detect`."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..detectors.base import Detector
from ..detectors.registry import make_detector
from ..evaluators.base import Evaluator
from ..evaluators.registry import make_evaluator
from ..scenes.geodata.footprints import Footprints
from ..scenes.scene import Scene
from .analysis.leaderboard import make_leaderboard
from .analysis.results import Leaderboard
from .execution.executors import Execution
from .execution.runner import run_plan
from .execution.worker import detect as _detect
from .identity.recipes import SceneRecipe
from .plan import Rerun, make_plan
from .store.writer import Store
from .suite import DetectorEntry, Suite, scenes_of, suite_of_scenes, suite_of_words

__all__ = ["detect", "run"]


def detect(scene: Scene | str | Path, detector: str | Detector, *, seed: int = 0, **parameters: Any) -> Footprints:
    """Return the footprints that a detector finds on a scene.

    Parameters
    ----------
    scene : Scene, path or str
        A scene, a scene folder, a scene that comes with roofbench (``"delft"``), or a preset such as
        ``"knox-small[seed=3]"``.
    detector : str or Detector
        Name, ``name[parameter=value]``, ``file.py:Class``, or a detector.
    seed : int
        Of the random stream of a stochastic detector.
    **parameters
        Parameters of the detector.

    Raises
    ------
    UnknownNameError, ParameterError
        No such detector or parameter.
    MissingInputError
        The scene lacks what the detector requires.
    InputError
        The detector returned what is no set of footprints of this scene.
    """
    chosen = make_detector(detector, parameters)
    if isinstance(scene, Scene):
        return _detect(scene, chosen, seed=seed)
    (recipe,) = scenes_of([str(scene)])
    return _detect(recipe.open(), chosen, seed=seed, name=recipe.name)


def run(
    scenes: str | Suite | Iterable[Scene | str | Path] = "quick",
    detectors: Iterable[str | Detector] | None = None,
    *,
    evaluator: str | Evaluator | None = None,
    seeds: int | Sequence[int] = 1,
    store: str | Path | None = None,
    jobs: int | Execution = 0,
    index: str | None = None,
    rerun: Rerun = "missing",
) -> Leaderboard:
    """Run every detector on every scene and return the leaderboard.

    Parameters
    ----------
    scenes : str, Suite, or iterable of Scene, path or str
        A suite by its name or TOML file; or scene objects, scene folders, names of scenes that come with roofbench
        and presets such as ``"knox-small[seed=3]"``.
    detectors : iterable of str or Detector, optional
        By default those of the suite, or every detector that needs no parameter.
    evaluator : str or Evaluator, optional
        By default the first of the suite.
    seeds : int or sequence of int
        Seeds of the random streams of stochastic detectors that are given by `detectors`.
    store : path, optional
        Results store, whose results are reused; without one nothing is kept.
    jobs : int or Execution
        Worker processes; 0 runs in this process, for detectors defined at a prompt. An `Execution` sets limits of
        time and memory and a scheduler as well.
    index : str, optional
        Key of the index that ranks, by default that of the evaluator.
    rerun : {"missing", "never", "always"}
        ``missing`` runs what has no good result, ``never`` only what is not stored at all, ``always`` everything.
    """
    suite = _suite(scenes)
    if detectors is not None:
        numbers = tuple(range(seeds)) if isinstance(seeds, int) else tuple(seeds)
        entries = tuple(DetectorEntry(make_detector(detector), numbers) for detector in detectors)
        suite = replace(suite, detectors=entries)
    if evaluator is not None:
        suite = replace(suite, evaluators=(make_evaluator(evaluator),))
    execution = jobs if isinstance(jobs, Execution) else Execution(jobs=jobs)
    with tempfile.TemporaryDirectory(prefix="roofbench-") as folder:
        path = Path(folder) / "roofbench.sqlite" if store is None else Path(store)
        with Store(path) as opened:
            plan = make_plan(suite, opened, rerun=rerun)
            result = run_plan(plan, opened, execution=execution)
            return make_leaderboard(result.rows, opened, plan.evaluators[0], title="Leaderboard", rank_by=index)


def _suite(scenes: str | Suite | Iterable[Scene | str | Path]) -> Suite:
    """Return the suite that `scenes` names, or one of these scenes with all detectors."""
    if isinstance(scenes, Suite):
        return scenes
    if isinstance(scenes, str):
        return suite_of_words([scenes])
    found: list[SceneRecipe | Scene] = []
    for scene in scenes:
        found += [scene] if isinstance(scene, Scene) else scenes_of([str(scene)])
    return suite_of_scenes(found, name="run")
