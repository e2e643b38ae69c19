"""The worker: runs one task in the calling process, and returns failures as outcomes instead of raising them."""

from __future__ import annotations

import dataclasses
import os
import platform
import tempfile
import traceback
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely import Geometry

from ...core.errors import InputError, MissingInputError, UnsupportedError
from ...core.memory import reset_highest_memory
from ...core.plain_values import plain_value
from ...core.wording import counted
from ...detectors.base import Declaration, Detector
from ...detectors.checks import checked_output
from ...detectors.external.precomputed import Precomputed
from ...detectors.seams import join_tiles
from ...detectors.streams import random_stream
from ...detectors.tiling import Tile, measure, owned, stream_of, tiles_of
from ...evaluators.base import Evaluator
from ...evaluators.in_parts import ThresholdFree, evaluate_sets
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.raster import Grid
from ...scenes.scene import Scene
from ..identity.recipes import PluginRecipe, SceneRecipe, code_digest
from ..store.outcomes import Cost, Outcome, SceneRecord, Score, ScoreFailure
from .detection import detect_on
from .detector_process import DetectionFailedError, DetectorProcess, DetectorProcesses
from .read_ahead import ReadAhead
from .run_time import Stopwatch, reason_of
from .scene_picture import scene_picture
from .tasks import Task, TilePart
from .tile_outcomes import stored_parts, survey_tiles, tile_of_file

__all__ = ["describe", "detect", "execute", "execute_text", "machine_facts", "score"]

#: The scenes opened last; consecutive tasks of a plan often use the same scene.
_scenes: OrderedDict[str, Scene] = OrderedDict()
_KEPT_SCENES = 2
#: The window that is read while another one is computed.
_ahead = ReadAhead()
#: Footprints of a set from which on two sets are compared in parts, and those of one part.
_MANY, _PART = 200_000, 100_000


def detect(
    scene: Scene,
    detector: Detector,
    *,
    seed: int = 0,
    stream: np.random.Generator | None = None,
    name: str | None = None,
) -> Footprints:
    """Return a detector's checked footprints on a scene; the random stream follows from seed, scene and detector.

    A part of a scene has a `stream` of its own. `name` is that of the scene in tables, which that of the scene itself
    may differ from: ``knox-1[tree_density=10]``. The detector runs in this process.
    """
    scene.require(detector.requires)
    if type(detector) is Precomputed:  # no subclass: a plugin must not learn the name
        found = detector.footprints_of(name or scene.name, scene.crs)
        facts: Mapping[str, Any] = found.metadata
    else:
        visible = scene.for_detection()
        rng = random_stream(seed, scene.name, detector.name) if stream is None else stream
        found, facts = detect_on(detector, visible, rng)
    found = checked_output(found, scene, detector.name)
    # What was estimated for lack of a DEM goes where the footprints go: to the screen, the store, the caller.
    return dataclasses.replace(found, metadata=facts)


class _Here:
    """A detector that runs in this process."""

    def __init__(self, detector: Detector, name: str | None = None) -> None:
        self.detector, self.declaration, self._name = detector, Declaration.of(detector), name

    def detect(self, scene: Scene, stream: np.random.Generator) -> tuple[Footprints, Cost]:
        watch = Stopwatch.start()
        found = detect(scene, self.detector, stream=stream, name=self._name)
        return found, Cost(**watch.read())


class _Apart:
    """A detector that runs in a detector process, where alone its code is imported."""

    def __init__(self, process: DetectorProcess, recipe: PluginRecipe) -> None:
        self._process, self._recipe, self.declaration = process, recipe, process.declaration(recipe)

    def detect(self, scene: Scene, stream: np.random.Generator) -> tuple[Footprints, Cost]:
        found, cost = self._process.detect(self._recipe, scene, stream)
        return checked_output(found, scene, self.declaration.name), cost


def _runs_here(task: Task) -> bool:
    """Return whether a task is run in the process that opens scenes.

    Footprints made elsewhere are found by the name of the scene, and read whole. A city that is one task is timed by
    the gate and not evaluated.
    """
    return task.detector.use == Precomputed.name or (task.scene.tile > 0 and task.part is None and not task.tiles)


