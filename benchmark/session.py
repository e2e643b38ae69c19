"""Running from Python: `run` and `detect`."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
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
from .execution.isolation import Limits
from .execution.runner import Execution, run_plan
from .execution.worker import detect as _detect
from .identity.recipes import SceneRecipe
from .plan import Overwrite, make_plan
from .store.writer import Store
from .suite import DetectorEntry, Suite, scenes_of

__all__ = ["detect", "run"]


def detect(scene: Scene, detector: str | Detector, *, seed: int = 0, **parameters: Any) -> Footprints:
    """Return the footprints that a detector finds on a scene.

    Parameters
    ----------
    scene : Scene
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
    return _detect(scene, make_detector(detector, parameters), seed=seed)


def run(
    *,
    scenes: Iterable[Scene | str | Path],
    detectors: Iterable[str | Detector],
    evaluator: str | Evaluator = "threshold-free",
    seeds: int | Sequence[int] = 1,
    store: str | Path | None = None,
    jobs: int = 0,
    limits: Limits | None = None,
    overwrite: Overwrite = "missing",
    rank_by: str | None = None,
) -> Leaderboard:
    """Run every detector on every scene and return the leaderboard.

    Parameters
    ----------
    scenes : iterable of Scene, path or str
        Scene objects, scene folders, or presets such as ``"knox-small[seed=3]"``.
    detectors : iterable of str or Detector
    evaluator : str or Evaluator
    seeds : int or sequence of int
        Seeds of the random streams of stochastic detectors.
    store : path, optional
        Results store, in which what is there is not computed again; nothing is kept without one.
    jobs : int
        Worker processes; 0 runs in this process, for detectors defined at a prompt.
    limits : Limits, optional
        Time and memory of each run; needs ``jobs`` of at least 1.
    overwrite : {"missing", "never", "always"}
    rank_by : str, optional
        Index key, by default the evaluator's quality.
    """
    numbers = tuple(range(seeds)) if isinstance(seeds, int) else tuple(seeds)
    recipes: list[SceneRecipe | Scene] = []
    for scene in scenes:
        recipes += [scene] if isinstance(scene, Scene) else scenes_of([str(scene)])
    suite = Suite(
        "run",
        tuple(recipes),
        tuple(DetectorEntry(make_detector(detector), numbers) for detector in detectors),
        (make_evaluator(evaluator),),
    )
    with tempfile.TemporaryDirectory(prefix="roofbench-") as folder:
        path = Path(folder) / "roofbench.sqlite" if store is None else Path(store)
        with Store(path) as opened:
            plan = make_plan(suite, opened, overwrite=overwrite)
            execution = Execution(jobs=jobs, limits=limits or Limits())
            result = run_plan(plan, opened, execution=execution, overwrite=overwrite)
            return make_leaderboard(result.rows, opened, plan.evaluators[0], title="Leaderboard", rank_by=rank_by)
