"""Listings of stored runs: columns of the store as plain tuples, in chunks.

There may be 100 000 rows. They do not become objects, they are not held at once, and no numeric library is imported, so
that a listing appears immediately.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from .database import connect, run_filter

__all__ = ["Listing", "Sizes", "list_runs"]

_COLUMNS = {
    "few": """runs.id AS id, runs.key AS key, status, label, scenes.name AS scene, seed, detected, seconds, cpu_seconds,
        peak_memory, version, benchmark, finished, reason""",
    "all": """runs.id AS id, runs.key AS key, detector, label, fingerprint, seed, scenes.name AS scene, scene_id,
        scenes.key AS scene_key, scene_group, version, benchmark, status, reason, traceback, finished, seconds,
        cpu_seconds, peak_memory, detected""",
}
_FROM = "FROM runs JOIN scenes ON scenes.id = scene_id"
_AT_ONCE = 5000  # rows


@dataclass(frozen=True)
class Sizes:
    """How much room the texts of the chosen runs need.

    Attributes
    ----------
    count : int
        Number of chosen runs.
    label, scene : int
        Characters of the longest detector label and scene name.
    ascii : bool
        All labels and scene names of the store are ASCII: each character takes one column of a terminal.
    """

    count: int
    label: int
    scene: int
    ascii: bool


@dataclass(frozen=True)
class Listing:
    """Stored runs, the newest first; each method reads the store anew.

    Attributes
    ----------
    path : Path
        Results store.
    total : int
        Number of runs in the store, whether they are chosen or not.
    condition : str
        SQL condition that selects the chosen runs, with their order and number.
    values : tuple
        Values of the condition.
    """

    path: Path
    total: int
    condition: str
    values: tuple[Any, ...]

    def chunks(self, columns: Literal["few", "all"]) -> Iterator[tuple[tuple[str, ...], list[tuple[Any, ...]]]]:
        """Yield the names of the columns and some thousand rows at a time; at least once."""
        yield from self._read(f"SELECT {_COLUMNS[columns]} {_FROM} {self.condition}")

    def lines(self, template: str) -> Iterator[list[str]]:
        """Yield some thousand lines at a time, printed by SQLite: five times faster than Python for 100 000 lines.

        Parameters
        ----------
        template : str
            Template of ``printf`` for run, key, status, label, scene, seed, number of detections, seconds, CPU seconds,
            megabytes, version of the benchmark, reason.
        """
        line = """RTRIM(PRINTF(?, runs.id, runs.key, status, label, scenes.name, seed, IFNULL(detected, ''), seconds,
            cpu_seconds, peak_memory / 1e6,
            IFNULL(benchmark, '?'), reason))"""
        for _, rows in self._read(f"SELECT {line} {_FROM} {self.condition}", template):
            yield [line for (line,) in rows]

    def sizes(self) -> Sizes:
        """Return how much room the texts need."""
        chosen = f"SELECT label, scenes.name AS scene {_FROM} {self.condition}"
        query = f"SELECT COUNT(*), MAX(LENGTH(label)), MAX(LENGTH(scene)) FROM ({chosen})"  # noqa: S608 - fixed texts
        with closing(connect(self.path, must_exist=True)) as db:
            count, label, scene = db.execute(query, self.values).fetchone()
            names = db.execute("SELECT DISTINCT label FROM runs UNION ALL SELECT name FROM scenes").fetchall()
        return Sizes(count, label or 0, scene or 0, all(name.isascii() for (name,) in names))

    def _read(self, query: str, *values: Any) -> Iterator[tuple[tuple[str, ...], list[tuple[Any, ...]]]]:
        with closing(connect(self.path, must_exist=True)) as db:
            db.row_factory = None
            cursor = db.execute(query, (*values, *self.values))
            names = tuple(column[0] for column in cursor.description)
            rows = cursor.fetchmany(_AT_ONCE)
            yield names, rows
            while rows := cursor.fetchmany(_AT_ONCE):
                yield names, rows


def list_runs(
    path: Path,
    *,
    status: str | None = None,
    detector: str | None = None,
    scene: str | None = None,
    limit: int | None = None,
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
    """
    where, values = run_filter(status=status, detector=detector, scene=scene)
    with closing(connect(path, must_exist=True)) as db:
        ((total,),) = db.execute("SELECT COUNT(*) FROM runs")
    condition = f"WHERE {where} ORDER BY runs.id DESC LIMIT ?"
    return Listing(path, total, condition, (*values, -1 if limit is None else limit))
