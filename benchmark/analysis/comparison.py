"""Comparing two results stores: the same detectors on the same scenes, paired by scene."""

from __future__ import annotations

import statistics
from collections.abc import Mapping

from ...core.errors import InputError
from ...core.wording import counted
from ...evaluators.base import Index
from ..plan import KeyedEvaluator
from ..store.records import RunRow
from ..store.writer import Store
from .inference import bootstrap_interval
from .report_contents import newest_runs, stored_evaluators
from .results import ComparedRow, StoreComparison
from .versions import version_names

__all__ = ["compare_stores"]

#: Values by detector and scene, one per seed.
_Cells = dict[tuple[str, str], list[Mapping[str, float | None]]]


def compare_stores(
    first: Store, second: Store, *, detector: str | None = None, scene: str | None = None
) -> StoreComparison:
    """Compare the newest runs of two stores by the first evaluator that both have.

    Scenes are the same when their content hash is; detectors when their label is.

    Parameters
    ----------
    first, second : Store
    detector, scene : str, optional
        Patterns for label and scene name.

    Raises
    ------
    InputError
        No evaluator has evaluated runs of both stores.
    """
    rows = [newest_runs(store, detector=detector, scene=scene) for store in (first, second)]
    evaluators = [stored_evaluators(store, own) for store, own in zip((first, second), rows, strict=True)]
    labels = [{keyed.label: keyed for keyed in own} for own in evaluators]
    common = next((label for label in labels[0] if label in labels[1]), None)
    if common is None:
        raise InputError(
            f"{first.path} and {second.path} have no evaluator in common: evaluate one of them with 'roofbench score'"
        )
    one, two = (
        _cells(store, own, known[common]) for store, own, known in zip((first, second), rows, labels, strict=True)
    )
    evaluator = labels[0][common].evaluator
    shared = sorted(one.keys() & two.keys())
    found = []
    for label in dict.fromkeys(label for label, _ in shared):
        scenes = [place for found_label, place in shared if found_label == label]
        for index in evaluator.indices:
            row = (
                _compared(label, index, [(one[label, place], two[label, place]) for place in scenes])
                if index.main
                else None
            )
            if row is not None:
                found.append(row)
    notes = []
    versions = [", ".join(version_names(own)) for own in rows]
    if versions[0] != versions[1]:
        notes.append(
            f"versions of the benchmark: A {versions[0]}, B {versions[1]}: differences may come from other "
            "definitions or another generator"
        )
    for name, cells, other in (("A", one, two), ("B", two, one)):
        alone = cells.keys() - other.keys()
        if alone:
            notes.append(f"only in {name}: {counted(len(alone), 'pair')} of detector and scene, not compared")
    return StoreComparison(
        first=first.path.name, second=second.path.name, evaluator=common, rows=tuple(found), notes=tuple(notes)
    )


def _cells(store: Store, rows: list[RunRow], keyed: KeyedEvaluator) -> _Cells:
    values = store.index_values([row.id for row in rows if row.status == "ok"], keyed.key)
    hashes = store.scene_hashes()
    cells: _Cells = {}
    for row in rows:
        content = hashes.get(row.scene_id)
        if row.id in values and content:
            cells.setdefault((row.label, content), []).append(values[row.id])
    return cells


def _compared(
    label: str,
    index: Index,
    pairs: list[tuple[list[Mapping[str, float | None]], list[Mapping[str, float | None]]]],
) -> ComparedRow | None:
    """Return the row of an index over the scenes where both stores define it; None where there is none."""
    means = [(_mean(old, index), _mean(new, index)) for old, new in pairs]
    known = [(old, new) for old, new in means if old is not None and new is not None]
    if not known:
        return None
    differences = [new - old for old, new in known]
    low, high = bootstrap_interval(differences) or (None, None)
    return ComparedRow(
        detector=label,
        index=index,
        first=statistics.fmean(old for old, _ in known),
        second=statistics.fmean(new for _, new in known),
        difference=statistics.fmean(differences),
        low=low,
        high=high,
        scenes=len(known),
    )


def _mean(runs: list[Mapping[str, float | None]], index: Index) -> float | None:
    values = [value for run in runs if (value := run.get(index.key)) is not None]
    return statistics.fmean(values) if values else None