def execute_text(
    task: str, *, detected: Callable[[bytes], None] | None = None, apart: DetectorProcesses | None = None
) -> bytes:
    """Run a task given as text, the form in which tasks are sent between processes; see `execute`."""

    def forward(outcome: Outcome) -> None:
        if detected is not None:
            detected(outcome.to_bytes())

    return execute(Task.from_json(task), detected=forward, apart=apart).to_bytes()


def execute(
    task: Task,
    *,
    scene: Scene | None = None,
    detector: Detector | None = None,
    evaluators: Sequence[Evaluator] | None = None,
    detected: Callable[[Outcome], None] | None = None,
    apart: DetectorProcesses | None = None,
) -> Outcome:
    """Run a task; a failure or a skip is an outcome, too.

    Parameters
    ----------
    task : Task
    scene, detector, evaluators : optional
        The objects themselves, where task and caller share a process.
    detected : callable, optional
        Called with the outcome as it is before the evaluation, so that a crash of an evaluator loses no detection.
    apart : DetectorProcesses, optional
        Where the detector runs, which must not share a process with the reference; by default in this process. A city
        that is one task, timed by the gate and not evaluated, is always detected in this process.
    """
    watch = Stopwatch.start()
    reset_highest_memory()  # a limit applies to this run, not to earlier ones
    record = None
    try:
        scene = scene if scene is not None else _opened(task.scene)
        runs: _Here | _Apart
        if detector is not None or apart is None or _runs_here(task):
            runs = _Here(detector if detector is not None else task.detector.detector(), task.scene.name)
        else:
            runs = _Apart(apart.of(task.detector), task.detector)
        if evaluators is None:
            evaluators = [recipe.evaluator() for recipe in task.evaluators]
        if task.part is None:
            _refuse_incomplete(scene)
        elif task.detector.use == Precomputed.name:
            raise UnsupportedError("precomputed footprints are those of a whole scene: detect without tiles")
        is_city = task.part is None and task.scene.tile > 0
        record = describe(scene, is_city=is_city) if task.describe_scene else None
        whole = scene
        if task.part is not None:
            scene = _ahead.take(_window_key(task.scene, task.part)) or _window(scene, task.part)
        if not is_city:
            scene.require(runs.declaration.requires)
            scene.for_detection()  # reads all inputs: the time of a detector is that of detection in memory
            if task.part is None:
                reset_highest_memory()  # that of a tile includes its reading
        if task.part is not None and task.ahead is not None:
            _read_ahead(whole, task.scene, dataclasses.replace(task.part, tile=task.ahead))
        watch = Stopwatch.start()
        if is_city and task.tiles:
            found, cost = _joined_city(scene, runs.declaration, task)
        elif is_city and task.detector.use != Precomputed.name:
            assert isinstance(runs, _Here)
            found, cost = _detect_city(scene, runs.detector, task.seed, task.scene.tile), Cost(**watch.read())
        elif task.part is None:
            found, cost = runs.detect(scene, random_stream(task.seed, scene.name, runs.declaration.name))
        else:
            found, cost = _detect_part(scene, runs, task.seed, task.part, whole.extent)
        codes = task.codes or [code_digest(evaluator) for evaluator in evaluators]
    except MissingInputError as error:  # the scene lacks an input, or this machine a program
        return Outcome(status="skipped", reason=reason_of(error), scene=record, machine=machine_facts())
    except DetectionFailedError as error:
        machine = {} if error.process_ended else machine_facts()
        return Outcome(status="failed", reason=str(error), traceback=error.trace, cost=error.cost, machine=machine)
    except Exception as error:
        return Outcome(
            status="failed",
            reason=reason_of(error),
            traceback=traceback.format_exc(),
            cost=Cost(**watch.read()),
            machine=machine_facts(),
        )
    outcome = Outcome(
        status="ok",
        cost=cost,
        detections=tuple(shapely.to_wkb(found.polygons).tolist()),
        attributes={name: [plain_value(value) for value in column] for name, column in found.attributes.items()},
        metadata={**found.metadata, **({"repairs": [str(r) for r in found.repairs]} if found.repairs else {})},
        scene=record,
        machine=machine_facts(),
    )
    if scene.reference is None or not evaluators:
        return outcome
    if detected is not None:
        detected(outcome)
    grid = None if is_city else scene.evaluation_grid
    results = [
        score(found, scene.reference, recipe, code, evaluator, area=scene.area, grid=grid)
        for recipe, code, evaluator in zip(task.evaluators, codes, evaluators, strict=True)
    ]
    return dataclasses.replace(
        outcome,
        scores=tuple(result for result in results if isinstance(result, Score)),
        score_failures=tuple(result for result in results if isinstance(result, ScoreFailure)),
    )


