"""The verdicts of a stored run, with the geometry of its objects."""

from __future__ import annotations

from ...evaluators.base import Verdicts
from .writer import Store

__all__ = ["stored_verdicts"]


def stored_verdicts(store: Store, run_id: int, key: str) -> Verdicts | None:
    """Return the verdicts of a run by the evaluator of that key, geometry included; None when it gave none."""
    tables = store.verdict_tables(run_id, key)
    reference = store.scene(store.run(run_id).scene_id).reference
    if tables is None or reference is None:
        return None
    evaluator = dict(store.evaluators_of(run_id))[key].evaluator()
    return Verdicts(
        kinds=evaluator.verdict_kinds,
        measures=evaluator.measures,
        detection_table=tables[0],
        reference_table=tables[1],
        detected=store.detections(run_id),
        reference=reference,
    )
