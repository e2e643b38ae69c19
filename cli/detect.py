"""Commands on one detector: ``roofbench detect`` and ``check-plugin``."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import ParameterError, RoofbenchError, UnknownNameError
from .options import PluginOption, QuietOption, load_plugins

if TYPE_CHECKING:
    from ..detectors.base import Detector
    from ..evaluators.base import Evaluator
    from ..scenes.scene import Scene


def detect(
    detector: Annotated[str, typer.Argument(help="NAME, 'NAME[parameter=value,...]' or FILE.py:CLASS.")],
    scene: Annotated[str, typer.Argument(help="Scene folder, or preset such as 'knox-small[seed=3]'.")],
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Vector file for the footprints.")] = None,
    parameter: Annotated[
        list[str] | None, typer.Option("--parameter", "-p", help="NAME=VALUE; repeat for more.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the random stream of a stochastic detector.")] = 0,
    steps: Annotated[Path | None, typer.Option(help="Folder for a picture of every intermediate step.")] = None,
    plugin: PluginOption = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what exists.")] = False,
    quiet: QuietOption = False,
) -> None:
    """Detect buildings on one scene and write their footprints.

    Exit code 3 when the detector fails; the end of its traceback is shown.
    """
    import time

    from ..benchmark.execution.worker import detect as run_detector
    from ..benchmark.suite import scenes_of
    from ..core.output import check_target
    from ..detectors.registry import make_detector
    from ..scenes.geodata.vector_files import output_driver, write_footprints

    load_plugins(plugin)
    if output is None and steps is None:
        raise ParameterError("name what to write: --output FILE for footprints, --steps FOLDER for pictures")
    values = {}
    for item in parameter or ():
        name, equals, value = item.partition("=")
        if not equals:
            raise ParameterError(f"cannot read --parameter {item!r}: write NAME=VALUE")
        values[name.strip()] = value.strip()
    chosen = make_detector(detector, values)
    if output is not None:
        check_target(output, overwrite)
        output_driver(output)
    if steps is not None:
        from ..reports.steps.step_folder import check_step_folder

        check_step_folder(steps, overwrite=overwrite)
    (recipe,) = scenes_of([scene])
    place = recipe.open()
    if Path(scene).exists():
        _ = place.content_hash  # tells a file that was edited or replaced since the scene was made
    if output is not None:
        started = time.process_time()
        with _failures_told(chosen, place):
            found = run_detector(place, chosen, seed=seed)
        seconds = time.process_time() - started
        write_footprints(found, output, overwrite=overwrite)
        if not quiet:
            for note in found.metadata.get("notes", ()):
                typer.echo(f"note: {place.name}: {note}", err=True)
            typer.echo(f"{output}: {len(found)} footprints on {place.name} in {seconds:.2f} CPU seconds", err=True)
    if steps is not None:
        count = _write_steps(chosen, place, seed, steps, overwrite)
        if not quiet:
            typer.echo(f"{steps}: {count} pictures", err=True)


def _write_steps(detector: Detector, scene: Scene, seed: int, folder: Path, overwrite: bool) -> int:
    from ..benchmark.execution.worker import random_stream
    from ..reports.steps.step_folder import write_steps

    visible = scene.for_detection()
    visible.require(detector.requires)
    with _failures_told(detector, scene):
        steps = detector.steps(visible, random_stream(seed, scene, detector))
        return write_steps(steps, folder, title=f"{detector.name} on {scene.name}", overwrite=overwrite)


@contextmanager
def _failures_told(detector: Detector, scene: Scene) -> Iterator[None]:
    """Tell an error inside a detector as `roofbench run` does, below the end of its traceback; exit code 3."""
    try:
        # Standard output is for data: what a plugin prints is a message.
        with redirect_stdout(sys.stderr):
            yield
    except (RoofbenchError, OSError, typer.Exit):
        raise
    except (Exception, SystemExit) as error:
        traceback.print_exc(limit=-4)
        told = " ".join(f"{type(error).__name__}: {error}".split())
        typer.echo(f"Error: {detector.name} failed on {scene.name}: {told}", err=True)
        raise typer.Exit(3) from error


def check_plugin(
    name: Annotated[str, typer.Argument(help="Detector or evaluator: NAME or FILE.py:CLASS.")],
    plugin: PluginOption = None,
) -> None:
    """Check that a detector or evaluator keeps to the rules, on a small built-in scene; exit code 3 when not."""
    from ..benchmark import conformance
    from ..core.registry import nearest_hint, parse_selection
    from ..detectors.registry import DETECTORS, make_detector
    from ..evaluators.registry import EVALUATORS, make_evaluator

    load_plugins(plugin)
    known = [*DETECTORS.names(), *EVALUATORS.names()]
    word = parse_selection(name)[0]
    chosen: Detector | Evaluator
    if ".py" in word:
        chosen = _from_file(name)
    elif word in DETECTORS.names():
        chosen = make_detector(name)
    elif word in EVALUATORS.names():
        chosen = make_evaluator(name)
    else:
        raise UnknownNameError(f"no plugin called {word!r}{nearest_hint(word, known)}; there are {', '.join(known)}")
    with redirect_stdout(sys.stderr):
        checks = conformance.check_plugin(chosen)
    for check in checks:
        typer.echo(
            f"{'ok    ' if check.passed else 'BROKEN'}  {check.rule}{': ' + check.problem if check.problem else ''}"
        )
    broken = sum(not check.passed for check in checks)
    typer.echo(f"{name}: {len(checks) - broken} of {len(checks)} rules kept")
    if broken:
        raise typer.Exit(3)


def _from_file(selection: str) -> Detector | Evaluator:
    """Return the detector or the evaluator that ``file.py:Class`` names, whichever it is."""
    from ..core.registry import parse_selection
    from ..detectors.registry import DETECTORS, make_detector
    from ..evaluators.registry import EVALUATORS, make_evaluator

    word = parse_selection(selection)[0]
    file = Path(word.partition(".py")[0] + ".py")
    if ":" not in word.rpartition(".py")[2] and not DETECTORS.add_all(file) and not EVALUATORS.add_all(file):
        raise UnknownNameError(f"{file} holds neither a detector nor an evaluator: derive from roofbench.Detector")
    try:
        return make_detector(selection)
    except ParameterError as error:
        try:
            return make_evaluator(selection)
        except ParameterError:
            raise error from None