def _refuse_incomplete(scene: Scene) -> None:
    """Refuse to score a scene of which files are missing: their buildings would count as not detected."""
    if scene.left_out:
        files = counted(len(scene.left_out), "file is", "files are")
        raise InputError(
            f"{files} not part of the scene, first {scene.left_out[0]}; repair or remove what is left out, "
            "and index the folder again"
        )


def _window_key(recipe: SceneRecipe, part: TilePart) -> str:
    return repr((recipe, recipe.written, part))


def _read_ahead(scene: Scene, recipe: SceneRecipe, part: TilePart) -> None:
    """Begin to read the window of the tile that comes next."""

    def read() -> Scene:
        window = _window(scene, part)
        window.for_detection()
        return window

    _ahead.start(_window_key(recipe, part), read)


def _joined_city(scene: Scene, detector: Declaration, task: Task) -> tuple[Footprints, Cost]:
    """Return the city of stored tiles, and what they cost."""
    files = {tile_of_file(Path(file), task.scene.tile): Path(file) for file in task.tiles}
    survey = survey_tiles(files)
    if len(survey.skipped) == len(files):
        raise MissingInputError(next(iter(survey.skipped.values())))
    parts = dict(stored_parts(files))
    found, _ = join_tiles(parts, crs=scene.crs, numbers=detector.numbers, source=detector.name)
    cues = dict.fromkeys(cue for used in survey.cues for cue in used.split(", "))
    facts = {"cues": list(cues), "notes": list(survey.notes)}
    metadata = {name: texts for name, texts in facts.items() if texts}
    return dataclasses.replace(found, metadata=metadata), survey.cost


def _window(scene: Scene, part: TilePart) -> Scene:
    window = scene.window(part.tile.core, part.halo)
    window.ground_cell, window.whole = part.measured.ground_cell, part.measured.whole
    return window


def _detect_city(scene: Scene, detector: Detector, seed: int, side: float) -> Footprints:
    """Return what a detector finds on a scene tile by tile, one tile in memory at a time."""
    tiles = tiles_of(scene, side, detector.halo)
    measured = measure(scene, detector, tiles)
    fixed = detector.replaced(measured.parameters)
    parts: dict[Tile, Footprints] = {}
    lacking = ""
    for tile in tiles:
        part = TilePart(tile=tile, halo=detector.halo, measured=measured)
        window = _window(scene, part)
        reason = window.lacks(fixed.requires)
        if reason is None:
            parts[tile] = _detect_part(window, _Here(fixed), seed, part, scene.extent)[0]
        lacking = lacking or reason or ""
    if not parts:
        raise MissingInputError(lacking)
    return join_tiles(parts, crs=scene.crs, numbers=detector.numbers, source=detector.name)[0]


def _detect_part(
    scene: Scene, runs: _Here | _Apart, seed: int, part: TilePart, whole: tuple[float, float, float, float]
) -> tuple[Footprints, Cost]:
    """Return what a tile owns and its cost; the scene is its window, which may have no points."""
    if scene.points is not None and len(scene.points) == 0:
        found, cost = Footprints.empty(crs=scene.crs), Cost()
    else:
        found, cost = runs.detect(scene, stream_of(seed, part.tile, runs.declaration))
    return owned(found, part.tile, scene.extent, whole), cost


