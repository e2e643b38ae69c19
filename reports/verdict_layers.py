"""Verdicts as vector layers, to open in a GIS."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..evaluators.verdict_table import Verdicts
from ..scenes.geodata.vector_files import write_layers

__all__ = ["write_verdicts"]


def write_verdicts(verdicts: Verdicts, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write one row per object with verdict, partner and reason.

    A GeoPackage gets the layers ``detections`` and ``references``; other formats, which hold one layer, get both in
    one, distinguished by the column ``side``.
    """
    # GDAL takes a GeoJSON property "id" for the feature's own number, which must be unique.
    tables = [
        {"source_id" if name == "id" else name: column for name, column in verdicts.columns(side).items()}
        for side, _, _ in verdicts.sides
    ]
    polygons = [footprints.polygons for _, _, footprints in verdicts.sides]
    if Path(path).suffix.lower() == ".gpkg":
        layers = {f"{side}s": (polygons[place], tables[place]) for place, (side, _, _) in enumerate(verdicts.sides)}
    else:
        for table, (side, _, footprints) in zip(tables, verdicts.sides, strict=True):
            table["side"] = np.full(len(footprints), side, dtype=object)
        names = dict.fromkeys(name for table in tables for name in table)
        columns = {name: _joined([table.get(name) for table in tables], list(map(len, polygons))) for name in names}
        layers = {"verdicts": (np.concatenate(polygons), columns)}
    write_layers(layers, path, crs=verdicts.crs, overwrite=overwrite)


def _joined(columns: Sequence[NDArray[Any] | None], counts: Sequence[int]) -> NDArray[Any]:
    """Return a column of both sides one below the other; what one side does not have is missing."""
    kind = next(column.dtype for column in columns if column is not None)
    if any(column is None for column in columns) and kind.kind not in "iuf":
        kind = np.dtype(object)
    parts: list[NDArray[Any]] = []
    for column, count in zip(columns, counts, strict=True):
        if column is not None:
            parts.append(column)
        elif kind.kind == "f":
            parts.append(np.full(count, np.nan))
        elif kind.kind in "iu":
            parts.append(np.ma.masked_array(np.zeros(count, dtype=kind), mask=True))
        else:
            parts.append(np.full(count, None, dtype=object))
    joined = np.concatenate([np.ma.getdata(part) for part in parts])
    if any(map(np.ma.isMaskedArray, parts)):
        return np.ma.masked_array(joined, np.concatenate([np.ma.getmaskarray(part) for part in parts]))
    return joined
