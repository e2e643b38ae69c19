"""``evaluate`` and ``compare`` of files that are too large for the memory: in parts, with a work folder."""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from .console import messages, say

if TYPE_CHECKING:
    from ..evaluators.base import Evaluation, Evaluator
    from ..evaluators.in_parts import ThresholdFree
    from ..evaluators.uncertainty.paired import PairedComparison
    from ..evaluators.uncertainty.summary import Uncertainty
    from ..scenes.geodata.footprint_stream import FootprintStream

__all__ = ["InParts", "compare_in_parts", "evaluate_in_parts", "is_large"]

#: Footprints of a file from which on two files are compared in parts.
_MANY = 2_000_000
#: Smallest file that may hold so many, bytes.
_LARGE_FILE = 50_000_000


def is_large(paths: Sequence[str]) -> bool:
    """Return whether a file holds so many footprints that all are compared in parts."""
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


class InParts(NamedTuple):
    """Options of a comparison in parts, as on the command line."""

    parts: int | None
    scheduler: str | None
    building_id: str | None
    crs: str | None
    verdicts: Path | None
    plot: Path | None
    overwrite: bool
    quiet: bool
    interval: float | None = None
    reference_error: float | None = None
    redraws: int | None = None


def evaluate_in_parts(
    evaluator: Evaluator, paths: tuple[str, str], options: InParts, *, title: str
) -> tuple[Evaluation, Uncertainty | None]:
    """Compare two files in parts, and write the verdicts and the map; return the uncertainty where it is asked for.

    The work folder lies beside the file of the verdicts (else among temporary files). An interrupted evaluation keeps
    it and continues from it; it is removed at the end.
    """
    from ..evaluators.in_parts import evaluate_files
    from ..reports.verdict_stream import write_verdict_stream

    chosen = _able(evaluator)
    detected, reference = _streams(paths, options)
    with _running(options) as (work, execution):
        comparison = evaluate_files(chosen, (detected, reference), work, **execution)
        doubt = None
        if options.interval is not None or options.reference_error is not None:
            from ..evaluators.uncertainty.summary_files import uncertainty_of_files

            doubt = uncertainty_of_files(
                chosen,
                comparison,
                interval=options.interval,
                reference_error=options.reference_error,
                redraws=options.redraws,
                executor=execution["executor"],
                say=execution["say"],
            )
        if options.plot is not None:
            from ..reports.figures import save_figure
            from ..reports.map_in_parts import file_figure

            save_figure(file_figure(comparison, title=title), options.plot, overwrite=options.overwrite)
        if options.verdicts is not None:
            execution["say"](f"writing {options.verdicts}")
            write_verdict_stream(comparison, options.verdicts, overwrite=options.overwrite)
        return comparison.evaluation, doubt


def compare_in_parts(
    evaluator: Evaluator, paths: tuple[str, str, str], options: InParts, *, title: str
) -> PairedComparison:
    """Compare two detections of one place in parts, and write the layers and the map; see `evaluate_in_parts`."""
    from ..evaluators.uncertainty.paired_files import compare_files, with_redraws
    from ..reports.pair_stream import write_pair_stream

    chosen = _able(evaluator)
    one, two, reference = _streams(paths, options)
    with _running(options) as (work, execution):
        found = compare_files(
            chosen,
            (one, two, reference),
            work,
            interval=95.0 if options.interval is None else options.interval,
            **execution,
        )
        if options.reference_error is not None:
            run = {name: execution[name] for name in ("executor", "say")}
            found = with_redraws(found, error=options.reference_error, redraws=options.redraws, **run)
        if options.plot is not None:
            from ..reports.figures import save_figure
            from ..reports.map_in_parts import paired_files_figure

            save_figure(paired_files_figure(found, title=title), options.plot, overwrite=options.overwrite)
        if options.verdicts is not None:
            execution["say"](f"writing {options.verdicts}")
            write_pair_stream(found, options.verdicts, overwrite=options.overwrite)
        return found.comparison


def _able(evaluator: Evaluator) -> ThresholdFree:
    """Return the evaluator, or raise `UnsupportedError` where it compares whole files only."""
    from ..core.errors import UnsupportedError
    from ..evaluators.in_parts import ThresholdFree

    if not isinstance(evaluator, ThresholdFree):
        raise UnsupportedError(
            f"the evaluator {evaluator.name!r} compares whole files only: leave out parts=, or use "
            f"{ThresholdFree.name!r}"
        )
    return evaluator


def _streams(paths: Sequence[str], options: InParts) -> list[FootprintStream]:
    """Open the files; the last one is the reference."""
    from ..core.errors import InputError
    from ..reports.streamed_layers import check_streamed_output
    from ..scenes.geodata.footprint_stream import open_stream
    from ..scenes.shipped import shipped_or_given

    if not Path(paths[-1]).is_file() and shipped_or_given(paths[-1]).is_dir():
        asked = "parts=" if options.parts is not None else "scheduler="
        raise InputError(
            f"{paths[-1]} is a scene, which is compared as a whole: leave out {asked}, or name its vector file"
        )
    if options.verdicts is not None:
        check_streamed_output(options.verdicts)
    detected = [open_stream(path, crs=options.crs) for path in paths[:-1]]
    return [*detected, open_stream(paths[-1], building_id=options.building_id, crs=options.crs)]


@contextmanager
def _running(options: InParts) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Yield the work folder, and how the work is run: parts, executor, messages and progress."""
    with ExitStack() as stack:
        executor = None
        if options.scheduler is not None:
            from ..benchmark.execution.executors import cluster_slot

            executor = stack.enter_context(cluster_slot(options.scheduler)).executor
        work = stack.enter_context(_work_folder(options.verdicts, options.scheduler))
        say, progress = stack.enter_context(_progress(options.quiet))
        yield work, {"parts": options.parts, "executor": executor, "say": say, "progress": progress}


@contextmanager
def _work_folder(verdicts: Path | None, scheduler: str | None) -> Iterator[Path]:
    """Yield the work folder, and remove it when the work is done."""
    if verdicts is None:
        # The workers of a cluster see the working folder rather than the temporary files of this machine.
        place = None if scheduler is None else Path.cwd()
        with tempfile.TemporaryDirectory(prefix="roofbench-", dir=place) as folder:
            yield Path(folder) / "work"
        return
    work = verdicts.absolute().parent / f".{verdicts.name}.parts"
    yield work
    shutil.rmtree(work, ignore_errors=True)


@contextmanager
def _progress(quiet: bool) -> Iterator[tuple[Callable[[str], None], Callable[[int, int], None]]]:
    """Yield a function that says what is done, and one that moves a bar (on a terminal only)."""
    if quiet or not sys.stderr.isatty():
        yield (lambda sentence: None if quiet else say(f"- {sentence}")), lambda done, total: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=messages(), transient=True) as bar:
        task: Any = None

        def move(done: int, total: int) -> None:
            nonlocal task
            if task is None:
                task = bar.add_task("parts", total=total)
            bar.update(task, completed=done, visible=done < total)

        yield (lambda sentence: bar.console.print(f"- {sentence}", markup=False, highlight=False, soft_wrap=True)), move
