"""Columns of vector files: what a table column can hold, and under which name each driver accepts it.

Kept as they are: truth values, whole numbers to 64 bits, floating-point numbers, texts, dates. Objects become numbers
when all are, else texts; None, NaN, NaT and masked entries are written as no value.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import OutputError

__all__ = ["labels_of", "missing", "storable_columns"]

#: Names in small letters that a driver keeps for itself.
_TAKEN = {"GPKG": ("fid", "geom"), "Parquet": ("geometry",)}


def missing(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which entries of a column hold nothing: masked, None, NaN, NaT or an empty text."""
    lacking = np.ma.getmaskarray(values).copy()
    plain = np.ma.getdata(values)
    if plain.dtype.kind == "f":
        lacking |= np.isnan(plain)
    elif plain.dtype.kind in "mM":
        lacking |= np.isnat(plain)
    elif plain.dtype.kind == "O":
        lacking |= np.fromiter((_is_nothing(value) for value in plain), dtype=bool, count=len(plain))
    elif plain.dtype.kind in "US":
        lacking |= plain == plain.dtype.type()
    return lacking


def labels_of(column: NDArray[Any]) -> NDArray[Any]:
    """Return a column as labels of buildings that can be compared and sorted; a row without a value gets its own.

    >>> labels_of(np.array(["a", None, "a"], dtype=object))
    array(['a', '(row 1)', 'a'], dtype='<U7')
    """
    lacking = missing(column)
    values = np.ma.getdata(column)
    if not lacking.any() and values.dtype.kind != "O":
        return values
    if values.dtype.kind == "f":
        known = values[~lacking]
        if (known == np.round(known)).all():  # a column of whole numbers with gaps is read as floating point
            values = np.where(lacking, 0, values).astype(np.int64)
    texts = np.array([str(value) for value in values], dtype=object)
    texts[lacking] = [f"(row {row})" for row in np.flatnonzero(lacking)]
    return texts.astype(str)


def storable_columns(columns: Mapping[str, Any], driver: str, file: Path) -> dict[str, NDArray[Any]]:
    """Return the columns with types and names that a driver takes, masked where there is no value.

    A name that the driver keeps for itself (``fid``, ``geom``), that is empty, or that differs from another only by
    small and capital letters gets a number at its end.

    Raises
    ------
    OutputError
        A column that is no table column: complex numbers, several dimensions.
    """
    stored: dict[str, NDArray[Any]] = {}
    used = set(_TAKEN.get(driver, ()))
    for name, column in columns.items():
        free = base = name or "column"
        number = 0
        while free.lower() in used:
            number += 1
            free = f"{base}_{number}"
        used.add(free.lower())
        stored[free] = _storable(column, name, file)
    return stored


def _storable(column: Any, name: str, file: Path) -> NDArray[Any]:
    values = np.ma.getdata(column)
    if values.ndim != 1 or values.dtype.kind in "cV":
        raise OutputError(
            f"{file.name}: the column {name!r} holds {values.dtype} of {values.ndim} dimensions, a table column holds "
            "one number, text or date each: leave it out"
        )
    lacking = missing(column) if values.dtype.kind in "mMO" else np.ma.getmaskarray(column)
    if values.dtype.kind == "O":
        known = values[~lacking]
        if len(known) and all(isinstance(value, int | float | np.number) for value in known):
            whole = all(isinstance(value, int | np.integer) and not isinstance(value, bool) for value in known)
            if whole and max(abs(int(value)) for value in known) < 2**63:
                values = np.where(lacking, 0, values).astype(np.int64)
            elif not any(isinstance(value, bool) for value in known):
                values = np.where(lacking, np.nan, values).astype(np.float64)
        if values.dtype.kind == "O":
            values = _texts(values, lacking)
    elif values.dtype.kind in "USm" or values.dtype == np.uint64:
        values = _texts(values, lacking) if values.dtype != np.uint64 or _too_large(values) else values.astype(np.int64)
    elif values.dtype.kind in "iu":
        values = values.astype(np.int64)
    elif values.dtype == np.float16 or values.dtype.itemsize > 8:
        values = values.astype(np.float64)
    return np.ma.MaskedArray(values, mask=lacking)


def _texts(values: NDArray[Any], lacking: NDArray[np.bool_]) -> NDArray[Any]:
    texts = [value.decode(errors="replace") if isinstance(value, bytes) else str(value) for value in values.tolist()]
    column = np.array(texts, dtype=object)
    column[lacking] = None
    return column


def _too_large(values: NDArray[Any]) -> bool:
    return bool(len(values)) and int(values.max()) >= 2**63


def _is_nothing(value: Any) -> bool:
    if value is None or (isinstance(value, str) and value == ""):
        return True
    try:
        return bool(value != value)
    except (TypeError, ValueError):  # pandas.NA and arrays answer with something that is not true or false
        return not isinstance(value, np.ndarray)
