"""Two detections of one place, paired, from three vector files that are too large for the memory.

Blocks, fates and intervals are those of `compare`; of the graphs of A and of B, one at a time is in memory.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

from ...scenes.geodata.footprint_stream import FootprintStream
from ..overlay.file_stores import FileStores, store_files
from ..overlay.left_out import repair_notes
from ..overlay.partition import PartGraph, find_pairs
from ..threshold_free.evaluator import ThresholdFree
from ..threshold_free.partitioned import block_tallies, evaluate_links, link_stores, require_exact
from ..threshold_free.verdicts import SideVerdicts
from .intervals import require_level, resampled_values
from .paired import PairedComparison, fates_of, found_of, paired
from .part_blocks import part_blocks
from .redrawn import REDRAWS, require_error
from .redrawn_files import redraw_files

__all__ = ["PairedFiles", "compare_files", "with_redraws"]

#: Places of A, B and the reference.
_COUPLES = ((0, 2), (1, 2), (0, 1))


@dataclass(frozen=True, eq=False)
class PairedFiles:
    """Three files that were compared in parts.

    Attributes
    ----------
    comparison : PairedComparison
        Its evaluations have no verdicts.
    files : FileStores
        A, B and the reference.
    pairs : PartGraph
    """

    comparison: PairedComparison
    files: FileStores
    pairs: PartGraph
    evaluator: ThresholdFree

    def verdicts(self, place: int) -> tuple[SideVerdicts, SideVerdicts]:
        """Return the verdicts of the detections and of the references; `place` is 0 for A, 1 for B."""
        return link_stores(self.evaluator, self.pairs, (place, 2)).verdicts()


def compare_files(
    evaluator: ThresholdFree,
    streams: tuple[FootprintStream, FootprintStream, FootprintStream],
    work: Path,
    *,
    interval: float = 95.0,
    parts: int | None = None,
    executor: Executor | None = None,
    say: Callable[[str], None] = lambda sentence: None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> PairedFiles:
    """Compare two detections of one place, A and B.

    Parameters
    ----------
    evaluator : ThresholdFree
    streams : tuple of FootprintStream
        A, B and the reference.
    work : Path
        Work folder; what is there of an interrupted comparison of the same files is used.
    interval : float
        Level of the intervals, percent.
    parts, executor, say, progress
        See `evaluate_files`.

    Raises
    ------
    CRSError
        The files have no common CRS.
    ParameterError
        No such level.
    UnsupportedError
        Areas by pixels.
    """
    require_level(interval)
    require_exact(evaluator)
    files = store_files(streams, ("a", "b", "reference"), work, parts=parts, executor=executor, say=say)
    say("comparing part by part")
    pairs = find_pairs(files.stores, _COUPLES, work / "pairs", progress=progress, executor=executor)
    blocks = part_blocks(pairs, _COUPLES)
    say(f"resampling {blocks.count} blocks")
    evaluations, resampled, found = [], [], []
    for place in (0, 1):
        links = link_stores(evaluator, pairs, (place, 2))
        evaluation = evaluate_links(evaluator, links, (files.stores[place], files.stores[2]))
        notes = (*repair_notes(files.repairs(place), files.repairs(2)), *evaluation.notes)
        evaluations.append(replace(evaluation, notes=notes))
        found.append(found_of(evaluator.verdict_kinds, links.verdicts()[1]))
        del links
        labels = blocks.labels[place], blocks.labels[2]
        every = block_tallies(evaluator, pairs, (place, 2), labels, blocks.count)
        resampled.append(resampled_values(evaluation, every))
    fates = fates_of(found[0], found[1])
    comparison = paired((evaluations[0], evaluations[1]), (resampled[0], resampled[1]), fates, blocks, interval)
    return PairedFiles(comparison, files, pairs, evaluator)


def with_redraws(
    found: PairedFiles,
    *,
    error: float,
    redraws: int | None = None,
    executor: Executor | None = None,
    say: Callable[[str], None] = lambda sentence: None,
) -> PairedFiles:
    """Return the comparison with the changes of its differences under a redrawn reference; see `redraw_differences`."""
    require_error(error)
    say(f"redrawing the reference {redraws or REDRAWS} times")
    comparison = found.comparison
    redrawn = redraw_files(
        found.evaluator,
        found.files.stores,
        found.files.work,
        [comparison.first.values, comparison.second.values],
        error=error,
        redraws=redraws or REDRAWS,
        executor=executor,
    )
    return replace(found, comparison=replace(comparison, redrawn=redrawn))
