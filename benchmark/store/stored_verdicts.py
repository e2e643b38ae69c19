"""The verdicts of a stored run, with the geometry of its objects."""

from __future__ import annotations

from ...evaluators.base import Evaluator
from ...evaluators.verdict_table import Verdicts
from ...scenes.geodata.footprints import Footprints
from .writer import Store

__all__ = ["stored_verdicts"]


def stored_verdicts(
    store: Store, run_id: int, evaluator: Evaluator, key: str, *, reference: Footprints | None = None
) -> Verdicts | None:
    """Return the verdicts of a run; None where none are stored.

    Parameters
    ----------
    store : Store
    run_id : int
    evaluator : Evaluator
    key : str
        Of its evaluations in the store.
    reference : Footprints, optional
        The scene's reference, where the caller has read it already.
    """
    tables = store.verdict_tables(run_id, key)
    if tables is not None and reference is None:
        reference = store.scene(store.run(run_id).scene_id).reference
    if tables is None or reference is None:
        return None
    return Verdicts(
        kinds=evaluator.verdict_kinds,
        measures=evaluator.measures,
        detection_table=tables[0],
        reference_table=tables[1],
        detected=store.detections(run_id),
        reference=reference,
    )
