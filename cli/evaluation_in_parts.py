"""``roofbench evaluate`` of files that are too large for the memory: in parts, with a work folder and progress."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from ..evaluators.base import Evaluation, Evaluator

__all__ = ["evaluate_in_parts", "is_large"]

#: Footprints of a file from which on two files are compared in parts.
_MANY = 2_000_000
#: Smallest file that may hold so many, bytes.
_LARGE_FILE = 50_000_000


def is_large(paths: tuple[str, str]) -> bool:
    """Return whether a file holds so many footprints that both are compared in parts."""
    from ..core.errors import RoofbenchError
    from ..scenes.geodata.vector_files import split_layer

    files = [split_layer(path)[0] for path in paths]
    if not all(file.is_file() for file in files) or max(file.stat().st_size for file in files) < _LARGE_FILE:
        return False
    from ..scenes.geodata.footprint_stream import open_stream  # needs the compiler, which small files do without

    try:
        return max(open_stream(path).count for path in paths) >= _MANY
    except RoofbenchError:
        return False  # problems of the file are reported where it is read


def evaluate_in_parts(
    evaluator: Evaluator,
    paths: tuple[str, str],
    *,
    parts: int | None,
    building_id: str | None,
    crs: str | None,
    verdicts: Path | None,
    overwrite: bool,
    quiet: bool,
) -> Evaluation:
    """Compare two files in parts, and write the verdicts.

    The work folder lies beside the file of the verdicts (else among temporary files). An interrupted evaluation keeps
    it and continues from it; it is removed at the end.
    """
    from ..core.errors import InputError, UnsupportedError
    from ..evaluators.in_parts import ThresholdFree, evaluate_files
    from ..reports.verdict_stream import check_streamed_output, write_verdict_stream
    from ..scenes.geodata.footprint_stream import open_stream

    if not isinstance(evaluator, ThresholdFree):
        raise UnsupportedError(
            f"the evaluator {evaluator.name!r} compares whole files only: leave out parts=, or use "
            f"{ThresholdFree.name!r}"
        )
    if Path(paths[1]).is_dir():
        raise InputError(f"{paths[1]} is a scene: leave out parts=, or name its vector file")
    if verdicts is not None:
        check_streamed_output(verdicts)
    streams = open_stream(paths[0], crs=crs), open_stream(paths[1], building_id=building_id, crs=crs)
    with _work_folder(verdicts) as work, _progress(quiet) as (say, progress):
        comparison = evaluate_files(evaluator, streams, work, parts=parts, say=say, progress=progress)
        if verdicts is not None:
            say(f"writing {verdicts}")
            write_verdict_stream(comparison, verdicts, overwrite=overwrite)
        return comparison.evaluation


@contextmanager
def _work_folder(verdicts: Path | None) -> Iterator[Path]:
    """Yield the work folder, and remove it when the work is done."""
    if verdicts is None:
        with tempfile.TemporaryDirectory(prefix="roofbench-") as folder:
            yield Path(folder) / "work"
        return
    work = verdicts.parent / f".{verdicts.name}.parts"
    yield work
    shutil.rmtree(work, ignore_errors=True)


@contextmanager
def _progress(quiet: bool) -> Iterator[tuple[Callable[[str], None], Callable[[int, int], None]]]:
    """Yield a function that says what is done, and one that moves a bar (on a terminal only)."""
    if quiet or not sys.stderr.isatty():
        yield (lambda sentence: None if quiet else typer.echo(f"- {sentence}", err=True)), lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task: Any = None

        def move(done: int, total: int) -> None:
            nonlocal task
            if task is None:
                task = bar.add_task("parts", total=total)
            bar.update(task, completed=done, visible=done < total)

        yield (lambda sentence: bar.console.print(f"- {sentence}", markup=False, highlight=False, soft_wrap=True)), move
