"""The results store: one SQLite file with runs, raw detections, index values and verdicts.

Each run is one transaction, so that a killed sweep loses at most the unfinished runs. Write-ahead logging and a busy
timeout let several processes write to one store at once. Stored results are reused, failures are repeated.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from ...core.digests import canonical
from ...core.errors import OutputError, RoofbenchError
from ...core.package import BENCHMARK_VERSION
from ...evaluators.verdict_table import SIDES
from ..identity.keys import SourceClosure
from ..identity.recipes import SceneRecipe
from .database import connect
from .outcomes import Outcome, SceneRecord, Score, ScoreFailure
from .reader import StoreReader
from .records import RunIdentity, RunRow, StoredScene, evaluation_key

__all__ = ["RunIdentity", "RunRow", "Store", "StoredScene", "evaluation_key"]


class Store(StoreReader):
    """A results store; use it as a context manager.

    Parameters
    ----------
    path : path
        SQLite file, created where missing; removed again where neither a run nor a plan was stored, or where an error
        of roofbench comes before its first run.
    must_exist : bool
        Raise an error for a missing file; for commands that only read.
    """

    def __init__(self, path: str | Path, *, must_exist: bool = False) -> None:
        self.path = Path(path)
        self._is_new = not self.path.exists()
        self._db = connect(self.path, must_exist=must_exist)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, where: TracebackType | None
    ) -> None:
        refused = isinstance(value, RoofbenchError)
        unused = refused or (value is None and not self._has_plans())
        leaves_nothing = self._is_new and unused and not self._has_runs() and self._is_open_here_only()
        self.close()
        if leaves_nothing:  # a mistyped command or a dry run makes no file
            self.path.unlink(missing_ok=True)

    def _has_runs(self) -> bool:
        return self._db.execute("SELECT 1 FROM runs LIMIT 1").fetchone() is not None

    def _has_plans(self) -> bool:
        return self._db.execute("SELECT 1 FROM plans LIMIT 1").fetchone() is not None

    def _is_open_here_only(self) -> bool:
        """Return whether no other process has the file open: only then can it leave write-ahead logging."""
        self._db.execute("PRAGMA busy_timeout = 0")
        try:
            return bool(self._db.execute("PRAGMA journal_mode = DELETE").fetchone()[0] == "delete")
        except sqlite3.OperationalError:
            return False

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        try:
            self._db.execute("BEGIN IMMEDIATE")
        except sqlite3.OperationalError as error:
            raise OutputError(f"{self.path} cannot be written: {error}") from error
        try:
            yield self._db
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        self._db.execute("COMMIT")

    def record(self, identity: RunIdentity, outcome: Outcome, *, version: str, replace: bool = False) -> int:
        """Store an outcome in one transaction and return the run's id.

        A stored ``ok`` or ``skipped`` result of another process is kept unless `replace` is true.
        """
        with self._transaction() as db:
            scene_id = self._scene(identity.scene, identity.scene_key, outcome.scene)
            stored = db.execute("SELECT id, status FROM runs WHERE key = ?", (identity.key,)).fetchone()
            if stored is not None:
                if stored["status"] != "failed" and not replace:
                    return int(stored["id"])
                db.execute("DELETE FROM runs WHERE id = ?", (stored["id"],))
            ok = outcome.status == "ok"
            cursor = db.execute(
                """INSERT INTO runs (key, detector, label, parameters, fingerprint, seed, scene_id, code_id, machine_id,
                   version, benchmark, status, reason, traceback, finished, seconds, cpu_seconds, peak_memory, detected,
                   attributes, metadata) VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)""",
                (
                    identity.key,
                    identity.detector.use,
                    identity.label,
                    canonical(dict(identity.detector.parameters)),
                    identity.fingerprint,
                    identity.seed,
                    scene_id,
                    self._code(identity.code),
                    self._machine(outcome.machine),
                    version,
                    identity.benchmark,
                    outcome.status,
                    outcome.reason,
                    outcome.traceback,
                    datetime.now(UTC).isoformat(timespec="seconds"),
                    outcome.cost.seconds,
                    outcome.cost.cpu_seconds,
                    outcome.cost.peak_memory,
                    len(outcome.detections) if ok else None,
                    canonical(dict(outcome.attributes)),
                    canonical(dict(outcome.metadata)),
                ),
            )
            run_id = int(cursor.lastrowid or 0)
            db.executemany(
                "INSERT INTO detections VALUES (?, ?, ?)",
                ((run_id, number, wkb) for number, wkb in enumerate(outcome.detections)),
            )
            for score in outcome.scores:
                self._score(run_id, score)
            for failure in outcome.score_failures:
                self._score_failure(run_id, failure)
        return run_id

    def add_score(self, run_id: int, score: Score) -> None:
        """Store a further evaluation of a stored run; an existing one is kept."""
        with self._transaction():
            self._score(run_id, score)

    def add_score_failure(self, run_id: int, failure: ScoreFailure) -> None:
        """Store that an evaluator failed on a stored run, with its reason."""
        with self._transaction():
            self._score_failure(run_id, failure)

    def _score_failure(self, run_id: int, failure: ScoreFailure) -> None:
        key = evaluation_key(failure.evaluator, failure.code)
        self._db.execute(
            "INSERT OR REPLACE INTO evaluation_failures VALUES (?, ?, ?, ?, ?)",
            (run_id, key, failure.reason, failure.evaluator.use, canonical(dict(failure.evaluator.parameters))),
        )

    def _score(self, run_id: int, score: Score) -> None:
        key = evaluation_key(score.evaluator, score.code)
        self._db.execute("DELETE FROM evaluation_failures WHERE run_id = ? AND key = ?", (run_id, key))
        cursor = self._db.execute(
            """INSERT OR IGNORE INTO evaluations (run_id, key, evaluator, parameters, code, tallies, notes, benchmark)
               VALUES (?,?,?,?,?,?,?,?)""",
            (
                run_id,
                key,
                score.evaluator.use,
                canonical(dict(score.evaluator.parameters)),
                score.code,
                canonical(dict(score.tallies)),
                canonical(list(score.notes)),
                BENCHMARK_VERSION,
            ),
        )
        if not cursor.rowcount:
            return
        evaluation_id = cursor.lastrowid
        self._db.executemany(
            "INSERT INTO index_values VALUES (?, ?, ?)",
            ((evaluation_id, name, value) for name, value in score.values.items()),
        )
        self._db.executemany(
            "INSERT INTO verdict_tables VALUES (?, ?, ?)",
            ((evaluation_id, side, table) for side, table in zip(SIDES, score.verdicts, strict=False)),
        )

    def _scene(self, recipe: SceneRecipe, key: str, record: SceneRecord | None) -> int:
        db = self._db
        db.execute(
            "INSERT OR IGNORE INTO scenes (key, name, scene_group, recipe) VALUES (?,?,?,?)",
            (key, recipe.name, recipe.group, canonical(recipe.to_dict())),
        )
        row = db.execute("SELECT id, content_hash FROM scenes WHERE key = ?", (key,)).fetchone()
        scene_id = int(row["id"])
        if record is None or row["content_hash"] is not None:
            return scene_id
        labels = None if record.building_ids is None else canonical(list(record.building_ids))
        db.execute(
            """UPDATE scenes SET content_hash = ?, crs = ?, extent = ?, grid = ?, area = ?,
               reference_count = ?, building_ids = ?, facts = ?, point_count = ?
               WHERE id = ?""",
            (
                record.content_hash,
                record.crs,
                canonical(list(record.extent)),
                None if record.grid is None else canonical(list(record.grid)),
                record.area,
                None if record.reference is None else len(record.reference),
                labels,
                canonical(dict(record.facts)),
                record.point_count,
                scene_id,
            ),
        )
        if record.picture is not None:
            db.execute("INSERT OR REPLACE INTO scene_pictures VALUES (?, ?)", (scene_id, record.picture))
        if record.reference is not None:
            db.executemany(
                "INSERT INTO scene_references VALUES (?, ?, ?, ?)",
                (
                    (scene_id, position, number, wkb)
                    for position, (number, wkb) in enumerate(zip(record.reference_ids, record.reference, strict=True))
                ),
            )
        return scene_id

    def _code(self, code: SourceClosure) -> int:
        self._db.execute(
            "INSERT OR IGNORE INTO codes (digest, modules, packages) VALUES (?,?,?)",
            (code.digest, canonical(dict(code.modules)), canonical(dict(code.packages))),
        )
        return int(self._db.execute("SELECT id FROM codes WHERE digest = ?", (code.digest,)).fetchone()[0])

    def _machine(self, facts: Mapping[str, Any]) -> int | None:
        if not facts:
            return None
        text = canonical(dict(facts))
        self._db.execute("INSERT OR IGNORE INTO machines (facts) VALUES (?)", (text,))
        return int(self._db.execute("SELECT id FROM machines WHERE facts = ?", (text,)).fetchone()[0])

    def save_plan(self, name: str, command: str, content: Mapping[str, Any]) -> None:
        """Store the content of a plan, so that it can be resumed without the suite file."""
        with self._transaction() as db:
            text = canonical(dict(content))
            db.execute("DELETE FROM plans WHERE content = ?", (text,))
            now = datetime.now(UTC).isoformat(timespec="seconds")
            db.execute(
                "INSERT INTO plans (name, command, created, content) VALUES (?,?,?,?)", (name, command, now, text)
            )
