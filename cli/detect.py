"""``roofbench detect``: one detector on one scene, whole or tile by tile."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import ParameterError, ProgramError, RoofbenchError
from ..core.wording import counted
from . import completion
from .command import load_plugins
from .console import say
from .options import (
    JobsOption,
    MemoryLimitOption,
    OverwriteOption,
    ParameterOption,
    PluginOption,
    QuietOption,
    SchedulerOption,
    TimeLimitOption,
    VerboseOption,
)
from .tiles import detect_tiles, say_left_out

if TYPE_CHECKING:
    from ..detectors.base import Detector
    from ..scenes.scene import Scene

__all__ = ["detect"]


def detect(
    detector: Annotated[
        str,
        typer.Argument(
            metavar="DETECTOR",
            help="NAME, 'NAME[parameter=value,...]' or FILE.py:CLASS.",
            autocompletion=completion.detectors,
        ),
    ],
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE",
            help="Scene folder, or preset such as 'knox-small[seed=3]'.",
            autocompletion=completion.scenes,
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Vector file for the footprints.")
    ] = None,
    parameter: ParameterOption = None,
    seed: Annotated[
        int, typer.Option("--seed", min=0, metavar="N", help="Random stream of a stochastic detector.")
    ] = 0,
    steps: Annotated[
        Path | None, typer.Option("--steps", metavar="FOLDER", help="Folder for a picture of every intermediate step.")
    ] = None,
    tile: Annotated[
        float | None,
        typer.Option("--tile", metavar="M", help="Detect by tiles of so many metres: for scenes of any size."),
    ] = None,
    halo: Annotated[
        float | None,
        typer.Option(
            "--halo",
            metavar="M",
            help="Width around a tile that the detector also sees, in metres [the detector's own].",
        ),
    ] = None,
    jobs: JobsOption = 1,
    scheduler: SchedulerOption = None,
    time_limit: TimeLimitOption = None,
    memory_limit: MemoryLimitOption = None,
    plugin: PluginOption = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
    verbose: VerboseOption = False,
) -> None:
    """Detect buildings on one scene and write their footprints.

    With --tile, each worker holds one tile in memory, and the same command resumes after an interruption. Exit code 3
    when the detector fails, or on some tiles; without tiles the end of its traceback is shown.

    Example: roofbench detect mpp city/ --tile 512 -j 2 -o city.fgb
    """
    from ..benchmark.execution.run_time import processor_time
    from ..benchmark.execution.worker import detect as run_detector
    from ..benchmark.suite import scenes_of
    from ..core.output import check_target
    from ..detectors.registry import make_detector
    from ..scenes.geodata.vector_files import output_driver, write_footprints

    load_plugins(plugin)
    chosen = make_detector(detector, dict(parameter or ()))
    (recipe,) = scenes_of([scene])
    if output is None and steps is None:
        raise ParameterError("name what to write: output= for footprints, steps= for pictures")
    if tile is None:
        _refuse_without_tiles(halo, scheduler, jobs)
    if output is not None:
        check_target(output, overwrite)
        output_driver(output)
    if steps is not None:
        from ..reports.steps.step_folder import check_step_folder

        check_step_folder(steps, overwrite=overwrite)
    if tile is not None:
        from ..benchmark.execution.city import City
        from .command import RunOptions

        if output is None or steps is not None:
            raise ParameterError("tile= writes footprints alone: set output=, and take steps= of a part of the scene")
        options = RunOptions(
            jobs=jobs,
            scheduler=scheduler,
            time_limit=time_limit,
            memory_limit=memory_limit,
            quiet=quiet,
            verbose=verbose,
        )
        detect_tiles(recipe, chosen, output, City(tile=tile, halo=halo, seed=seed), options, overwrite=overwrite)
        return
    place = recipe.open()
    if Path(scene).exists():
        _ = place.content_hash  # raises where a file was edited or replaced since the scene was made
    if output is not None:
        started = processor_time()
        with _failures_reported(chosen, place):
            found = run_detector(place, chosen, seed=seed, name=recipe.name)
        seconds = processor_time() - started
        write_footprints(found, output, overwrite=overwrite)
        if not quiet:
            for note in found.metadata.get("notes", ()):
                say(f"note: {place.name}: {note}")
            if found.metadata.get("cues"):
                say(f"cues used on {place.name}: {', '.join(found.metadata['cues'])}")
            say(f"{output}: {counted(len(found), 'footprint')} on {place.name} in {seconds:.2f} CPU seconds")
    if steps is not None:
        count = _write_steps(chosen, place, seed, steps, overwrite)
        if not quiet:
            say(f"{steps}: {count} pictures")
    if say_left_out(place.left_out, "which computes the scene again"):
        raise typer.Exit(3)


def _refuse_without_tiles(halo: float | None, scheduler: str | None, jobs: int) -> None:
    given = {"halo": halo is not None, "scheduler": scheduler is not None, "jobs": jobs != 1}
    for name in [name for name, is_given in given.items() if is_given]:
        raise ParameterError(f"{name}= is for detection by tiles: set tile=512 as well, or leave it out")


def _write_steps(detector: Detector, scene: Scene, seed: int, folder: Path, overwrite: bool) -> int:
    from ..detectors.streams import random_stream
    from ..reports.steps.step_folder import write_steps

    scene.require(detector.requires)
    visible = scene.for_detection()
    with _failures_reported(detector, scene):
        steps = detector.steps(visible, random_stream(seed, scene.name, detector.name))
        return write_steps(steps, folder, title=f"{detector.name} on {scene.name}", overwrite=overwrite)


@contextmanager
def _failures_reported(detector: Detector, scene: Scene) -> Iterator[None]:
    """Report an error inside a detector below the end of its traceback, and exit with code 3."""
    try:
        # Standard output is for data: what a plugin prints is a message.
        with redirect_stdout(sys.stderr):
            yield
    except ProgramError as error:
        say("\n".join(filter(None, [error.log, f"Error: {detector.name} failed on {scene.name}: {error}"])))
        raise typer.Exit(3) from error
    except (RoofbenchError, OSError, typer.Exit):
        raise
    except (Exception, SystemExit) as error:
        traceback.print_exc(limit=-4)
        sentence = " ".join(f"{type(error).__name__}: {error}".split())
        say(f"Error: {detector.name} failed on {scene.name}: {sentence}")
        raise typer.Exit(3) from error
