"""A stored run as vector layers: detections and references with their verdicts, for a GIS."""

from __future__ import annotations

import os

from ..benchmark.store.stored_verdicts import stored_verdicts
from ..benchmark.store.writer import Store
from ..core.errors import InputError
from ..core.wording import counted
from ..scenes.geodata.vector_files import write_footprints
from .verdict_layers import write_verdicts

__all__ = ["export_run"]


def export_run(
    store: Store, run_id: int, path: str | os.PathLike[str], *, evaluator: str | None = None, overwrite: bool = False
) -> str:
    """Write a run as vector file: detections and references with verdicts where an evaluator gave them.

    Parameters
    ----------
    store : Store
    run_id : int
    path : path
    evaluator : str, optional
        Name of the evaluator; by default the first that evaluated the run.
    overwrite : bool

    Returns
    -------
    what : str
        Description of what was written.
    """
    row = store.run(run_id)
    if row.status != "ok":
        raise InputError(f"run {run_id} has no footprints to export: its status is {row.status} ({row.reason})")
    known = store.evaluators_of(run_id)
    if evaluator is not None and evaluator not in [recipe.use for _, recipe in known]:
        names = ", ".join(recipe.use for _, recipe in known) or "none"
        raise InputError(f"run {run_id} was not evaluated by {evaluator!r} but by {names}")
    for key, recipe in known:
        if evaluator in (None, recipe.use):
            verdicts = stored_verdicts(store, run_id, recipe.evaluator(), key)
            if verdicts is not None:
                write_verdicts(verdicts, path, overwrite=overwrite)
                found, truth = len(verdicts.detected), len(verdicts.reference)
                return f"{counted(found, 'detection')}, {counted(truth, 'reference')} by {recipe.use}"
    detected = store.detections(run_id)
    write_footprints(detected, path, layer="detections", overwrite=overwrite)
    return counted(len(detected), "detection")
