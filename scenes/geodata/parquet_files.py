"""GeoParquet files: geometries and columns, read and written by geopandas and pyarrow (extra ``parquet``)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import CRSError, InputError, OutputError
from ...core.inputs import require_file
from ...core.plain_paths import plain_path
from .crs import file_crs
from .polygon_repair import Repair
from .wkb import geometries_of_wkb

__all__ = ["read_parquet", "write_parquet"]


#: What geopandas, pyarrow and pandas raise for columns and descriptions that they do not know.
_UNREADABLE = (ValueError, OSError, LookupError, TypeError, AttributeError, NotImplementedError, ArithmeticError)


def read_parquet(
    file: Path, *, needs_crs: bool = True
) -> tuple[NDArray[np.object_], dict[str, NDArray[Any]], str | None, list[Repair]]:
    """Return geometries, columns, CRS and repaired rings of a GeoParquet file.

    Columns that cannot be converted are left out.

    Parameters
    ----------
    file : Path
    needs_crs : bool
        Whether a CRS that cannot be read is an error; if not, it is None.
    """
    from pyproj.exceptions import CRSError as ProjError

    require_file(file, "a vector file, for instance .gpkg or .geojson")
    geopandas = _support(file, InputError)
    try:
        with plain_path(file) as path:
            frame = geopandas.read_parquet(path)
    except (*_UNREADABLE, shapely.errors.GEOSException, ProjError) as error:
        # One ring that is not closed, a date out of range or a CRS in other words spoils the whole.
        return _read_parts(file, error, needs_crs=needs_crs)
    columns = {}
    for name in frame.columns:
        if name != frame.geometry.name:
            values = frame[name].to_numpy()
            if values.dtype.kind == "O":
                values = np.where(frame[name].isna(), None, values)
            columns[str(name)] = values
    crs = None if frame.crs is None else file_crs(frame.crs, str(file))
    return np.asarray(frame.geometry.array, dtype=object), columns, crs, []


def _read_parts(
    file: Path, reason: Exception, *, needs_crs: bool
) -> tuple[NDArray[np.object_], dict[str, NDArray[Any]], str | None, list[Repair]]:
    """Return the same of a file whose geometries are WKB, column by column."""
    import pyarrow.parquet
    import pyproj
    from pyproj.exceptions import CRSError as ProjError

    try:
        with plain_path(file) as path:
            table = pyarrow.parquet.read_table(path)
        facts = json.loads(table.schema.metadata[b"geo"])
        name = facts["primary_column"]
        described = facts["columns"][name]
        wkb = np.array(table[name].to_pylist(), dtype=object)
        if described["encoding"] != "WKB":
            raise ValueError(described["encoding"])
    except _UNREADABLE:
        words = " ".join(str(reason).split()) or type(reason).__name__
        raise InputError(f"{file} cannot be read as GeoParquet: {words}") from reason
    geometries, closed = geometries_of_wkb(wkb, file)
    # A missing CRS is that of RFC 7946, as the standard says; null is none.
    named = described.get("crs", "OGC:CRS84")
    try:
        crs = None if named is None else file_crs(pyproj.CRS.from_user_input(named), str(file))
    except ProjError as error:
        if needs_crs:
            raise CRSError(f"{file}: its CRS cannot be read ({error}): name the CRS by crs=") from error
        crs = None
    columns: dict[str, NDArray[Any]] = {}
    for label in table.column_names:
        if label != name:
            try:
                column = table[label].to_pandas()
                values = np.array(column.to_numpy())
                if values.dtype.kind == "O":
                    values[column.isna().to_numpy()] = None
                columns[str(label)] = values
            except _UNREADABLE:
                continue
    return geometries, columns, crs, closed


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
