"""Runs on cities: a suite may hold scenes that are detected tile by tile.

All workers compute tiles of one run, then one process on this machine joins and evaluates them. Finished tiles lie in
a work folder beside the store, ``STORE.tiles``, until the run is stored: a run that was killed goes on with the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from ...core.errors import OutputError, RoofbenchError
from ...detectors.external.precomputed import Precomputed
from ...evaluators.base import Evaluator
from ...scenes.scene import Scene
from ..plan import PlannedRun, scene_recipe
from ..store.outcomes import Outcome
from .city import City, TileWork, plan_tiles, remove_tiles, run_tiles, work_key
from .executors import Execution, slots_of
from .isolation import call_isolated
from .run_time import reason_of
from .tasks import Task
from .worker import execute, machine_facts

__all__ = ["forget_tiles", "is_city_run", "run_city"]


def is_city_run(run: PlannedRun) -> bool:
    """Return whether a run is computed tile by tile by all workers: on a city, by a detector that others can make.

    Footprints made elsewhere are read whole.
    """
    use = run.identity.detector.use
    in_tiles = use != Precomputed.name and not use.startswith("(this process)")
    return not isinstance(run.scene, Scene) and run.scene.tile > 0 and in_tiles


def run_city(
    run: PlannedRun, task: Task, evaluators: Sequence[Evaluator], execution: Execution, store: Path
) -> Outcome:
    """Compute the tiles that are not finished, join and evaluate them; failures are outcomes, too.

    Parameters
    ----------
    run : PlannedRun
    task : Task
        On the whole city.
    evaluators : sequence of Evaluator
        Those of the task, for runs in this process.
    execution : Execution
    store : Path
        File of the store, beside which finished tiles are kept.
    """
    detector = run.entry.detector
    try:
        work = plan_tiles(task.scene, detector, _made(_folder(run, store)), _city(run))
    except (RoofbenchError, OSError) as error:
        return Outcome(status="failed", reason=reason_of(error), machine=machine_facts())
    failed = run_tiles(work, execution)
    if failed:
        tile, reason = next(iter(sorted(failed.items())))
        of = f"{len(failed)} of {len(work.jobs)} tiles failed, the first at {tile.label}"
        sentence = f"{of}: {reason}; the others are kept, and the same command computes these alone"
        return Outcome(status="failed", reason=sentence, machine=machine_facts())
    return _joined(work, task, evaluators, execution)


def _joined(work: TileWork, task: Task, evaluators: Sequence[Evaluator], execution: Execution) -> Outcome:
    """Return the outcome of a city whose tiles are all finished."""
    whole = replace(task, tiles=tuple(str(job.file.absolute()) for job in work.jobs))
    if execution.jobs == 0 and execution.scheduler is None:
        return execute(whole, evaluators=evaluators)
    with slots_of(1, None, 1) as (slot,):
        future = slot.executor.submit(call_isolated, whole.to_json(), execution.limits)
        try:
            return Outcome.from_bytes(future.result())
        except Exception as error:
            return Outcome(status="failed", reason=f"the executor failed: {type(error).__name__}: {error}")


def forget_tiles(run: PlannedRun, store: Path) -> None:
    """Remove the finished tiles of a run."""
    folder = _folder(run, store)
    if folder.is_dir():
        remove_tiles(folder)
    with suppress(OSError):
        folder.parent.rmdir()  # while it holds those of other runs it stays


def _city(run: PlannedRun) -> City:
    return City(tile=scene_recipe(run.scene).tile, seed=run.identity.seed)


def _folder(run: PlannedRun, store: Path) -> Path:
    """Return the work folder of a run; it does not depend on the files of the scene, of which some may be repaired."""
    key = work_key(scene_recipe(run.scene), run.entry.detector, _city(run))
    return store.with_name(f"{store.name}.tiles") / f"{key[:16]}-{run.identity.seed}"


def _made(folder: Path) -> Path:
    try:
        folder.parent.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder.parent} cannot be made: {error.strerror}") from error
    return folder
