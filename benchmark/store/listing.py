"""Listings of stored runs: columns of the store as plain tuples.

Rows do not become objects, and no numeric library is imported, because there may be 100 000 of them and a listing
should appear at once.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from .database import connect, run_filter

__all__ = ["Listing", "list_runs"]

_COLUMNS = {
    "few": """runs.id AS id, runs.key AS key, status, label, scenes.name AS scene, seed, detected, seconds, cpu_seconds,
        peak_memory, version, finished, reason""",
    "all": """runs.id AS id, runs.key AS key, detector, label, fingerprint, seed, scenes.name AS scene, scene_id,
        scenes.key AS scene_key, scene_group, version, status, reason, traceback, finished, seconds, cpu_seconds,
        peak_memory, detected""",
}


@dataclass(frozen=True)
class Listing:
    """Stored runs.

    Attributes
    ----------
    path : Path
        Results store.
    columns : tuple of str
    rows : list of tuple
        The newest run first.
    total : int
        Number of runs in the store, those that were not asked for included.
    """

    path: Path
    columns: tuple[str, ...]
    rows: list[tuple[Any, ...]]
    total: int


def list_runs(
    path: Path,
    *,
    status: str | None = None,
    detector: str | None = None,
    scene: str | None = None,
    limit: int | None = None,
    columns: Literal["few", "all"] = "few",
) -> Listing:
    """Return stored runs, the newest first.

    Parameters
    ----------
    path : Path
        Results store.
    status : {"ok", "failed", "skipped"}, optional
    detector, scene : str, optional
        Patterns such as ``ndsm*`` for label and scene name.
    limit : int, optional
    columns : {"few", "all"}
    """
    where, values = run_filter(status=status, detector=detector, scene=scene)
    query = f"SELECT {_COLUMNS[columns]} FROM runs JOIN scenes ON scenes.id = scene_id"  # noqa: S608 - fixed texts
    with closing(connect(path, must_exist=True)) as db:
        db.row_factory = None
        query += f" WHERE {where} ORDER BY runs.id DESC LIMIT ?"
        cursor = db.execute(query, (*values, -1 if limit is None else limit))
        names = tuple(column[0] for column in cursor.description)
        rows = cursor.fetchall()
        ((total,),) = db.execute("SELECT COUNT(*) FROM runs")
    return Listing(path, names, rows, total)
