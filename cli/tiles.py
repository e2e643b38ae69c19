"""``roofbench detect --tile``: a detector over the tiles of a scene."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ..core.wording import counted
from .console import messages, say

if TYPE_CHECKING:
    from ..benchmark.execution.city import City, CityResult
    from ..benchmark.identity.recipes import SceneRecipe
    from ..benchmark.store.outcomes import Outcome
    from ..detectors.base import Detector
    from ..detectors.tiling import Tile
    from .command import RunOptions

__all__ = ["detect_tiles", "say_left_out"]


def detect_tiles(
    recipe: SceneRecipe, detector: Detector, output: Path, city: City, options: RunOptions, *, overwrite: bool
) -> None:
    """Detect tile by tile, and report; exit code 3 when a tile failed or a file is left out of the scene."""
    from ..benchmark.execution.city import detect_city

    with _progress(options) as report:
        result = detect_city(
            recipe,
            detector,
            output,
            city,
            execution=options.execution(),
            overwrite=overwrite,
            progress=report,
        )
    if not options.quiet:
        _say(result, output, recipe.name)
    if result.failed:
        for tile, reason in result.failed.items():
            say(f"failed: tile {tile.label}: {reason}")
        say(
            f"{len(result.failed)} of {result.tiles} tiles failed and are missing in {output}: repair their files, and "
            "give the same command with --overwrite, which computes these tiles alone",
        )
    if say_left_out(result.left_out, "which computes the tiles that they change") or result.failed:
        raise typer.Exit(3)


def say_left_out(problems: Sequence[str], consequence: str) -> bool:
    """Report files that are not part of a scene; return whether there are any."""
    for problem in problems:
        say(f"left out: {problem}")
    if problems:
        files = counted(len(problems), "file is", "files are")
        say(
            f"{files} not part of the scene: repair or remove what is left out, index the folder again, and repeat the "
            f"command with --overwrite, {consequence}"
        )
    return bool(problems)


def _say(result: CityResult, output: Path, name: str) -> None:
    values = ", ".join(f"{key}={value:g}" for key, value in result.measured.parameters.items())
    if values:
        say(f"note: {name}: all tiles share {values}, measured on up to five of them")
    if result.cues:
        tiles = (f"{cues} ({counted(number, 'tile')})" for cues, number in result.cues.items())
        say(f"cues used on {name}: {'; '.join(tiles)}")
    seams = result.seams
    if any(seams):
        say(
            f"note: {name}: at the seams {seams.doubles} double and {seams.cut} cut footprints were left out, "
            f"{seams.joined} cut ones joined, {seams.added} added that only the neighbouring tile found",
        )
    if result.skipped:
        first, reason = next(iter(result.skipped.items()))
        skipped = counted(len(result.skipped), "tile was", "tiles were")
        say(f"note: {skipped} skipped, the first at {first.label}: {reason}")
    reused = f", {result.reused} of them finished before" if result.reused else ""
    memory = f", at most {result.peak_memory / 1e6:.0f} MB in a worker" if result.peak_memory else ""
    found = f"{counted(result.footprints, 'footprint')} of {counted(result.tiles, 'tile')}"
    say(f"{output}: {found}{reused}{memory}")


@contextmanager
def _progress(options: RunOptions) -> Iterator[Callable[[int, int, Tile, Outcome], None] | None]:
    """Yield a callback for finished tiles: a bar with the time left on a terminal, with verbose a line for each."""
    screen = messages(options.quiet)
    if options.quiet or not (screen.is_terminal or options.verbose):
        yield None
        return
    started = time.monotonic()
    if not screen.is_terminal:

        def line(done: int, total: int, tile: Tile, outcome: Outcome) -> None:
            left = (time.monotonic() - started) / done * (total - done)
            found = outcome.reason or counted(len(outcome.detections), "footprint")
            screen.print(
                f"{done} of {total}: tile {tile.label}: {found}; {left:.0f} s left", markup=False, soft_wrap=True
            )

        yield line
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=screen, transient=True) as bar:
        task = bar.add_task("tiles", total=None)

        def move(done: int, total: int, tile: Tile, outcome: Outcome) -> None:
            bar.update(task, completed=done, total=total, description=f"tile {tile.label}")

        yield move
