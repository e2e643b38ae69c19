"""The file of a results store: how it is opened, and how runs are chosen in it.

It is a module of its own because a listing of runs needs nothing else and should not wait for numeric libraries.
"""

from __future__ import annotations

import os
import sqlite3
from pathlib import Path
from typing import Any

from ...core.errors import InputError, OutputError
from .schema import prepare

__all__ = ["connect", "run_filter"]

_BUSY_SECONDS = 60
#: Bytes of the header of a database.
_SMALLEST = 100


def connect(path: Path, *, must_exist: bool = False) -> sqlite3.Connection:
    """Open a store, create it where missing, and update its schema; one in a read-only folder is opened for reading.

    Raises
    ------
    InputError
        The file is missing although it must exist, is no store, or was written by a newer version.
    OutputError
        It cannot be opened.
    """
    if must_exist and not path.is_file():
        raise InputError(f"{path}: no such results store; 'roofbench run' makes one, or name it by store=")
    size = path.stat().st_size if path.is_file() else 0
    if (must_exist and size == 0) or 0 < size < _SMALLEST:
        # SQLite takes such a file for an empty database and would fill it.
        raise InputError(f"{path} is empty or cut off ({size} bytes), no results store: name another file by store=")
    if not path.parent.is_dir():
        raise OutputError(f"{path} cannot be written: there is no folder {path.parent}")
    # SQLite needs to write side files beside the store; without permission it is opened for reading only.
    read_only = path.is_file() and not os.access(path.parent, os.W_OK)
    name = f"{path.resolve().as_uri()}?immutable=1" if read_only else path
    try:
        db = sqlite3.connect(name, timeout=_BUSY_SECONDS, isolation_level=None, uri=read_only)
    except sqlite3.OperationalError as error:
        raise OutputError(f"{path} cannot be opened as results store: {error}") from error
    try:
        db.execute(f"PRAGMA busy_timeout = {_BUSY_SECONDS * 1000}")
        db.row_factory = sqlite3.Row
        prepare(db, path)
        if read_only:
            return db
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("PRAGMA synchronous = NORMAL")
        db.execute("PRAGMA foreign_keys = ON")
    except BaseException as error:
        db.close()
        if isinstance(error, sqlite3.OperationalError):
            raise OutputError(f"{path} cannot be opened as results store: {error}") from error
        raise
    return db


def run_filter(
    *, status: str | None = None, detector: str | None = None, scene: str | None = None
) -> tuple[str, list[Any]]:
    """Return a condition that selects runs among ``runs JOIN scenes``, and its values.

    Parameters
    ----------
    status : {"ok", "failed", "skipped"}, optional
    detector, scene : str, optional
        Patterns such as ``ndsm*`` for label and scene name.
    """
    conditions, values = ["1"], list[Any]()
    for column, wanted, comparison in (
        ("status", status, "="),
        ("label", detector, "GLOB"),
        ("scenes.name", scene, "GLOB"),
    ):
        if wanted is not None:
            conditions.append(f"{column} {comparison} ?")
            values.append(wanted)
    return " AND ".join(conditions), values
