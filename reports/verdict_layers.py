"""Verdicts as vector layers, to open in a GIS."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..evaluators.base import Verdicts
from ..scenes.geodata.vector_files import write_layers

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["write_verdicts"]


def write_verdicts(
    verdicts: Verdicts, path: str | os.PathLike[str], *, crs: str | None, overwrite: bool = False
) -> None:
    """Write one row per object with verdict, partner and reason.

    A GeoPackage gets the layers ``detections`` and ``references``; other formats, which hold one layer, get both in
    one, told apart by the column ``side``.
    """
    sides = {"detections": verdicts.detections, "references": verdicts.references}
    layers = {name: (_geometries(table), _columns(table)) for name, table in sides.items()}
    if Path(path).suffix.lower() != ".gpkg":
        import pandas as pd

        joined = pd.concat([table.assign(side=name[:-1]) for name, table in sides.items()], ignore_index=True)
        layers = {"verdicts": (_geometries(joined), _columns(joined))}
    write_layers(layers, path, crs=crs, overwrite=overwrite)


def _geometries(table: pd.DataFrame) -> NDArray[np.object_]:
    return np.asarray(table["geometry"].to_numpy(), dtype=object)


def _columns(table: pd.DataFrame) -> Mapping[str, NDArray[Any]]:
    columns: dict[str, NDArray[Any]] = {}
    for name in table.columns.drop("geometry"):
        column = table[name]
        # GDAL takes a GeoJSON property "id" for the feature's own number, which must be unique.
        name = "source_id" if name == "id" else name
        if str(column.dtype) == "Int64":
            missing = column.isna().to_numpy()
            columns[name] = np.ma.masked_array(column.fillna(-1).to_numpy(dtype=np.int64), missing)
        else:
            columns[name] = column.to_numpy()
    return columns