def score(
    detected: Footprints,
    reference: Footprints,
    recipe: PluginRecipe,
    code: str,
    evaluator: Evaluator,
    *,
    area: Geometry | None,
    grid: Grid | None,
) -> Score | ScoreFailure:
    """Return the score by an evaluator, or its failure; `code` is the digest of its source.

    Large sets, those of cities, are compared in parts where the evaluator can do it: with the same result, and one part
    in memory at a time.
    """
    many = max(len(detected), len(reference))
    try:
        if many >= _MANY and _divides(evaluator, area, grid):
            return _score_in_parts(detected, reference, recipe, code, evaluator, 1 + many // _PART)
        return Score.of(evaluator.evaluate(detected, reference, area=area, grid=grid), recipe, code)
    except Exception as error:
        return ScoreFailure(evaluator=recipe, code=code, reason=reason_of(error))


def _divides(evaluator: Evaluator, area: Geometry | None, grid: Grid | None) -> bool:
    """Return whether an evaluator compares in parts: exact areas, everywhere."""
    exact = area is None and isinstance(evaluator, ThresholdFree) and evaluator.gsd is None
    return exact and (evaluator.area == "exact" or (evaluator.area == "auto" and grid is None))  # type: ignore[attr-defined]


def _score_in_parts(
    detected: Footprints, reference: Footprints, recipe: PluginRecipe, code: str, evaluator: Evaluator, parts: int
) -> Score:
    assert isinstance(evaluator, ThresholdFree)
    with tempfile.TemporaryDirectory(prefix="roofbench-") as work:
        evaluation, verdicts = evaluate_sets(evaluator, detected, reference, Path(work), parts=parts)
    score = Score.of(evaluation, recipe, code)
    return dataclasses.replace(score, verdicts=tuple(table.to_bytes() for table in verdicts))


def describe(scene: Scene, *, is_city: bool = False) -> SceneRecord:
    """Return the record of a scene; of a city neither points nor images are read for it."""
    reference = scene.reference
    grid, picture = (None, None) if is_city else (scene.evaluation_grid, scene_picture(scene))
    labels = None if reference is None or reference.building_ids is None else reference.building_ids
    return SceneRecord(
        content_hash=scene.window(scene.extent).content_hash if is_city else scene.content_hash,
        crs=scene.crs,
        extent=scene.extent,
        grid=None if grid is None else dataclasses.astuple(grid),
        area=None if scene.area is None else shapely.to_wkb(scene.area),
        reference=None if reference is None else tuple(shapely.to_wkb(reference.polygons).tolist()),
        reference_ids=() if reference is None else tuple(reference.ids.tolist()),
        building_ids=None if labels is None else tuple(plain_value(label) for label in labels),
        facts={name: value for name, value in scene.facts.items() if _is_json(value)},
        point_count=None if is_city or scene.points is None else len(scene.points),
        picture=None if picture is None else picture.content,
    )


def _is_json(value: Any) -> bool:
    if isinstance(value, dict):
        return all(isinstance(name, str) and _is_json(item) for name, item in value.items())
    if isinstance(value, list | tuple):
        return all(_is_json(item) for item in value)
    return value is None or isinstance(value, bool | int | float | str)


def _opened(recipe: SceneRecipe) -> Scene:
    key = repr((recipe, recipe.written))
    if key not in _scenes:
        while len(_scenes) >= _KEPT_SCENES:
            _scenes.popitem(last=False)
        _scenes[key] = recipe.open()
    _scenes.move_to_end(key)
    return _scenes[key]


@cache
def machine_facts() -> Mapping[str, Any]:
    """Return facts of this machine: host, processor, cores, system, Python."""
    return {
        "host": platform.node(),
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
    }


def _processor() -> str:
    with suppress(OSError, StopIteration), open("/proc/cpuinfo") as facts:
        return next(line for line in facts if line.startswith("model name")).partition(":")[2].strip()
    return platform.processor()
