"""The schema of the results store and its migrations.

The schema version is SQLite's ``user_version``. A store of an older version is migrated step by step in one
transaction when it is opened; a store of a newer version is refused.
"""

from __future__ import annotations

import sqlite3
from pathlib import Path

from ...core.errors import InputError

__all__ = ["VERSION", "prepare"]

VERSION = 6

#: One script per version: MIGRATIONS[n] leads from version n to n + 1.
MIGRATIONS: tuple[str, ...] = (
    """
    CREATE TABLE scenes (
        id INTEGER PRIMARY KEY,
        key TEXT NOT NULL UNIQUE,
        name TEXT NOT NULL,
        scene_group TEXT NOT NULL,        -- preset with parameters, without the seed; else the name
        recipe TEXT NOT NULL,             -- JSON: how to open it again
        content_hash TEXT,                -- NULL until the scene was opened once
        crs TEXT,
        extent TEXT,                      -- JSON [xmin, ymin, xmax, ymax]
        grid TEXT,                        -- JSON [west, north, gsd, rows, columns]
        area BLOB,                        -- evaluation area, WKB
        reference_count INTEGER,          -- NULL when it has no reference
        building_ids TEXT,                -- JSON, one per reference footprint, NULL when each is its own building
        facts TEXT
    );
    CREATE TABLE scene_references (
        scene_id INTEGER NOT NULL REFERENCES scenes ON DELETE CASCADE,
        position INTEGER NOT NULL,
        id INTEGER NOT NULL,
        wkb BLOB NOT NULL,
        PRIMARY KEY (scene_id, position)
    ) WITHOUT ROWID;
    CREATE TABLE codes (
        id INTEGER PRIMARY KEY,
        digest TEXT NOT NULL UNIQUE,
        modules TEXT NOT NULL,            -- JSON: module to digest of its syntax tree
        packages TEXT NOT NULL            -- JSON: package to version
    );
    CREATE TABLE machines (
        id INTEGER PRIMARY KEY,
        facts TEXT NOT NULL UNIQUE        -- JSON
    );
    CREATE TABLE runs (
        id INTEGER PRIMARY KEY,
        key TEXT NOT NULL UNIQUE,
        detector TEXT NOT NULL,           -- registered name or file.py:Class
        label TEXT NOT NULL,              -- name[changed parameters]
        parameters TEXT NOT NULL,         -- JSON, defaults included
        fingerprint TEXT NOT NULL,        -- of what the detector reads besides the scene
        seed INTEGER NOT NULL,
        scene_id INTEGER NOT NULL REFERENCES scenes,
        code_id INTEGER NOT NULL REFERENCES codes,
        machine_id INTEGER REFERENCES machines,
        version TEXT NOT NULL,            -- of roofbench, with commit and dirty flag where known
        status TEXT NOT NULL CHECK (status IN ('ok', 'failed', 'skipped')),
        reason TEXT NOT NULL,
        traceback TEXT NOT NULL,
        finished TEXT NOT NULL,           -- UTC, ISO 8601
        seconds REAL NOT NULL,
        cpu_seconds REAL NOT NULL,
        peak_memory INTEGER NOT NULL,     -- bytes
        detected INTEGER,                 -- number of detections, NULL unless ok
        attributes TEXT NOT NULL,         -- JSON: column to values, one per detection
        metadata TEXT NOT NULL            -- JSON
    );
    CREATE INDEX runs_by_label ON runs (label, scene_id, seed);
    CREATE INDEX runs_by_status ON runs (status);
    CREATE TABLE detections (
        run_id INTEGER NOT NULL REFERENCES runs ON DELETE CASCADE,
        id INTEGER NOT NULL,
        wkb BLOB NOT NULL,
        PRIMARY KEY (run_id, id)
    ) WITHOUT ROWID;
    CREATE TABLE evaluations (
        id INTEGER PRIMARY KEY,
        run_id INTEGER NOT NULL REFERENCES runs ON DELETE CASCADE,
        key TEXT NOT NULL,                -- digest of evaluator, parameters and code
        evaluator TEXT NOT NULL,          -- registered name or file.py:Class
        parameters TEXT NOT NULL,         -- JSON, defaults included
        code TEXT NOT NULL,               -- digest of the evaluator's source closure
        tallies TEXT NOT NULL,            -- JSON
        samples TEXT NOT NULL,            -- JSON
        notes TEXT NOT NULL,              -- JSON
        UNIQUE (run_id, key)
    );
    CREATE INDEX evaluations_by_key ON evaluations (key);
    CREATE TABLE index_values (
        evaluation_id INTEGER NOT NULL REFERENCES evaluations ON DELETE CASCADE,
        name TEXT NOT NULL,
        value REAL,                       -- NULL where undefined
        PRIMARY KEY (evaluation_id, name)
    ) WITHOUT ROWID;
    CREATE TABLE verdicts (
        evaluation_id INTEGER NOT NULL REFERENCES evaluations ON DELETE CASCADE,
        side TEXT NOT NULL CHECK (side IN ('detection', 'reference')),
        position INTEGER NOT NULL,        -- row among the objects of its side
        id INTEGER,
        verdict TEXT,
        reason TEXT,
        details TEXT NOT NULL,            -- JSON: partner, distance, overlap_area, iou, rmse, ...
        PRIMARY KEY (evaluation_id, side, position)
    ) WITHOUT ROWID;
    CREATE TABLE plans (
        id INTEGER PRIMARY KEY,
        name TEXT NOT NULL,
        command TEXT NOT NULL,            -- the command that made it
        created TEXT NOT NULL,
        content TEXT NOT NULL UNIQUE      -- JSON: the recipes of every task, to resume without the suite file
    );
    """,
    """
    ALTER TABLE scenes ADD COLUMN point_count INTEGER;
    CREATE TABLE scene_pictures (
        scene_id INTEGER PRIMARY KEY REFERENCES scenes ON DELETE CASCADE,
        content BLOB NOT NULL             -- WebP over the extent, for reports
    );
    """,
    # Samples of a tally become its histogram when they are read. Verdicts follow from the detections, which are kept:
    # 'roofbench score' writes them again.
    """
    UPDATE evaluations SET tallies = json_patch(tallies, samples);
    ALTER TABLE evaluations DROP COLUMN samples;
    DROP TABLE verdicts;
    CREATE TABLE verdict_tables (
        evaluation_id INTEGER NOT NULL REFERENCES evaluations ON DELETE CASCADE,
        side TEXT NOT NULL CHECK (side IN ('detection', 'reference')),
        content BLOB NOT NULL,            -- VerdictTable.to_bytes
        PRIMARY KEY (evaluation_id, side)
    );
    """,
    """
    CREATE TABLE evaluation_failures (
        run_id INTEGER NOT NULL REFERENCES runs ON DELETE CASCADE,
        key TEXT NOT NULL,                -- digest of evaluator, parameters and code
        reason TEXT NOT NULL,
        PRIMARY KEY (run_id, key)
    );
    """,
    # The version of the benchmark (definitions, suites, generator); NULL where it was not recorded.
    """
    ALTER TABLE runs ADD COLUMN benchmark INTEGER;
    ALTER TABLE evaluations ADD COLUMN benchmark INTEGER;
    """,
    # The evaluator that failed; NULL where it was not recorded.
    """
    ALTER TABLE evaluation_failures ADD COLUMN evaluator TEXT;
    ALTER TABLE evaluation_failures ADD COLUMN parameters TEXT;
    """,
)


