"""A city: a detector tile by tile, in bounded memory, resumed after an interruption.

Nouns
-----
work folder
    Folder beside the output, ``OUTPUT.tiles``, with the outcome of each finished tile. The name of a file holds the
    key of the tile: detector with its code and parameters, the files of the scene in the window of the tile, side,
    halo and seed. Outcomes of another key are not used.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from ...core.digests import digest
from ...core.errors import OutputError, ParameterError
from ...core.output import check_target, whole_file
from ...detectors.base import Detector
from ...detectors.tiling import Measured, Seams, Tile, join_tiles, measure, tiles_over
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.vector_files import output_driver, write_footprints
from ...scenes.scene import Scene
from ..identity.keys import module_closure
from ..identity.recipes import PluginRecipe, SceneRecipe, code_digest
from ..store.outcomes import Outcome
from .executors import slots_of
from .isolation import call_isolated
from .runner import Execution
from .tasks import Task, TilePart
from .worker import execute_text

__all__ = ["City", "CityResult", "detect_city"]

_MEASURED = "measured.json"


@dataclass(frozen=True, kw_only=True)
class City:
    """How a scene is divided.

    Attributes
    ----------
    tile : float
        Side of a tile, metres.
    halo : float, optional
        Metres around a tile that the detector sees, too; by default what the detector declares.
    seed : int
        Of the random streams.
    """

    tile: float = 512.0
    halo: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if not 16 <= self.tile <= 100_000:
            raise ParameterError(f"tile={self.tile:g} must be from 16 to 100000 metres")
        if self.halo is not None and not 0 <= self.halo <= 10_000:
            raise ParameterError(f"halo={self.halo:g} must be from 0 to 10000 metres")


class CityResult(NamedTuple):
    """What was detected.

    Attributes
    ----------
    footprints : int
    tiles, reused : int
        Number of tiles, and of those that were finished before.
    seams : Seams
    failed, skipped : dict of Tile to str
        Tiles without a result, with the reason: they failed, or lack an input.
    left_out : tuple of str
        Files that are no part of the scene, with the reason.
    measured : Measured
    peak_memory : int
        Highest resident memory of a worker, bytes; 0 where it is not known.
    """

    footprints: int
    tiles: int
    reused: int
    seams: Seams
    failed: dict[Tile, str]
    skipped: dict[Tile, str]
    left_out: tuple[str, ...]
    measured: Measured
    peak_memory: int


class _Job(NamedTuple):
    tile: Tile
    task: Task
    file: Path


def detect_city(
    recipe: SceneRecipe,
    detector: Detector,
    output: Path,
    city: City,
    *,
    execution: Execution | None = None,
    overwrite: bool = False,
    progress: Callable[[int, int, Tile, Outcome], None] | None = None,
    order: Callable[[Sequence[Tile]], Sequence[Tile]] | None = None,
) -> CityResult:
    """Detect on every tile of a scene, and write the footprints as one file, whole or not at all.

    Parameters
    ----------
    recipe : SceneRecipe
    detector : Detector
    output : Path
        Vector file. When tiles fail it holds the others, and the work folder stays for the next call.
    city : City
    execution : Execution, optional
        One worker process by default. Each worker holds one tile in memory.
    overwrite : bool
        Whether an existing file may be replaced.
    progress : callable, optional
        Called with (tiles done, tiles to do, tile, outcome) after each tile that was not finished before.
    order : callable, optional
        Order in which the tiles run; the result does not depend on it.
    """
    check_target(output, overwrite)
    output_driver(output)
    execution = execution or Execution()
    scene = recipe.open()
    halo = detector.halo if city.halo is None else city.halo
    tiles = tiles_over(scene.extent, city.tile)
    folder = output.with_name(f"{output.name}.tiles")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder} cannot be made: {error.strerror}") from error
    base = digest([_code_of(detector), detector.name, detector.values(), recipe.name, city.tile, halo])
    measured = _measured(folder / _MEASURED, base, scene, detector, tiles)
    fixed = detector.replaced(measured.parameters)
    jobs = []
    for tile in tiles if order is None else order(tiles):
        window = scene.window(tile.core, halo).content_hash
        seed = city.seed if fixed.stochastic else 0
        key = digest([base, measured, seed, window, tile.core, tile.ends(scene.extent)])
        part = TilePart(tile=tile, halo=halo, measured=measured)
        task = Task(scene=recipe, detector=PluginRecipe.of(fixed), seed=city.seed, evaluators=(), part=part)
        jobs.append(_Job(tile, task, folder / f"{tile.column}_{tile.row}.{key[:32]}"))
    waiting = [job for job in jobs if not job.file.exists()]
    failed = _run(waiting, execution, progress)
    outcomes = {job.tile: Outcome.from_bytes(job.file.read_bytes()) for job in jobs if job.tile not in failed}
    parts = {tile: _footprints(outcome) for tile, outcome in outcomes.items() if outcome.status == "ok"}
    found, seams = join_tiles(parts, crs=scene.crs, numbers=detector.numbers, source=detector.name)
    write_footprints(found, output, overwrite=overwrite)
    left_out = tuple(scene.facts.get("left_out", ()))
    if not failed and not left_out:
        _remove(folder)
    return CityResult(
        footprints=len(found),
        tiles=len(tiles),
        reused=len(jobs) - len(waiting),
        seams=seams,
        failed=dict(sorted(failed.items())),
        skipped={tile: str(done.reason) for tile, done in sorted(outcomes.items()) if done.status == "skipped"},
        left_out=left_out,
        measured=measured,
        peak_memory=max((outcome.cost.peak_memory or 0 for outcome in outcomes.values()), default=0),
    )


def _code_of(detector: Detector) -> list[str]:
    return [code_digest(detector), detector.fingerprint(), module_closure("detectors.tiling").digest]


def _measured(file: Path, base: str, scene: Scene, detector: Detector, tiles: Sequence[Tile]) -> Measured:
    """Return what all tiles share, measured once: a repaired file must not change the other tiles."""
    if file.is_file():
        with suppress(ValueError, KeyError, TypeError):
            stored = json.loads(file.read_text("utf-8"))
            if stored["key"] == base:
                return Measured(stored["parameters"], stored["ground_cell"], stored["whole"])
    found = measure(scene, detector, tiles)
    with whole_file(file, overwrite=True) as scratch:
        scratch.write_text(json.dumps({"key": base, **found._asdict()}), encoding="utf-8")
    return found


def _run(
    jobs: Sequence[_Job], execution: Execution, progress: Callable[[int, int, Tile, Outcome], None] | None
) -> dict[Tile, str]:
    """Run the tiles, keep each outcome when it arrives, and return the reasons of those that failed."""
    failed: dict[Tile, str] = {}
    if not jobs:
        return failed
    local = execution.jobs == 0 and execution.scheduler is None
    with slots_of(execution.jobs, execution.scheduler, len(jobs)) as slots:
        waiting = list(reversed(jobs))
        flying: dict[Future[bytes], tuple[_Job, int]] = {}
        turns = range(max(slot.capacity for slot in slots))
        free = [number for turn in turns for number, slot in enumerate(slots) if turn < slot.capacity]
        done = 0
        while waiting or flying:
            while waiting and free:
                job, number = waiting.pop(), free.pop(0)
                submit = slots[number].executor.submit
                text = job.task.to_json()
                future = submit(execute_text, text) if local else submit(call_isolated, text, execution.limits)
                flying[future] = job, number
            for future in wait(flying, return_when=FIRST_COMPLETED).done:
                job, number = flying.pop(future)
                free.append(number)
                outcome = _keep(job, future)
                done += 1
                if outcome.status == "failed":
                    failed[job.tile] = str(outcome.reason)
                if progress is not None:
                    progress(done, len(jobs), job.tile, outcome)
    return failed


def _keep(job: _Job, future: Future[bytes]) -> Outcome:
    """Write the outcome of a tile into the work folder, unless it failed."""
    try:
        outcome = Outcome.from_bytes(future.result())
    except Exception as error:
        return Outcome(status="failed", reason=f"the executor failed: {type(error).__name__}: {error}")
    if outcome.status != "failed":
        with whole_file(job.file, overwrite=True) as scratch:
            scratch.write_bytes(outcome.to_bytes())
    return outcome


def _footprints(outcome: Outcome) -> Footprints:
    polygons = np.empty(len(outcome.detections), dtype=object)
    polygons[:] = shapely.from_wkb(list(outcome.detections))
    columns = {name: np.array(column) for name, column in outcome.attributes.items()}
    return dataclasses.replace(Footprints(polygons=polygons), attributes=columns)


def _remove(folder: Path) -> None:
    """Remove a work folder; files of others in it stay."""
    for file in folder.iterdir():
        name, _, key = file.name.partition(".")
        if file.name == _MEASURED or (len(key) == 32 and name.replace("_", "").replace("-", "").isdigit()):
            file.unlink()
    with suppress(OSError):
        folder.rmdir()
