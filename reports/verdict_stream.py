"""Verdicts of a comparison in parts as vector layers, written batch by batch beside the features of the files."""

from __future__ import annotations

import os
from functools import partial
from typing import Any

import numpy as np

from ..evaluators.in_parts import FileComparison, SideVerdicts
from .qgis_style import verdict_styles
from .streamed_layers import Rows, StreamedLayer, write_streamed

__all__ = ["verdict_fields", "verdict_rows", "write_verdict_stream"]

_MEASURES = ("distance", "overlap_area", "iou", "rmse")


def write_verdict_stream(comparison: FileComparison, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write one row per object with verdict, partner and reason; the file appears whole or not at all.

    A GeoPackage gets the layers ``detections`` and ``references``; other formats, which hold one layer, get both in
    one, distinguished by the column ``side``.
    """
    sides, files = comparison.verdicts(), comparison.files
    layers = [
        StreamedLayer(
            f"{side}s",
            side,
            files.streams[place],
            files.repaired(place),
            verdict_fields(),
            partial(verdict_rows, sides[place]),
        )
        for place, side in enumerate(("detection", "reference"))
    ]
    write_streamed(
        layers,
        path,
        layer="verdicts",
        styles=verdict_styles(comparison.evaluation.evaluator.verdict_kinds),
        overwrite=overwrite,
        scratch=files.work,
    )


def verdict_fields() -> dict[str, Any]:
    """Return the Arrow types of the columns of `verdict_rows`."""
    import pyarrow

    return {
        "verdict": pyarrow.string(),
        "partner": pyarrow.int64(),
        **dict.fromkeys(_MEASURES, pyarrow.float64()),
        "reason": pyarrow.string(),
    }


def verdict_rows(verdicts: SideVerdicts) -> Rows:
    """Return the verdicts of one side as columns."""
    return Rows(verdicts.ids, partial(_columns, verdicts))


def _columns(verdicts: SideVerdicts, part: slice) -> dict[str, Any]:
    import pyarrow

    table = verdicts.table(part)
    return {
        "verdict": pyarrow.array([*table.kinds]).take(pyarrow.array(table.kind)),
        "partner": pyarrow.array(table.partner, mask=table.partner < 0),
        **{name: pyarrow.array(values, mask=np.isnan(values)) for name, values in table.measures.items()},
        "reason": pyarrow.array(table.reasons[:], pyarrow.string()),
    }
