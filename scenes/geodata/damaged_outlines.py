"""Damaged outlines: rows whose geometry is in the file, though OGR cannot read it.

OGR gives such a row no geometry, as it does where the file itself says that there is none. Left out, it would count as
not detected, or as not in the reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.wording import counted
from .degrees import JSON_ENDINGS
from .json_members import LARGEST_JSON, json_members, refuse_other_members
from .shapefile_parts import damaged_rows

__all__ = ["refuse_damaged"]


def refuse_damaged(file: Path, layer: str, missing: NDArray[np.int64], count: int) -> None:
    """Raise `InputError` when rows without geometry have one in the file, or members of GeoJSON were passed over.

    Parameters
    ----------
    file : Path
        A Shapefile, GeoPackage or GeoJSON file; others are not looked at.
    layer : str
    missing : ndarray of int64
        Rows without geometry, counted from 0.
    count : int
        Number of rows that were read.
    """
    refuse_other_members(file, count)
    if not len(missing):
        return
    suffix = file.suffix.lower()
    if suffix == ".shp":
        damaged: Sequence[int] = damaged_rows(file, missing, count).tolist()
    elif suffix == ".gpkg":
        damaged = _in_geopackage(file, layer, missing, count)
    elif suffix in JSON_ENDINGS:
        damaged = _in_json(file, missing, count)
    else:
        return
    if damaged:
        many = counted(len(damaged), "outline is", "outlines are")
        raise InputError(
            f"{file}: {many} damaged (the first is feature {damaged[0]}): copy or download the file again, or "
            "repair or delete them"
        )


def _in_geopackage(file: Path, layer: str, missing: NDArray[np.int64], count: int) -> list[int]:
    import sqlite3

    column = "SELECT column_name FROM gpkg_geometry_columns WHERE table_name = ?"
    try:
        with closing(sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True)) as database:
            (geometry,) = database.execute(column, [layer]).fetchone() or (None,)
            if geometry is None:
                return []
            rows = database.execute(
                # A name of a table or column cannot be a parameter of the statement.
                "SELECT {} IS NULL FROM {} ORDER BY rowid".format(*map(_quoted, (geometry, layer)))  # noqa: S608
            ).fetchall()
    except sqlite3.Error:
        return []
    return [row for row in missing.tolist() if not rows[row][0]] if len(rows) == count else []


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _in_json(file: Path, missing: NDArray[np.int64], count: int) -> list[int]:
    if file.stat().st_size > LARGEST_JSON:
        return []
    features = json_members(file).members
    if len(features) != count:
        return []
    return [row for row in missing.tolist() if isinstance(features[row], dict) and features[row].get("geometry")]
