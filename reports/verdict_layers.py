"""Verdicts as vector layers, to open in a GIS."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..evaluators.uncertainty.paired import PairedComparison
from ..evaluators.verdict_table import Verdicts
from ..scenes.geodata.vector_files import write_layers
from .qgis_style import pair_styles, verdict_styles

__all__ = ["write_pair", "write_verdicts"]


def write_verdicts(verdicts: Verdicts, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write one row per object with verdict, partner and reason.

    A GeoPackage gets the layers ``detections`` and ``references``, each with a style for QGIS; other formats, which
    hold one layer, get both in one, distinguished by the column ``side``.
    """
    tables = {f"{side}s": (footprints.polygons, verdicts.columns(side)) for side, _, footprints in verdicts.sides}
    _write(tables, path, crs=verdicts.crs, styles=verdict_styles(verdicts.kinds), overwrite=overwrite)


def write_pair(found: PairedComparison, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the fate of each reference in two detections, and the verdicts of both.

    A GeoPackage gets the layers ``references``, ``detections_a`` and ``detections_b``; other formats get all in one,
    distinguished by the column ``side``.

    Raises
    ------
    ValueError
        The evaluator gives no verdicts.
    """
    one, two = found.first.verdicts, found.second.verdicts
    if one is None or two is None:
        raise ValueError("an evaluator without verdicts has no objects to write")
    tables = {
        "references": (one.reference.polygons, found.references),
        "detections_a": (one.detected.polygons, one.columns("detection")),
        "detections_b": (two.detected.polygons, two.columns("detection")),
    }
    _write(tables, path, crs=one.crs or two.crs, styles=pair_styles(one.kinds), overwrite=overwrite, layer="comparison")


def _write(
    tables: Mapping[str, tuple[NDArray[np.object_], Mapping[str, NDArray[Any]]]],
    path: str | os.PathLike[str],
    *,
    crs: str | None,
    styles: Mapping[str, str],
    overwrite: bool,
    layer: str = "verdicts",
) -> None:
    """Write tables as layers of a GeoPackage, else as one layer with the column ``side`` that names the table."""
    # GDAL takes a GeoJSON property "id" for the feature's own number, which must be unique.
    named = {
        key: (polygons, {"source_id" if name == "id" else name: values for name, values in table.items()})
        for key, (polygons, table) in tables.items()
    }
    if Path(path).suffix.lower() != ".gpkg":
        for key, (polygons, table) in named.items():
            table["side"] = np.full(
                len(polygons), key.replace("detections", "detection").replace("references", "reference"), dtype=object
            )
        names = dict.fromkeys(name for _, table in named.values() for name in table)
        counts = [len(polygons) for polygons, _ in named.values()]
        columns = {name: _joined([table.get(name) for _, table in named.values()], counts) for name in names}
        named = {layer: (np.concatenate([polygons for polygons, _ in named.values()]), columns)}
    write_layers(named, path, crs=crs, styles=styles, overwrite=overwrite)


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
