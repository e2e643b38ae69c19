"""Stored runs as layers: detections and references with their verdicts, to open in a GIS or to draw."""

from __future__ import annotations

import os
from typing import Any

from ...core.errors import InputError
from ...evaluators.base import Verdicts
from ...reports.verdict_layers import write_verdicts
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.vector_files import write_footprints
from .writer import Store

__all__ = ["export_run", "stored_verdicts"]


def stored_verdicts(store: Store, run_id: int, key: str) -> Verdicts | None:
    """Return the verdicts of a run by the evaluator of that key, geometry included; None when it gave none."""
    rows = store.verdicts(run_id, key)
    reference = store.scene(store.run(run_id).scene_id).reference
    if reference is None or not (rows["detection"] or rows["reference"]):
        return None
    sides: dict[str, Footprints] = {"detection": store.detections(run_id), "reference": reference}
    columns: dict[str, dict[str, Any]] = {}
    for side, footprints in sides.items():
        names = dict.fromkeys(name for row in rows[side] for name in row)
        columns[side] = {name: [row.get(name) for row in rows[side]] for name in names}
        columns[side]["geometry"] = footprints.polygons
        columns[side] = {**footprints.attributes, **columns[side]}
    return Verdicts(columns["detection"], columns["reference"])


def export_run(
    store: Store, run_id: int, path: str | os.PathLike[str], *, evaluator: str | None = None, overwrite: bool = False
) -> str:
    """Write a run as vector file: detections and references with verdicts where an evaluator gave them.

    Parameters
    ----------
    evaluator : str, optional
        Name of the evaluator; the first that judged the run by default.

    Returns
    -------
    what : str
        What was written, in words.
    """
    row = store.run(run_id)
    if row.status != "ok":
        raise InputError(f"run {run_id} has no footprints to export: it {row.status} ({row.reason})")
    crs = store.scene(row.scene_id).crs
    known = store.evaluators_of(run_id)
    if evaluator is not None and evaluator not in [recipe.use for _, recipe in known]:
        names = ", ".join(recipe.use for _, recipe in known) or "none"
        raise InputError(f"run {run_id} was not judged by {evaluator!r} but by {names}")
    for key, recipe in known:
        if evaluator in (None, recipe.use):
            verdicts = stored_verdicts(store, run_id, key)
            if verdicts is not None:
                write_verdicts(verdicts, path, crs=crs, overwrite=overwrite)
                return f"{len(verdicts.detections)} detections, {len(verdicts.references)} references by {recipe.use}"
    detected = store.detections(run_id)
    write_footprints(detected, path, layer="detections", overwrite=overwrite)
    return f"{len(detected)} detections"
