"""The runner: executes a plan and stores every outcome in a transaction of its own."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from ...scenes.scene import Scene
from ..identity.provenance import code_version
from ..identity.recipes import PluginRecipe, SceneRecipe
from ..identity.spool import spool
from ..plan import KeyedEvaluator, Plan, PlannedRun, scene_recipe
from ..store.outcomes import Outcome, Score
from ..store.records import RunRow
from ..store.writer import Store
from .city_runs import forget_tiles, is_city_run, run_city
from .dispatch import Dispatcher
from .executors import Execution, Slot, slots_of
from .isolation import call_isolated
from .tasks import Task
from .worker import execute, score

__all__ = ["RunResult", "run_plan", "score_missing", "score_stored"]


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """The result of a plan: rows of the store, in the plan's order.

    Attributes
    ----------
    rows : tuple of RunRow
        Every run of the plan that is stored, executed now or before.
    done : int
        Number of runs that were executed now.
    evaluated : int
        Number of evaluations of stored runs that were added now.
    """

    rows: tuple[RunRow, ...]
    done: int
    evaluated: int

    @property
    def failed(self) -> tuple[RunRow, ...]:
        """The failed runs."""
        return tuple(row for row in self.rows if row.status == "failed")

    @property
    def skipped(self) -> tuple[RunRow, ...]:
        """The skipped runs."""
        return tuple(row for row in self.rows if row.status == "skipped")

    @property
    def ok(self) -> tuple[RunRow, ...]:
        """The good runs."""
        return tuple(row for row in self.rows if row.status == "ok")


def run_plan(
    plan: Plan,
    store: Store,
    *,
    execution: Execution | None = None,
    progress: Callable[[PlannedRun, Outcome], None] | None = None,
) -> RunResult:
    """Execute what the plan lacks and return its stored runs.

    Parameters
    ----------
    plan : Plan
    store : Store
    execution : Execution, optional
        One worker process by default.
    progress : callable, optional
        Called with every finished run and its outcome.
    """
    execution = execution or Execution()
    version = str(code_version())
    evaluated = 0
    for run in plan.runs:
        if run.todo == "evaluate":
            assert run.stored is not None
            evaluated += score_stored(store, run.stored, run.missing)
    waiting = [run for run in plan.runs if run.todo == "detect"]
    done = 0
    for run, outcome in _every_outcome(waiting, plan, store, execution):
        store.record(run.identity, outcome, version=version, replace=plan.rerun == "always")
        if is_city_run(run) and outcome.status != "failed":
            forget_tiles(run, store.path)
        done += 1
        if progress is not None:
            progress(run, outcome)
    stored = store.runs_of(plan.keys)
    rows = tuple(stored[key] for key in plan.keys if key in stored)
    return RunResult(rows=rows, done=done, evaluated=evaluated)


def score_missing(store: Store, rows: Sequence[RunRow], evaluators: Sequence[KeyedEvaluator]) -> list[int]:
    """Evaluate the good runs among these that lack an evaluation; return the numbers of the good runs."""
    good = [row.id for row in rows if row.status == "ok"]
    for keyed in evaluators:
        known = store.evaluated(good, keyed.key)
        for run_id in good:
            if run_id not in known:
                score_stored(store, run_id, (keyed,))
    return good


def score_stored(store: Store, run_id: int, evaluators: tuple[KeyedEvaluator, ...]) -> int:
    """Evaluate stored detections by further evaluators, without detecting again and without opening the scene.

    Returns the number of added evaluations: none for a scene without reference. An evaluator that fails is stored as a
    failure, and the others continue.
    """
    scene = store.scene(store.run(run_id).scene_id)
    if scene.reference is None:
        return 0
    detected, added = store.detections(run_id), 0
    for keyed in evaluators:
        result = score(
            detected, scene.reference, keyed.recipe, keyed.code, keyed.evaluator, area=scene.area, grid=scene.grid
        )
        if isinstance(result, Score):
            store.add_score(run_id, result)
            added += 1
        else:
            store.add_score_failure(run_id, result)
    return added


def _every_outcome(
    runs: list[PlannedRun], plan: Plan, store: Store, execution: Execution
) -> Iterator[tuple[PlannedRun, Outcome]]:
    """Yield the outcomes of runs on single scenes as they arrive, then those on cities, one after the other."""
    yield from _outcomes([run for run in runs if not is_city_run(run)], plan, store, execution)
    evaluators = [keyed.evaluator for keyed in plan.evaluators]
    for run in runs:
        if not is_city_run(run) or (plan.rerun != "always" and _is_stored(store, run)):
            continue
        if plan.rerun == "always":
            forget_tiles(run, store.path)
        task = _task(run, scene_recipe(run.scene), plan, store.described_scenes())
        yield run, run_city(run, task, evaluators, execution, store.path)


def _task(run: PlannedRun, scene: SceneRecipe, plan: Plan, described: Collection[str]) -> Task:
    return Task(
        scene=scene,
        detector=run.identity.detector,
        seed=run.identity.seed,
        evaluators=tuple(keyed.recipe for keyed in plan.evaluators),
        codes=tuple(keyed.code for keyed in plan.evaluators),
        describe_scene=run.identity.scene_key not in described,
    )


def _outcomes(
    runs: list[PlannedRun], plan: Plan, store: Store, execution: Execution
) -> Iterator[tuple[PlannedRun, Outcome]]:
    """Yield outcomes as they arrive; runs that another process stored in the meantime are left out."""
    if not runs:
        return
    described = store.described_scenes()
    with ExitStack() as stack:
        slots = stack.enter_context(slots_of(execution.jobs, execution.scheduler, len(runs)))
        elsewhere = execution.jobs > 0 or execution.scheduler is not None
        scenes = _Scenes(stack, elsewhere=elsewhere)
        dispatcher, flying = Dispatcher(runs), dict[Future[bytes], tuple[PlannedRun, Slot]]()
        free = [slot for turn in range(max(slot.capacity for slot in slots)) for slot in slots if turn < slot.capacity]
        while True:
            while free and (run := dispatcher.next_for(free[0])) is not None:
                if plan.rerun != "always" and _is_stored(store, run):
                    continue
                task = _task(run, scenes.recipe(run.scene), plan, described)
                slot = free.pop(0)
                if elsewhere:
                    _must_be_portable(run)
                    future = slot.executor.submit(call_isolated, task.to_json(), execution.limits)
                else:
                    future = slot.executor.submit(_in_process, run, task, plan)
                flying[future] = run, slot
            if not flying:
                return
            finished, _ = wait(flying, return_when=FIRST_COMPLETED)
            for future in finished:
                run, slot = flying.pop(future)
                free.append(slot)
                outcome = _outcome(future)
                if outcome.scene is not None:
                    described.add(run.identity.scene_key)
                yield run, outcome


def _in_process(run: PlannedRun, task: Task, plan: Plan) -> bytes:
    scene = run.scene if isinstance(run.scene, Scene) else None
    evaluators = [keyed.evaluator for keyed in plan.evaluators]
    return execute(task, scene=scene, detector=run.entry.detector, evaluators=evaluators).to_bytes()


def _outcome(future: Future[bytes]) -> Outcome:
    """Return the outcome of a future; an error of the executor itself is a failure of that run."""
    try:
        return Outcome.from_bytes(future.result())
    except Exception as error:
        return Outcome(status="failed", reason=f"the executor failed: {type(error).__name__}: {error}")


def _is_stored(store: Store, run: PlannedRun) -> bool:
    found = store.statuses([run.identity.key]).get(run.identity.key)
    return found is not None and found[1] != "failed"


def _must_be_portable(run: PlannedRun) -> None:
    if run.identity.detector.use.startswith("(this process)"):
        PluginRecipe.of(run.entry.detector)  # raises with the remedy


class _Scenes:
    """Recipes that workers can open; each scene object of this process is written to a file once."""

    def __init__(self, stack: ExitStack, *, elsewhere: bool) -> None:
        self._stack = stack
        self._elsewhere = elsewhere
        self._folder: Path | None = None
        self._spooled: dict[int, SceneRecipe] = {}

    def recipe(self, scene: SceneRecipe | Scene) -> SceneRecipe:
        if not isinstance(scene, Scene) or not self._elsewhere:
            return scene_recipe(scene)
        if id(scene) not in self._spooled:
            if self._folder is None:
                self._folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="roofbench-")))
            self._spooled[id(scene)] = SceneRecipe.of_scene(scene, spooled=spool(scene, self._folder))
        return replace(self._spooled[id(scene)], name=scene.name)
