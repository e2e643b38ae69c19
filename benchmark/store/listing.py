"""Listings of stored runs as text.

Rows go from the file to lines without becoming objects, and lines are formatted in SQL: there may be 100 000 of them.
"""

from __future__ import annotations

import csv
import io
import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, Literal

from .database import connect, run_filter

__all__ = ["list_runs"]

_CSV = """runs.id AS id, runs.key AS key, status, label, scenes.name AS scene, seed, detected, seconds, cpu_seconds,
    peak_memory, version, finished, reason"""
_JSON = """runs.id AS id, runs.key AS key, detector, label, fingerprint, seed, scenes.name AS scene, scene_id,
    scenes.key AS scene_key, scene_group, version, status, reason, traceback, finished, seconds, cpu_seconds,
    peak_memory, detected"""
_FROM = "FROM runs JOIN scenes ON scenes.id = scene_id WHERE"
_AT_ONCE = 5000  # lines


def list_runs(
    path: Path,
    *,
    status: str | None = None,
    detector: str | None = None,
    scene: str | None = None,
    limit: int | None = None,
    form: Literal["table", "csv", "json"] = "table",
) -> Iterator[str]:
    """Yield a listing of stored runs, the newest first, in pieces of text.

    Parameters
    ----------
    path : Path
        Results store.
    status : {"ok", "failed", "skipped"}, optional
    detector, scene : str, optional
        Patterns such as ``ndsm*`` for label and scene name.
    limit : int, optional
    form : {"table", "csv", "json"}
        Aligned columns, one line per run, or a list of objects.
    """
    where, values = run_filter(status=status, detector=detector, scene=scene)
    with closing(connect(path, must_exist=True)) as db:
        db.row_factory = None
        order = f"{where} ORDER BY runs.id DESC LIMIT ?"
        values.append(-1 if limit is None else limit)
        pieces = {"table": _table, "csv": _csv, "json": _json}[form]
        yield from pieces(db, order, values, path)


def _table(db: sqlite3.Connection, order: str, values: list[Any], path: Path) -> Iterator[str]:
    chosen = f"SELECT label, name {_FROM} {order}"
    sizes = f"SELECT COUNT(*), MAX(LENGTH(label)), MAX(LENGTH(name)) FROM ({chosen})"  # noqa: S608 - fixed texts
    ((count, *longest),) = db.execute(sizes, values)
    label, scene = (max(len(title), size or 0) for title, size in zip(("detector", "scene"), longest, strict=True))
    yield (
        f"{'run':>6}  {'key':8}  {'status':7}  {'detector':{label}}  {'scene':{scene}}  {'seed':>4}  {'found':>6}  "
        f"{'seconds':>8}  {'CPU s':>8}  {'MB':>6}  reason\n"
    )
    line = f"""RTRIM(PRINTF(
        '%6d  %.8s  %-7s  %-!{label}s  %-!{scene}s  %4d  %6s  %8.2f  %8.2f  %6.0f  %s', runs.id, runs.key, status,
        label, name, seed, IFNULL(detected, ''), seconds, cpu_seconds, peak_memory / 1e6, reason))"""
    cursor = db.execute(f"SELECT {line} {_FROM} {order}", values)
    while rows := cursor.fetchmany(_AT_ONCE):
        yield "\n".join([row[0] for row in rows]) + "\n"
    ((total,),) = db.execute("SELECT COUNT(*) FROM runs")
    yield f"{count} of {total} runs in {path}\n"


def _csv(db: sqlite3.Connection, order: str, values: list[Any], path: Path) -> Iterator[str]:
    cursor = db.execute(f"SELECT {_CSV} {_FROM} {order}", values)
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([column[0] for column in cursor.description])
    writer.writerows(cursor)
    yield buffer.getvalue()


def _json(db: sqlite3.Connection, order: str, values: list[Any], path: Path) -> Iterator[str]:
    cursor = db.execute(f"SELECT {_JSON} {_FROM} {order}", values)
    names = [column[0] for column in cursor.description]
    rows = [dict(zip(names, row, strict=True)) for row in cursor]
    # A field a line; `indent` would make the encoder several times slower.
    yield json.dumps(rows, separators=(",\n", ": ")) + "\n"
