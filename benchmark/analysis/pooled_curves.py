"""Curves of detectors by evaluators that declare some, pooled over the scenes that all of them have a result on."""

from __future__ import annotations

from collections.abc import Sequence

from ...evaluators.base import Evaluation
from ..plan import KeyedEvaluator
from ..store.records import RunRow
from ..store.writer import Store
from .report_data import PooledCurves

__all__ = ["pooled_curves"]

#: Detectors whose curves can be distinguished.
_MOST_DETECTORS = 8


def pooled_curves(
    store: Store, rows: Sequence[RunRow], keyed: KeyedEvaluator, labels: Sequence[str]
) -> PooledCurves | None:
    """Return the pooled evaluation of each detector; None without curves, or without a common scene.

    Parameters
    ----------
    store : Store
    rows : sequence of RunRow
        Good runs.
    keyed : KeyedEvaluator
    labels : sequence of str
        Detectors in the order of the legend; the first eight that have a result are kept.
    """
    if not keyed.evaluator.curves:
        return None
    evaluations = store.evaluations([row.id for row in rows], keyed.evaluator, keyed.key)
    found: dict[str, dict[str, list[Evaluation]]] = {}
    for row in rows:
        if row.id in evaluations:
            found.setdefault(row.label, {}).setdefault(row.scene, []).append(evaluations[row.id])
    kept = [label for label in labels if label in found][:_MOST_DETECTORS]
    common = sorted(set.intersection(*(set(found[label]) for label in kept))) if kept else []
    if not common:
        return None
    pooled = {label: keyed.evaluator.pool([one for scene in common for one in found[label][scene]]) for label in kept}
    return PooledCurves(evaluator=keyed.label, scenes=tuple(common), pooled=pooled)
