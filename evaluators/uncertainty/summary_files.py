"""The uncertainty of one comparison in parts: intervals over blocks, and changes under a redrawn reference."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor

from ..overlay.partition import PartGraph
from ..threshold_free.evaluator import ThresholdFree
from ..threshold_free.files import FileComparison
from ..threshold_free.partitioned import block_tallies
from .intervals import RESAMPLES, Intervals, interval_of, require_level, resampled_values
from .part_blocks import part_blocks
from .redrawn import REDRAWS, require_error
from .redrawn_files import redraw_files
from .summary import Uncertainty

__all__ = ["uncertainty_of_files"]


def uncertainty_of_files(
    evaluator: ThresholdFree,
    comparison: FileComparison,
    *,
    interval: float | None = None,
    reference_error: float | None = None,
    redraws: int | None = None,
    executor: Executor | None = None,
    say: Callable[[str], None] = lambda sentence: None,
) -> Uncertainty:
    """Return the uncertainty of two files that were compared in parts; see `uncertainty_of`.

    Parameters
    ----------
    evaluator : ThresholdFree
    comparison : FileComparison
    interval : float, optional
        Level, percent.
    reference_error : float, optional
        Digitising error, m.
    redraws : int, optional
    executor : Executor, optional
        See `evaluate_files`.
    say : callable
        Takes a sentence on what is being done.
    """
    files, evaluation = comparison.files, comparison.evaluation
    intervals = redrawn = None
    if interval is not None:
        require_level(interval)
        pairs = PartGraph(files.stores, files.work.absolute() / "pairs")
        blocks = part_blocks(pairs, [(0, 1)])
        say(f"resampling {blocks.count} blocks")
        every = block_tallies(evaluator, pairs, (0, 1), (blocks.labels[0], blocks.labels[1]), blocks.count)
        intervals = Intervals(
            level=interval,
            blocks=blocks.count,
            groups=blocks.groups,
            resamples=RESAMPLES,
            ends={
                key: interval_of(column, blocks.count, interval)
                for key, column in resampled_values(evaluation, every).items()
            },
        )
    if reference_error is not None:
        require_error(reference_error)
        say(f"redrawing the reference {redraws or REDRAWS} times")
        redrawn = redraw_files(
            evaluator,
            files.stores,
            files.work,
            [evaluation.values],
            error=reference_error,
            redraws=redraws or REDRAWS,
            executor=executor,
        )
    return Uncertainty(intervals=intervals, redraws=redrawn)