def prepare(connection: sqlite3.Connection, path: Path) -> None:
    """Update a store to the current version; raise `InputError` for another database or a store of a newer version."""
    try:
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:  # SQLite's message may quote damaged names.
        raise InputError(f"{path} is not a results store: {error}; name another file by store=") from error
    if (version == 0 and tables) or (version and "runs" not in tables):
        raise InputError(f"{path} is a database of something else: name another file by store=")
    if version > VERSION:
        raise InputError(
            f"{path} was written by a newer roofbench (schema {version}, this one knows {VERSION}): upgrade roofbench"
        )
    if version == VERSION:
        return
    connection.execute("BEGIN IMMEDIATE")
    try:
        (version,) = connection.execute(
            "PRAGMA user_version"
        ).fetchone()  # another process may have migrated it in the meantime
        for script in MIGRATIONS[version:VERSION]:
            for statement in _statements(script):
                connection.execute(statement)
        connection.execute(f"PRAGMA user_version = {VERSION}")
        connection.execute("COMMIT")
    except BaseException:
        connection.execute("ROLLBACK")
        raise


def _statements(script: str) -> list[str]:
    """Split a script at its semicolons; `executescript` would commit."""
    lines = [line.partition("--")[0] for line in script.splitlines()]
    return [statement for statement in "\n".join(lines).split(";") if statement.strip()]
