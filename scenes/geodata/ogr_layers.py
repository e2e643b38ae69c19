"""Layers as OGR reads them, with what real files hold that its Python wrapper refuses.

Dates that do not exist become "no date", texts that are not in the encoding of their file are read byte
by byte, and layers whose declared geometry type has Z or M beside "any geometry" are read with the type left open.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError

__all__ = ["Layer", "layer_names", "quiet", "read_layer"]

#: Type of numpy to that of a field of OGR; any other is read as text.
_TYPES = {"bool": "Integer", "int16": "Integer", "int32": "Integer", "int64": "Integer64"}
_TYPES |= dict.fromkeys(("float32", "float64"), "Real")


class Layer(NamedTuple):
    """Geometries and columns of a layer.

    Attributes
    ----------
    wkb : ndarray of bytes, shape (n,), optional
        None for a table without geometry.
    columns : dict of str to ndarray, shape (n,)
    crs : str, optional
    """

    wkb: NDArray[np.object_] | None
    columns: dict[str, NDArray[Any]]
    crs: str | None


def layer_names(path: Path) -> list[str]:
    """Return the names of the layers that have geometry; of all layers where none has."""
    import pyogrio
    from pyogrio.errors import GeometryError

    with quiet():
        try:
            listed = pyogrio.list_layers(path)
        except GeometryError:  # see _read
            return _names_in_geopackage(path) or [path.stem]
    return [str(name) for name, kind in listed if kind is not None] or [str(name) for name in listed[:, 0]]


def read_layer(path: Path, name: str) -> Layer:
    """Read one layer.

    Raises
    ------
    pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError
        What OGR itself cannot read.
    """
    with quiet():
        return _read(path, name)


def _read(path: Path, name: str) -> Layer:
    import pyogrio
    import pyogrio.raw
    from pyogrio.errors import CRSError, GeometryError

    source: Path | bytes = path
    encoding: str | None = None
    dates: list[str] = []
    while True:
        try:
            meta, _, wkb, fields = pyogrio.raw.read(source, layer=name, encoding=encoding)
            break
        except GeometryError:  # pyogrio has no name for the type code of "any geometry" with Z or M
            if source is not path:
                raise
            source = _virtual(path, name)
        except UnboundLocalError:  # pyogrio fails on a CRS that PROJ reads and cannot write as WKT
            if source is not path:
                raise
            source = _virtual(path, name, with_crs=False)
        except CRSError:  # a description of a CRS that ends early
            if source is not path:
                raise
            source = _virtual(path, name, with_crs=False)
        except UnicodeDecodeError:
            if encoding is not None:
                raise
            encoding = "ISO-8859-1"  # every byte is a letter
        except ValueError:  # dates that do not exist
            if dates:
                raise
            info = pyogrio.read_info(source, layer=name, encoding=encoding)
            kinds = dict(zip(map(str, info["fields"]), map(str, info["dtypes"]), strict=True))
            dates = [label for label, kind in kinds.items() if kind.startswith("datetime")]
            if not dates:
                raise
            source = _virtual(path, name, kinds)
    if path.suffix.lower() == ".fgb":
        # Other formats count what they read; the header of this one counts what was written.
        announced = pyogrio.read_info(path, layer=name)["features"]
        if len(wkb) < announced:
            raise InputError(
                f"{path.name} is truncated: {len(wkb)} of the {announced} features that its header announces are "
                "there; copy or download it again"
            )
    columns = dict(zip(map(str, meta["fields"]), fields, strict=True))
    for label, column in columns.items():
        if label in dates:
            columns[label] = _dates(column)
        elif encoding is not None and column.dtype.kind == "O":
            columns[label] = np.array([_decoded(value) for value in column], dtype=object)
    return Layer(wkb, columns, meta["crs"])


def _dates(texts: NDArray[Any]) -> NDArray[np.datetime64]:
    """Return ISO 8601 texts as dates in milliseconds, UTC dropped; NaT for what is no date."""
    dates = np.full(len(texts), np.datetime64("NaT"), dtype="datetime64[ms]")
    for row, text in enumerate(texts):
        if isinstance(text, str):
            try:
                dates[row] = np.datetime64(text.replace("/", "-")[:23], "ms")
            except ValueError:
                continue
    return dates


def _decoded(value: Any) -> Any:
    """Return a text of single bytes as UTF-8 where it is; the fault of one text changes no other."""
    if not isinstance(value, str):
        return value
    try:
        return value.encode("ISO-8859-1").decode()
    except UnicodeError:
        return value


def _virtual(path: Path, name: str, kinds: Mapping[str, str] | None = None, *, with_crs: bool = True) -> bytes:
    """Return a virtual layer of OGR that is `name` of a file, with its geometry type left open.

    With `kinds`, the numpy types of the columns by name, dates are texts.
    """
    crs = "" if with_crs else "<LayerSRS>NULL</LayerSRS>"
    fields = "".join(
        f'<Field name={quoteattr(label)} src={quoteattr(label)} type="{_TYPES.get(kind, "String")}"/>'
        for label, kind in (kinds or {}).items()
    )
    return (
        f"<OGRVRTDataSource><OGRVRTLayer name={quoteattr(name)}><SrcDataSource>{escape(str(path.absolute()))}"
        f"</SrcDataSource><SrcLayer>{escape(name)}</SrcLayer><GeometryType>wkbUnknown</GeometryType>{crs}{fields}"
        "</OGRVRTLayer></OGRVRTDataSource>"
    ).encode()


def _names_in_geopackage(path: Path) -> list[str]:
    import sqlite3

    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as db:
            rows = db.execute("SELECT table_name FROM gpkg_geometry_columns ORDER BY rowid").fetchall()
    except sqlite3.Error:
        return []
    return [str(row[0]) for row in rows]


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress GDAL's warnings about what is intended (no CRS, short names, NaN in JSON)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
