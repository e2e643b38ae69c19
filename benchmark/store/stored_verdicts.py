"""The verdicts of a stored run, with the geometry of its objects."""

from __future__ import annotations

from typing import Any

from ...evaluators.base import Verdicts
from ...scenes.geodata.footprints import Footprints
from .writer import Store

__all__ = ["stored_verdicts"]


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
