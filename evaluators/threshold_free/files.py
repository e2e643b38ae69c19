"""Comparing two vector files in parts: from the files to indices and verdicts, with a bounded part in memory."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

from ...scenes.geodata.footprint_stream import FootprintStream
from ..overlay.file_stores import FileStores, store_files
from ..overlay.left_out import repair_notes
from .evaluator import ThresholdFree, ThresholdFreeEvaluation
from .partitioned import evaluate_stores, require_exact
from .verdicts import SideVerdicts

__all__ = ["FileComparison", "evaluate_files"]


@dataclass(frozen=True, eq=False)
class FileComparison:
    """Two files that were compared in parts.

    Attributes
    ----------
    evaluation : ThresholdFreeEvaluation
    verdicts : callable
        Returns the verdicts of the detections and of the references.
    files : FileStores
        Detected and reference.
    """

    evaluation: ThresholdFreeEvaluation
    verdicts: Callable[[], tuple[SideVerdicts, SideVerdicts]]
    files: FileStores


def evaluate_files(
    evaluator: ThresholdFree,
    streams: tuple[FootprintStream, FootprintStream],
    work: Path,
    *,
    parts: int | None = None,
    executor: Executor | None = None,
    say: Callable[[str], None] = lambda sentence: None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> FileComparison:
    """Compare two files.

    Parameters
    ----------
    evaluator : ThresholdFree
    streams : tuple of FootprintStream
        Detected and reference.
    work : Path
        Work folder; what is there of an interrupted evaluation of the same files is used.
    parts : int, optional
        By default one for each 200 000 footprints. The result does not depend on it.
    executor : Executor, optional
        Where files are read and parts are measured; its processes must see the files and the work folder under the
        same paths. By default on this machine.
    say : callable
        Takes a sentence on what is being done.
    progress : callable
        Takes the number of finished parts and of all.

    Raises
    ------
    CRSError
        The files have no common CRS.
    UnsupportedError
        Areas by pixels.
    """
    require_exact(evaluator)
    files = store_files(streams, ("detected", "reference"), work, parts=parts, executor=executor, say=say)
    say("comparing part by part")
    detected, reference = files.stores
    evaluation, verdicts = evaluate_stores(
        evaluator, detected, reference, work / "pairs", progress=progress, executor=executor
    )
    notes = (*repair_notes(files.repairs(0), files.repairs(1)), *evaluation.notes)
    return FileComparison(replace(evaluation, notes=notes), verdicts, files)
