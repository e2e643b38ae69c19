"""GeoParquet files: geometries and columns, read and written by geopandas and pyarrow (extra ``parquet``)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import InputError, OutputError
from ...core.inputs import require_file
from ...core.plain_paths import plain_path
from .crs import file_crs
from .polygon_repair import Repair
from .wkb import geometries_of_wkb

__all__ = ["read_parquet", "write_parquet"]


def read_parquet(file: Path) -> tuple[NDArray[np.object_], dict[str, NDArray[Any]], str | None, list[Repair]]:
    """Return geometries, columns, CRS and repaired rings of a GeoParquet file."""
    require_file(file, "a vector file, for instance .gpkg or .geojson")
    geopandas = _support(file, InputError)
    closed: list[Repair] = []
    try:
        try:
            with plain_path(file) as path:
                frame = geopandas.read_parquet(path)
        except shapely.errors.GEOSException:  # one ring that is not closed spoils the whole column
            frame, closed = _read_wkb(geopandas, file)
    except shapely.errors.GEOSException as error:
        raise InputError(f"{file}: a geometry is damaged ({error}): copy or download it again") from error
    except (ValueError, OSError) as error:
        raise InputError(f"{file} cannot be read as GeoParquet: {' '.join(str(error).split())}") from error
    columns = {}
    for name in frame.columns:
        if name != frame.geometry.name:
            values = frame[name].to_numpy()
            if values.dtype.kind == "O":
                values = np.where(frame[name].isna(), None, values)
            columns[str(name)] = values
    crs = None if frame.crs is None else file_crs(frame.crs)
    return np.asarray(frame.geometry.array, dtype=object), columns, crs, closed


def _read_wkb(geopandas: Any, file: Path) -> tuple[Any, list[Repair]]:
    """Return the frame of a file whose geometries are WKB, with its rings closed."""
    import pyarrow.parquet

    with plain_path(file) as path:
        table = pyarrow.parquet.read_table(path)
    facts = json.loads(table.schema.metadata[b"geo"])
    name = facts["primary_column"]
    geometries, closed = geometries_of_wkb(np.array(table[name].to_pylist(), dtype=object), file)
    # A missing CRS is that of RFC 7946, as the standard says; null is none.
    crs = facts["columns"][name].get("crs", "OGC:CRS84")
    return geopandas.GeoDataFrame(table.drop([name]).to_pandas(), geometry=list(geometries), crs=crs), closed


def write_parquet(
    file: Path, geometries: NDArray[np.object_], columns: Mapping[str, NDArray[Any]], crs: str | None
) -> None:
    """Write geometries and columns as GeoParquet."""
    geopandas = _support(file, OutputError)
    frame = geopandas.GeoDataFrame(dict(columns), geometry=list(geometries), crs=crs)
    frame.to_parquet(file)


def _support(file: Path, error: type[InputError] | type[OutputError]) -> Any:
    """Return geopandas, or raise an error that says how to install what GeoParquet needs."""
    try:
        import geopandas
        import pyarrow.parquet  # noqa: F401
    except ImportError as missing:
        raise error(f"{file.name}: GeoParquet needs pyarrow: pip install pyarrow") from missing
    return geopandas
