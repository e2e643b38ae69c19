"""Comparing two sets of this process in parts: the same numbers as of whole sets, with one part in memory at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from ...scenes.geodata.crs import common_crs
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.outline_batch import OutlineBatch
from ..overlay.left_out import repair_notes
from ..overlay.outline_store import Division, OutlineStore
from ..verdict_table import VerdictTable
from .evaluator import ThresholdFree, ThresholdFreeEvaluation
from .partitioned import evaluate_stores

__all__ = ["evaluate_sets"]

#: Footprints that are written at a time.
_BATCH = 1 << 16


def evaluate_sets(
    evaluator: ThresholdFree, detected: Footprints, reference: Footprints, work: Path, *, parts: int
) -> tuple[ThresholdFreeEvaluation, tuple[VerdictTable, ...]]:
    """Compare two sets; return the evaluation, without verdicts, and the verdict tables of both sides.

    Parameters
    ----------
    evaluator : ThresholdFree
    detected, reference : Footprints
    work : Path
        Empty folder for the outlines by place and for what is found in each part.
    parts : int
        The result does not depend on it.

    Raises
    ------
    CRSError
        The sets have no common CRS.
    UnsupportedError
        Areas by pixels.
    """
    if len(detected) and len(reference):
        common_crs(detected.crs, reference.crs, (detected.source, reference.source))
    division = Division(parts)
    stores = [OutlineStore(work / name, division) for name in ("detected", "reference")]
    for store, footprints in zip(stores, (detected, reference), strict=True):
        store.write(_batches(footprints))
        codes = None if footprints.building_ids is None else footprints.building_codes
        store.finish(codes, source=footprints.source)
    evaluation, verdicts = evaluate_stores(evaluator, stores[0], stores[1], work / "pairs")
    notes = (*repair_notes(detected, reference), *evaluation.notes)
    return replace(evaluation, notes=notes), tuple(side.whole() for side in verdicts())


def _batches(footprints: Footprints) -> Iterator[OutlineBatch]:
    for first in range(0, len(footprints), _BATCH):
        yield OutlineBatch.of(footprints[first : first + _BATCH])
