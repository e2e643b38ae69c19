"""Outcomes: the result of a run, as the store keeps it and as bytes that any executor can carry.

An *outcome* has a status (``ok``, ``failed`` or ``skipped``) with its reason, the cost, the raw detections, and one
*score* for each evaluator. The *record* of a scene holds what is needed to evaluate and to draw it without opening it.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Literal, Self

import numpy as np
import shapely
from numpy.typing import NDArray

from ...evaluators.base import Evaluation
from ...scenes.geodata.footprints import Footprints
from ..identity.recipes import PluginRecipe

__all__ = ["Cost", "Outcome", "SceneRecord", "Score", "ScoreFailure", "Status", "footprints_of"]

Status = Literal["ok", "failed", "skipped"]


@dataclass(frozen=True, kw_only=True)
class Cost:
    """The cost of a detection, without reading the scene and without evaluation.

    Attributes
    ----------
    seconds, cpu_seconds : float
        Wall clock, and processor time of all threads.
    peak_memory : int
        Highest resident memory of the process during detection, bytes; 0 where the system does not report it.
    """

    seconds: float = 0.0
    cpu_seconds: float = 0.0
    peak_memory: int = 0


@dataclass(frozen=True, kw_only=True)
class Score:
    """An evaluation as it is stored; `summarise` of its evaluator derives the indices again without geometry.

    Attributes
    ----------
    evaluator : PluginRecipe
    code : str
        Digest of the evaluator's source closure.
    tallies : mapping
        By dotted name, as JSON holds them.
    values, notes
        As of `Evaluation`.
    verdicts : tuple of bytes
        The verdict tables of the detections and of the references; empty when the evaluator gives none.
    """

    evaluator: PluginRecipe
    code: str
    tallies: Mapping[str, Any]
    values: Mapping[str, float | None]
    notes: tuple[str, ...]
    verdicts: tuple[bytes, ...] = ()

    @classmethod
    def of(cls, evaluation: Evaluation, recipe: PluginRecipe, code: str) -> Self:
        """Return the score of an evaluation."""
        given = evaluation.verdicts
        return cls(
            evaluator=recipe,
            code=code,
            tallies=evaluation.tallies.to_dict(),
            values=dict(evaluation.values),
            notes=tuple(_storable(list(evaluation.notes))),
            verdicts=() if given is None else tuple(table.to_bytes() for _, table, _ in given.sides),
        )


@dataclass(frozen=True, kw_only=True)
class ScoreFailure:
    """An evaluator that failed on the detections of a run, which are stored all the same.

    Attributes
    ----------
    evaluator : PluginRecipe
    code : str
        Digest of the evaluator's source closure.
    reason : str
        One sentence.
    """

    evaluator: PluginRecipe
    code: str
    reason: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "reason", _storable(self.reason))


@dataclass(frozen=True, kw_only=True)
class SceneRecord:
    """A scene as it is stored: enough to evaluate and to draw verdicts without opening it again.

    `picture` is a WebP file over the extent (see `scene_picture`), `point_count` the size of the point cloud.
    """

    content_hash: str
    crs: str | None
    extent: tuple[float, float, float, float]
    grid: tuple[float, float, float, int, int] | None
    area: bytes | None
    reference: tuple[bytes, ...] | None
    reference_ids: tuple[int, ...] = ()
    building_ids: tuple[int | str, ...] | None = None
    facts: Mapping[str, Any] = field(default_factory=dict)
    point_count: int | None = None
    picture: bytes | None = None


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The result of a task.

    Attributes
    ----------
    status : {"ok", "failed", "skipped"}
    reason : str
        One sentence for a failure or skip, else empty.
    traceback : str
        Of a failure, or the end of the worker's standard error.
    cost : Cost
    detections : tuple of bytes
        WKB of each raw detection.
    attributes : mapping of str to list
        Further columns of the detections.
    metadata : mapping
        Facts about the whole set, and repairs.
    scores : tuple of Score
    score_failures : tuple of ScoreFailure
        Evaluators that failed; the others have their score.
    scene : SceneRecord, optional
    machine : mapping
        Facts about the machine.
    """

    status: Status
    reason: str = ""
    traceback: str = ""
    cost: Cost = field(default_factory=Cost)
    detections: tuple[bytes, ...] = ()
    attributes: Mapping[str, list[Any]] = field(default_factory=dict)
    metadata: Mapping[str, Any] = field(default_factory=dict)
    scores: tuple[Score, ...] = ()
    score_failures: tuple[ScoreFailure, ...] = ()
    scene: SceneRecord | None = None
    machine: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        # Texts of a plugin: a file name that is not UTF-8 holds lone surrogates, which no file can store.
        for name in ("reason", "traceback", "attributes", "metadata"):
            object.__setattr__(self, name, _storable(getattr(self, name)))

    def to_bytes(self) -> bytes:
        """Return a JSON header followed by the geometries."""
        header = _fields(self)
        header["cost"] = _fields(self.cost)
        header["scores"] = [
            {**_fields(score), "evaluator": score.evaluator.to_dict(), "verdicts": len(score.verdicts)}
            for score in self.scores
        ]
        header["score_failures"] = [
            {**_fields(failure), "evaluator": failure.evaluator.to_dict()} for failure in self.score_failures
        ]
        blobs = [*self.detections, *(table for score in self.scores for table in score.verdicts)]
        header["detections"] = len(self.detections)
        if self.scene is not None:
            header["scene"] = _fields(self.scene)
            reference = self.scene.reference
            blobs += [*(reference or ()), self.scene.area or b"", self.scene.picture or b""]
            header["scene"]["reference"] = None if reference is None else len(reference)
            header["scene"]["area"] = header["scene"]["picture"] = None
        text = json.dumps(header).encode()
        lengths = np.array([len(blob) for blob in blobs], dtype="<u8").tobytes()
        return b"".join([struct.pack("<QQ", len(text), len(blobs)), text, lengths, *blobs])

    @classmethod
    def from_bytes(cls, message: bytes) -> Self:
        """Return the outcome of bytes that `to_bytes` made."""
        size, count = struct.unpack_from("<QQ", message)
        header = json.loads(message[16 : 16 + size])
        start = 16 + size
        ends = start + 8 * count + np.cumsum(np.frombuffer(message, "<u8", count, start)).astype(int)
        begins = [start + 8 * count, *ends[:-1].tolist()]
        blobs = [message[begin:end] for begin, end in zip(begins, ends.tolist(), strict=False)]
        number = header["detections"]
        header["detections"] = tuple(blobs[:number])
        header["cost"] = Cost(**header["cost"])
        scores = []
        for score in header["scores"]:
            tables = tuple(blobs[number : number + score["verdicts"]])
            number += len(tables)
            recipe, notes = PluginRecipe(**score["evaluator"]), tuple(score["notes"])
            scores.append(Score(**{**score, "evaluator": recipe, "notes": notes, "verdicts": tables}))
        header["scores"] = tuple(scores)
        header["score_failures"] = tuple(
            ScoreFailure(**{**failure, "evaluator": PluginRecipe(**failure["evaluator"])})
            for failure in header.get("score_failures", ())
        )
        if header["scene"] is not None:
            record = header["scene"]
            if record["reference"] is not None:
                record["reference"] = tuple(blobs[number : number + record["reference"]])
            record["area"], record["picture"] = (blob or None for blob in blobs[-2:])
            for name in ("extent", "grid", "reference_ids", "building_ids"):
                record[name] = None if record[name] is None else tuple(record[name])
            header["scene"] = SceneRecord(**record)
        return cls(**header)


