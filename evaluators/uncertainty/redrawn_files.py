"""Redrawn references of files that are too large for the memory: how far indices and differences move.

The reference is redrawn a few footprints at a time into a store of its own, and compared in parts, as `redraw_changes`
and `redraw_differences` do in memory. The values of each redraw are kept in the work folder, so that an interrupted
comparison continues after the last one.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.outline_batch import OutlineBatch
from ..overlay.outline_arrays import polygons_of
from ..overlay.outline_store import OutlineStore
from ..overlay.partition import find_pairs
from ..threshold_free.evaluator import ThresholdFree
from ..threshold_free.partitioned import evaluate_links, link_stores
from .redrawn import REDRAWS, Redraws, changes_of, redraw, value_differences

__all__ = ["redraw_files"]

#: Footprints that are redrawn at a time.
_BATCH = 1 << 16

_Values = Mapping[str, float | None]


def redraw_files(
    evaluator: ThresholdFree,
    stores: Sequence[OutlineStore],
    work: Path,
    given: Sequence[_Values],
    *,
    error: float,
    redraws: int = REDRAWS,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Redraws:
    """Return how far the indices of one set of detections, or the differences of two, move; see `redraw_changes`.

    Parameters
    ----------
    evaluator : ThresholdFree
    stores : sequence of OutlineStore
        One or two sets of detections, then the reference.
    work : Path
    given : sequence of mapping
        Values of the indices of each set of detections by the reference as it is.
    error : float
        Standard deviation of each coordinate of a redrawn corner, m.
    redraws : int
    executor : Executor, optional
        See `find_pairs`.
    progress : callable
        Takes the number of finished redraws and of all.
    """
    found = []
    for number in range(redraws):
        record = work / f"redrawn-{error!r}-{number}.json"
        if not record.is_file():
            values = _redrawn_values(evaluator, stores, work, error=error, number=number, executor=executor)
            unfinished = record.with_suffix(".unfinished")
            unfinished.write_text(json.dumps(values), encoding="utf-8")
            unfinished.replace(record)
        found.append(_moved(json.loads(record.read_text(encoding="utf-8"))))
        progress(number + 1, redraws)
    return Redraws(error=error, redraws=redraws, changes=changes_of(_moved(given), found))


def _moved(values: Sequence[_Values]) -> _Values:
    """Return the values of one set of detections, or the differences of two."""
    return values[0] if len(values) == 1 else value_differences(values[0], values[1])


def _redrawn_values(
    evaluator: ThresholdFree,
    stores: Sequence[OutlineStore],
    work: Path,
    *,
    error: float,
    number: int,
    executor: Executor | None,
) -> list[_Values]:
    """Return the values of the indices of each set of detections by a redrawn reference."""
    *detected, reference = stores
    folder = work / "redrawn"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    truth = OutlineStore(folder.absolute() / "reference", reference.division)
    rows = []

    def batches() -> Iterator[OutlineBatch]:
        for batch in _redrawn_batches(reference, error, number):
            rows.append(batch.ids)
            yield batch

    truth.write(batches())
    kept = np.concatenate([np.empty(0, dtype=np.int64), *rows])
    truth.finish(reference.objects.building_codes[kept])
    couples = [(place, len(detected)) for place in range(len(detected))]
    pairs = find_pairs(
        (*detected, truth), couples, folder / "pairs", progress=lambda done, total: None, executor=executor
    )
    values = []
    for place, store in enumerate(detected):
        links = link_stores(evaluator, pairs, (place, len(detected)))
        values.append(evaluate_links(evaluator, links, (store, truth)).values)
    shutil.rmtree(folder)
    return values


def _redrawn_batches(store: OutlineStore, error: float, number: int) -> Iterator[OutlineBatch]:
    """Yield the redrawn outlines; ids are rows of the store."""
    for begin in range(0, len(store.objects), _BATCH):
        rows = np.arange(begin, min(begin + _BATCH, len(store.objects)))
        polygons = polygons_of(store.outlines(rows), np.arange(len(rows)))
        found = redraw(replace(Footprints.of(polygons), ids=rows), error, number=number)
        yield OutlineBatch.of(found)
