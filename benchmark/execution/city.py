"""A city: a detector tile by tile, in bounded memory, resumed after an interruption.

Nouns
-----
work folder
    Folder beside the output, ``OUTPUT.tiles``, with the outcome of each finished tile. The name of a file holds the
    key of the tile: detector with its code and parameters, the files of the scene in the window of the tile, side,
    halo and seed. Outcomes of another key are not used.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from ...core.digests import digest
from ...core.errors import OutputError, ParameterError
from ...core.output import check_target, is_scratch, whole_file
from ...detectors.base import Detector
from ...detectors.seams import Seams, join_strips
from ...detectors.tiling import Measured, Tile, measure, tiles_of
from ...scenes.geodata.footprint_strips import write_strips
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.vector_files import output_driver
from ...scenes.scene import Scene
from ..identity.keys import module_closure
from ..identity.recipes import PluginRecipe, SceneRecipe, code_digest
from ..store.outcomes import Outcome
from .executors import Execution, slots_of
from .isolation import call_isolated
from .tasks import Task, TilePart
from .tile_outcomes import stored_parts, survey_tiles
from .worker import execute_text

__all__ = ["City", "CityResult", "TileWork", "detect_city", "plan_tiles", "remove_tiles", "run_tiles", "work_key"]

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
    cues : mapping of str to int
        Tiles by the cues that the detector used there, where it names them.
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
    cues: Mapping[str, int]


class _Job(NamedTuple):
    tile: Tile
    task: Task
    file: Path


class TileWork(NamedTuple):
    """What is to be done for a city.

    Attributes
    ----------
    scene : Scene
    folder : Path
        Work folder.
    measured : Measured
    jobs : tuple
        Tile, task and file of the outcome of each tile.
    """

    scene: Scene
    folder: Path
    measured: Measured
    jobs: tuple[_Job, ...]


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
    work = plan_tiles(recipe, detector, output.with_name(f"{output.name}.tiles"), city, order=order)
    waiting = [job for job in work.jobs if not job.file.exists()]
    failed = run_tiles(work, execution, progress)
    files = {job.tile: job.file for job in work.jobs if job.tile not in failed}
    survey = survey_tiles(files)
    seams = Seams(0, 0, 0, 0)

    def strips() -> Iterator[Footprints]:
        nonlocal seams
        for strip, done in join_strips(stored_parts(files), survey.facts, numbers=detector.numbers):
            seams = Seams(*map(sum, zip(seams, done, strict=True)))
            yield strip

    count = write_strips(strips(), output, crs=work.scene.crs, types=survey.facts.kinds, overwrite=overwrite)
    left_out = work.scene.left_out
    if not failed and not left_out:
        remove_tiles(work.folder)
    return CityResult(
        footprints=count,
        tiles=len(work.jobs),
        reused=len(work.jobs) - len(waiting),
        seams=seams,
        failed=dict(sorted(failed.items())),
        skipped=survey.skipped,
        left_out=left_out,
        measured=work.measured,
        peak_memory=survey.cost.peak_memory or 0,
        cues=survey.cues,
    )


def plan_tiles(
    recipe: SceneRecipe,
    detector: Detector,
    folder: Path,
    city: City,
    *,
    order: Callable[[Sequence[Tile]], Sequence[Tile]] | None = None,
) -> TileWork:
    """Return the tasks of all tiles, and measure what they share; the folder is made."""
    scene = recipe.open()
    halo = detector.halo if city.halo is None else city.halo
    tiles = tiles_of(scene, city.tile, halo)
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder} cannot be made: {error.strerror}") from error
    base = work_key(recipe, detector, city)
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
    return TileWork(scene, folder, measured, tuple(jobs))


def work_key(recipe: SceneRecipe, detector: Detector, city: City) -> str:
    """Return a digest of what the tiles of a city depend on besides seed and files: code, parameters and division."""
    halo = detector.halo if city.halo is None else city.halo
    return digest([_code_of(detector), detector.name, detector.values(), recipe.name, city.tile, halo])


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


def run_tiles(
    work: TileWork, execution: Execution, progress: Callable[[int, int, Tile, Outcome], None] | None = None
) -> dict[Tile, str]:
    """Run the tiles that are not stored, keep each outcome when it arrives, and return the reasons of failed ones."""
    failed: dict[Tile, str] = {}
    jobs = [job for job in work.jobs if not job.file.exists()]
    if not jobs:
        return failed
    local = execution.jobs == 0 and execution.scheduler is None
    with slots_of(execution.jobs, execution.scheduler, len(jobs), by_worker=True) as slots:
        queue = _Queue(jobs)
        flying: dict[Future[bytes], tuple[_Job, int]] = {}
        turns = range(max(slot.capacity for slot in slots))
        free = [number for turn in turns for number, slot in enumerate(slots) if turn < slot.capacity]
        done = 0
        while queue or flying:
            while queue and free:
                number = free.pop(0)
                job, following = queue.next_for(number, ahead=slots[number].reads_ahead)
                submit = slots[number].executor.submit
                text = replace(job.task, ahead=following).to_json()
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


class _Queue:
    """Waiting tiles. A slot that reads ahead has its next tile reserved, so that a task can name it to its worker."""

    def __init__(self, jobs: Sequence[_Job]) -> None:
        self._waiting = list(reversed(jobs))
        self._reserved: dict[int, _Job] = {}

    def __bool__(self) -> bool:
        return bool(self._waiting or self._reserved)

    def next_for(self, slot: int, *, ahead: bool) -> tuple[_Job, Tile | None]:
        """Return the next job of a slot, at the end one that is reserved for another slot, and the tile after it."""
        if slot in self._reserved:
            job = self._reserved.pop(slot)
        elif self._waiting:
            job = self._waiting.pop()
        else:
            job = self._reserved.pop(min(self._reserved))
        if not ahead or not self._waiting:
            return job, None
        self._reserved[slot] = self._waiting.pop()
        return job, self._reserved[slot].tile


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


def remove_tiles(folder: Path) -> None:
    """Remove a work folder, with what a killed process was writing in it; files of others in it stay."""
    for file in folder.iterdir():
        name, _, key = file.name.partition(".")
        if is_scratch(file):
            shutil.rmtree(file, ignore_errors=True)
        elif file.name == _MEASURED or (len(key) == 32 and name.replace("_", "").replace("-", "").isdigit()):
            file.unlink()
    with suppress(OSError):
        folder.rmdir()