def _storable(value: Any) -> Any:
    """Return texts, however nested, in characters that UTF-8 has."""
    if isinstance(value, str):
        return value if value.isascii() else value.encode(errors="backslashreplace").decode()
    if isinstance(value, Mapping):
        return {_storable(name): _storable(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_storable(item) for item in value]
    return value


def _fields(record: Any) -> dict[str, Any]:
    """Return the fields of a dataclass by name; unlike `dataclasses.asdict` not recursive."""
    return {field.name: getattr(record, field.name) for field in fields(record)}


def footprints_of(
    wkb: Sequence[bytes],
    *,
    crs: str | None,
    ids: Sequence[int] | None = None,
    building_ids: Sequence[Any] | None = None,
    attributes: Mapping[str, Sequence[Any]] | None = None,
    source: str,
) -> Footprints:
    """Return stored geometries as footprints; they were checked before they were stored."""
    polygons: NDArray[np.object_] = np.empty(len(wkb), dtype=object)
    polygons[:] = shapely.from_wkb(list(wkb))
    return Footprints(
        polygons=polygons,
        crs=crs,
        ids=np.arange(len(wkb), dtype=np.int64) if ids is None else np.asarray(ids, dtype=np.int64),
        building_ids=None if building_ids is None else np.asarray(building_ids),
        attributes={name: np.asarray(column) for name, column in (attributes or {}).items()},
        source=source,
    )
