"""Reading the results store: runs, scenes, detections, index values and verdicts as plain objects."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import shapely

from ...core.errors import InputError, UnknownNameError
from ...evaluators.base import Evaluation, Evaluator
from ...evaluators.verdict_table import SIDES, VerdictTable
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.raster import Grid
from ..identity.keys import SourceClosure
from ..identity.recipes import PluginRecipe, SceneRecipe
from .cells import decoding, json_of
from .database import run_filter
from .outcomes import Status, footprints_of
from .records import RunRow, StoredScene

__all__ = ["StoreReader"]

_SELECT_RUNS = """SELECT runs.id, runs.key, detector, label, parameters AS parameters_text, fingerprint, seed,
    scenes.name AS scene, recipe AS recipe_text, scene_id, scenes.key AS scene_key, scene_group, version, benchmark,
    status, reason, traceback, finished, seconds, cpu_seconds, peak_memory, detected
    FROM runs JOIN scenes ON scenes.id = scene_id"""


class StoreReader:
    """Queries of an open store."""

    path: Path
    _db: sqlite3.Connection

    def _json(self, text: Any, what: str) -> Any:
        """Return what a cell keeps as JSON; `what` names it in an error."""
        return json_of(text, f"{self.path}: {what}")

    def last_plan(self) -> Mapping[str, Any]:
        """Return the content of the plan that was run last."""
        row = self._db.execute("SELECT content FROM plans ORDER BY id DESC LIMIT 1").fetchone()
        if row is None:
            raise InputError(
                f"{self.path} contains no plan to resume: name a suite or scenes; to resume a sweep repeat its command"
            )
        content: Mapping[str, Any] = self._json(row["content"], "the plan that was run last")
        return content

    def plans(self) -> list[Mapping[str, Any]]:
        """Return the contents of all plans, the one that was run last first."""
        rows = self._db.execute("SELECT id, content FROM plans ORDER BY id DESC")
        return [self._json(row["content"], f"plan {row['id']}") for row in rows]

    def statuses(self, keys: Iterable[str]) -> dict[str, tuple[int, Status, str]]:
        """Return (run id, status, reason) of those keys that are stored."""
        found = {}
        for some in _chunks(list(keys)):
            marks = ",".join("?" * len(some))
            query = f"SELECT id, key, status, reason FROM runs WHERE key IN ({marks})"  # noqa: S608 - marks only
            for row in self._db.execute(query, some):
                found[str(row["key"])] = (int(row["id"]), row["status"], str(row["reason"]))
        return found

    def evaluated(self, run_ids: Iterable[int], key: str) -> set[int]:
        """Return which of these runs have an evaluation of that key."""
        wanted = set(run_ids)
        rows = self._db.execute("SELECT run_id FROM evaluations WHERE key = ?", (key,))
        return wanted & {int(row["run_id"]) for row in rows}

    def evaluation_failures(self, run_ids: Iterable[int], key: str) -> dict[int, str]:
        """Return the reasons of those of these runs on which the evaluator of that key failed, by run id."""
        wanted = set(run_ids)
        rows = self._db.execute("SELECT run_id, reason FROM evaluation_failures WHERE key = ?", (key,))
        return {int(row["run_id"]): str(row["reason"]) for row in rows if row["run_id"] in wanted}

    def failed_evaluators(self, run_id: int) -> list[tuple[str, str, str]]:
        """Return name, parameters (JSON) and reason of each evaluator that failed on a run and has no score since.

        Name and parameters are empty where a store of an older version did not keep them.
        """
        rows = self._db.execute(
            "SELECT evaluator, parameters, reason FROM evaluation_failures WHERE run_id = ? ORDER BY evaluator, key",
            (run_id,),
        )
        return [(str(row[0] or ""), str(row[1] or ""), str(row[2])) for row in rows]

    def described_scenes(self) -> set[str]:
        """Return the keys of the scenes whose content and reference are stored."""
        return {str(row[0]) for row in self._db.execute("SELECT key FROM scenes WHERE content_hash IS NOT NULL")}

    def latest_like(self, label: str, scene: str, seed: int) -> int | None:
        """Return the id of the newest run of that detector label on a scene of that name, None when there is none."""
        query = """SELECT runs.id FROM runs JOIN scenes ON scenes.id = scene_id
            WHERE label = ? AND scenes.name = ? AND seed = ? ORDER BY runs.id DESC LIMIT 1"""
        row = self._db.execute(query, (label, scene, seed)).fetchone()
        return None if row is None else int(row[0])

    def runs(
        self,
        *,
        status: str | None = None,
        detector: str | None = None,
        scene: str | None = None,
        limit: int | None = None,
    ) -> list[RunRow]:
        """Return runs, the newest first.

        Parameters
        ----------
        status : {"ok", "failed", "skipped"}, optional
        detector, scene : str, optional
            Patterns such as ``ndsm*`` for label and scene name.
        limit : int, optional
        """
        where, values = run_filter(status=status, detector=detector, scene=scene)
        query = f"{_SELECT_RUNS} WHERE {where} ORDER BY runs.id DESC LIMIT ?"
        return self._run_rows(query, (*values, -1 if limit is None else limit))

    def _run_rows(self, query: str, values: Sequence[Any]) -> list[RunRow]:
        cursor = self._db.cursor()
        cursor.row_factory = None  # plain tuples, in the order of the fields
        return [RunRow._make(row) for row in cursor.execute(query, values)]

    def runs_of(self, keys: Sequence[str]) -> dict[str, RunRow]:
        """Return the stored runs of these keys, by key."""
        found: dict[str, RunRow] = {}
        for some in _chunks(list(keys)):
            marks = ",".join("?" * len(some))
            query = f"{_SELECT_RUNS} WHERE runs.key IN ({marks})"
            found.update((row.key, row) for row in self._run_rows(query, some))
        return found

    def run(self, name: str | int) -> RunRow:
        """Return one run by its id or by the first digits of its key (at least four)."""
        text = str(name)
        query = f"{_SELECT_RUNS} WHERE "
        rows = []
        if text.isdecimal():
            rows = self._run_rows(query + "runs.id = ?", (int(text),))
        if not rows and len(text) >= 4 and text.isalnum():
            rows = self._run_rows(query + "runs.key GLOB ? LIMIT 2", (text + "*",))
        if len(rows) != 1:
            found = "several runs" if rows else "no run"
            raise UnknownNameError(
                f"{self.path} contains {found} named {text!r}: 'roofbench ls' shows their numbers and keys"
            )
        return rows[0]

    def scene(self, scene_id: int) -> StoredScene:
        """Return a scene with its reference."""
        row = self._db.execute("SELECT * FROM scenes WHERE id = ?", (scene_id,)).fetchone()
        if row is None:
            raise UnknownNameError(f"{self.path} has no scene {scene_id}")
        shapes = self._db.execute(
            "SELECT id, wkb FROM scene_references WHERE scene_id = ? ORDER BY position", (scene_id,)
        ).fetchall()
        with decoding(f"{self.path}: scene {scene_id}"):
            recipe = SceneRecipe.from_dict(json.loads(row["recipe"]))
            reference = None
            if row["reference_count"] is not None:
                reference = footprints_of(
                    [shape["wkb"] for shape in shapes],
                    crs=row["crs"],
                    ids=[shape["id"] for shape in shapes],
                    building_ids=None if row["building_ids"] is None else json.loads(row["building_ids"]),
                    source=row["name"],
                )
            return StoredScene(
                id=scene_id,
                key=row["key"],
                name=row["name"],
                recipe=recipe,
                content_hash=row["content_hash"],
                crs=row["crs"],
                extent=None if row["extent"] is None else tuple(json.loads(row["extent"])),
                grid=None if row["grid"] is None else Grid(*json.loads(row["grid"])),
                area=None if row["area"] is None else shapely.from_wkb(row["area"]),
                reference=reference,
                facts=json.loads(row["facts"] or "{}"),
                point_count=row["point_count"],
            )

    def scene_sizes(self) -> dict[int, tuple[int | None, float]]:
        """Return the number of points (None where not known) and the hectares of every scene that was opened."""
        rows = self._db.execute("SELECT id, point_count, extent FROM scenes WHERE extent IS NOT NULL")
        sizes = {}
        for row in rows:
            with decoding(f"{self.path}: the extent of scene {row['id']}"):
                xmin, ymin, xmax, ymax = json.loads(row["extent"])
                sizes[int(row["id"])] = (row["point_count"], (xmax - xmin) * (ymax - ymin) / 1e4)
        return sizes

    def scene_hashes(self) -> dict[int, str | None]:
        """Return the content hash of every scene; None where it was never opened."""
        return {int(row[0]): row[1] for row in self._db.execute("SELECT id, content_hash FROM scenes")}

    def commands(self) -> list[str]:
        """Return the commands whose runs are stored, in order."""
        return [str(row[0]) for row in self._db.execute("SELECT command FROM plans ORDER BY id")]

    def scene_picture(self, scene_id: int) -> bytes | None:
        """Return the picture of a scene (WebP over its extent); None when it has none or was never opened."""
        row = self._db.execute("SELECT content FROM scene_pictures WHERE scene_id = ?", (scene_id,)).fetchone()
        return None if row is None else bytes(row["content"])

    def reference_counts(self) -> dict[int, int | None]:
        """Return the number of reference footprints of every scene that was opened; None where it has no reference."""
        rows = self._db.execute("SELECT id, reference_count FROM scenes WHERE content_hash IS NOT NULL")
        return {int(row[0]): row[1] for row in rows}

    def detections(self, run_id: int) -> Footprints:
        """Return the raw detections of a run."""
        row = self._db.execute(
            "SELECT label, attributes, crs FROM runs JOIN scenes ON scenes.id = scene_id WHERE runs.id = ?", (run_id,)
        ).fetchone()
        shapes = self._db.execute("SELECT id, wkb FROM detections WHERE run_id = ? ORDER BY id", (run_id,)).fetchall()
        with decoding(f"{self.path}: the detections of run {run_id}"):
            return footprints_of(
                [shape["wkb"] for shape in shapes],
                crs=row["crs"],
                attributes=json.loads(row["attributes"]),
                source=f"run {run_id} ({row['label']})",
            )

    def evaluation(self, run_id: int, evaluator: Evaluator, key: str) -> Evaluation | None:
        """Return the stored evaluation of a run, rebuilt from its tallies; None when it was not evaluated."""
        return self.evaluations([run_id], evaluator, key).get(run_id)

    def evaluations(self, run_ids: Iterable[int], evaluator: Evaluator, key: str) -> dict[int, Evaluation]:
        """Return the stored evaluations of several runs by one evaluator, by run id."""
        wanted = set(run_ids)
        found = {}
        query = "SELECT run_id, tallies, notes FROM evaluations WHERE key = ?"
        for row in self._db.execute(query, (key,)):
            if row["run_id"] in wanted:
                with decoding(f"{self.path}: the evaluation of run {row['run_id']}"):
                    tallies = evaluator.tallies_type.from_dict(json.loads(row["tallies"]))
                    notes = json.loads(row["notes"])
                found[int(row["run_id"])] = evaluator.summarise(tallies, notes)
        return found

    def index_values(self, run_ids: Iterable[int], key: str) -> dict[int, dict[str, float | None]]:
        """Return stored index values by run id and index name."""
        wanted = set(run_ids)
        values: dict[int, dict[str, float | None]] = {}
        query = """SELECT run_id, name, value FROM evaluations JOIN index_values ON evaluation_id = evaluations.id
            WHERE key = ?"""
        for run_id, name, value in self._db.execute(query, (key,)):
            if run_id in wanted:
                values.setdefault(run_id, {})[name] = value
        return values

    def verdict_tables(self, run_id: int, key: str) -> tuple[VerdictTable, VerdictTable] | None:
        """Return the verdicts of the detections and of the references; None where none are stored."""
        query = """SELECT side, content FROM verdict_tables JOIN evaluations ON evaluation_id = evaluations.id
            WHERE run_id = ? AND key = ?"""
        found = {row["side"]: VerdictTable.from_bytes(row["content"]) for row in self._db.execute(query, (run_id, key))}
        return (found["detection"], found["reference"]) if len(found) == len(SIDES) else None

    def evaluators(self) -> list[tuple[str, PluginRecipe]]:
        """Return the key and recipe of every evaluator that has evaluated a run."""
        rows = self._db.execute("SELECT key, evaluator, parameters FROM evaluations GROUP BY key ORDER BY MIN(id)")
        return [
            (
                row["key"],
                PluginRecipe(row["evaluator"], self._json(row["parameters"], "the parameters of an evaluator")),
            )
            for row in rows
        ]

    def evaluators_of(self, run_id: int) -> list[tuple[str, PluginRecipe]]:
        """Return the key and recipe of every evaluator that has evaluated this run."""
        query = "SELECT key, evaluator, parameters FROM evaluations WHERE run_id = ? ORDER BY id"
        rows = self._db.execute(query, (run_id,))
        return [
            (
                row["key"],
                PluginRecipe(row["evaluator"], self._json(row["parameters"], "the parameters of an evaluator")),
            )
            for row in rows
        ]

    def count_runs(self) -> int:
        """Return how many runs are stored."""
        return int(self._db.execute("SELECT COUNT(*) FROM runs").fetchone()[0])

    def code(self, run_id: int) -> SourceClosure:
        """Return the source closure that a run was made with."""
        query = "SELECT modules, packages FROM codes JOIN runs ON code_id = codes.id WHERE runs.id = ?"
        row = self._db.execute(query, (run_id,)).fetchone()
        what = f"the code of run {run_id}"
        return SourceClosure(self._json(row["modules"], what), self._json(row["packages"], what))

    def machine(self, run_id: int) -> Mapping[str, Any]:
        """Return where a run was done."""
        query = "SELECT facts FROM machines JOIN runs ON machine_id = machines.id WHERE runs.id = ?"
        row = self._db.execute(query, (run_id,)).fetchone()
        facts: Mapping[str, Any] = self._json(row["facts"], f"the machine of run {run_id}") if row is not None else {}
        return facts

    def metadata(self, run_id: int) -> Mapping[str, Any]:
        """Return the facts that the detector gave of its result as a whole."""
        row = self._db.execute("SELECT metadata FROM runs WHERE id = ?", (run_id,)).fetchone()
        facts: Mapping[str, Any] = self._json(row["metadata"], f"the facts of run {run_id}")
        return facts

    def run_notes(self, run_ids: Iterable[int]) -> dict[int, tuple[str, ...]]:
        """Return what these runs estimated for lack of data, one sentence each; runs without notes are absent."""
        return self._listed("notes", run_ids)

    def run_cues(self, run_ids: Iterable[int]) -> dict[int, tuple[str, ...]]:
        """Return the names of the cues that these runs used; runs of detectors that name none are absent."""
        return self._listed("cues", run_ids)

    def _listed(self, name: str, run_ids: Iterable[int]) -> dict[int, tuple[str, ...]]:
        """Return a list of texts among the metadata of runs; runs without it are absent."""
        wanted, path = set(run_ids), f"$.{name}"
        query = """SELECT id, json_extract(metadata, ?) AS texts FROM runs
            WHERE metadata LIKE ? AND json_type(metadata, ?) = 'array'"""
        rows = self._db.execute(query, (path, f'%"{name}"%', path))
        return {int(row["id"]): tuple(map(str, self._json(row["texts"], name))) for row in rows if row["id"] in wanted}


def _chunks(items: list[str], size: int = 500) -> Iterator[list[str]]:
    for start in range(0, len(items), size):
        yield items[start : start + size]
