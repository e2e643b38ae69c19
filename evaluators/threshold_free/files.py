"""Comparing two vector files in parts: from the files to indices and verdicts, with a bounded part in memory.

The work folder keeps what was read and found. It belongs to the contents of the two files and to what changes the
result; an evaluation of the same files that was interrupted goes on from there.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError, OutputError, RoofbenchError
from ...core.package import FOLDER, VERSION
from ...scenes.geodata.crs import common_crs
from ...scenes.geodata.footprint_stream import FootprintStream, open_stream
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.outline_batch import OutlineBatch
from ...scenes.geodata.polygon_repair import Repair
from ..overlay.left_out import repair_notes
from ..overlay.outline_store import Division, OutlineStore
from ..verdict_table import VerdictTable
from .evaluator import ThresholdFree, ThresholdFreeEvaluation
from .partitioned import evaluate_stores

__all__ = ["FileComparison", "evaluate_files", "serve"]

#: Footprints of each side in one part, about.
_PART = 200_000


@dataclass(frozen=True, eq=False)
class FileComparison:
    """Two files that were compared in parts.

    Attributes
    ----------
    evaluation : ThresholdFreeEvaluation
    verdicts : callable
        Returns the verdict tables of both sides.
    streams : tuple of FootprintStream
        Detected and reference.
    repaired : tuple of frozenset of int
        Features of each file whose outlines were repaired.
    """

    evaluation: ThresholdFreeEvaluation
    verdicts: Callable[[], tuple[VerdictTable, VerdictTable]]
    streams: tuple[FootprintStream, FootprintStream]
    repaired: tuple[frozenset[int], frozenset[int]]


@dataclass(frozen=True)
class _Task:
    """One side to be read, in a form that another process can take."""

    path: str
    building_id: str | None
    crs: str | None
    folder: Path
    division: Division


def evaluate_files(
    evaluator: ThresholdFree,
    streams: tuple[FootprintStream, FootprintStream],
    work: Path,
    *,
    parts: int | None = None,
    say: Callable[[str], None] = lambda sentence: None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> FileComparison:
    """Compare two files.

    Parameters
    ----------
    evaluator : ThresholdFree
    streams : tuple of FootprintStream
        Detected and reference.
    work : Path
        Work folder; what is there of an interrupted evaluation of the same files is used.
    parts : int, optional
        By default one for each 200 000 footprints. The result does not depend on it.
    say : callable
        Takes a sentence on what is being done.
    progress : callable
        Takes the number of finished parts and of all.

    Raises
    ------
    CRSError
        The files have no common CRS.
    """
    if all(stream.count for stream in streams):
        common_crs(streams[0].crs, streams[1].crs, (str(streams[0].file), str(streams[1].file)))
    division = Division(parts or 1 + max(stream.count for stream in streams) // _PART)
    _claim(work, _key(streams, division), say)
    stores = [OutlineStore(work / name, division) for name in ("detected", "reference")]
    tasks = [
        _Task(
            str(stream.file) if stream.layer is None else f"{stream.file}|layername={stream.layer}",
            stream.building_id,
            stream.crs,
            store.folder,
            division,
        )
        for stream, store in zip(streams, stores, strict=True)
        if not store.complete
    ]
    total = sum(stream.count for stream in streams)
    if tasks:
        say(f"sorting {total:,} footprints by place into {division.parts} parts")
    if len(tasks) > 1 and total > _PART:
        with _another_process(tasks.pop()):
            _read_side(tasks[0])
    else:
        for task in tasks:
            _read_side(task)
    say("comparing part by part")
    evaluation, verdicts = evaluate_stores(evaluator, stores[0], stores[1], work / "pairs", progress=progress)
    repairs = [tuple(Repair(*entry) for entry in store.facts["repairs"]) for store in stores]
    sources = [
        replace(Footprints.empty(source=str(stream.file)), repairs=found)
        for stream, found in zip(streams, repairs, strict=True)
    ]
    repaired = [frozenset(repair.id for repair in found if repair.action == "repaired") for found in repairs]
    return FileComparison(
        replace(evaluation, notes=(*repair_notes(*sources), *evaluation.notes)),
        verdicts,
        streams,
        (repaired[0], repaired[1]),
    )


def _key(streams: tuple[FootprintStream, FootprintStream], division: Division) -> str:
    """Return what the contents of a work folder depend on."""
    sides = []
    for stream in streams:
        with stream.file.open("rb") as content:
            checksum = hashlib.file_digest(content, "blake2b").hexdigest()
        sides.append([checksum, stream.layer, stream.building_id, stream.crs])
    facts = {"version": VERSION, "code": _code(), "parts": division.parts, "tile": division.tile, "sides": sides}
    return json.dumps(facts)


def _code() -> str:
    """Return a digest of the code that fills a work folder: parts that other code made are not continued."""
    digest = hashlib.sha256()
    for room in ("core", "scenes/geodata", "evaluators"):
        for path in sorted((FOLDER / room).rglob("*.py")):
            digest.update(path.relative_to(FOLDER).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def _claim(work: Path, key: str, say: Callable[[str], None]) -> None:
    """Make the work folder, or keep the one of an interrupted evaluation of the same files."""
    marker = work / "key.json"
    if marker.is_file() and marker.read_text(encoding="utf-8") == key:
        say(f"resuming the interrupted evaluation in {work}")
        return
    if work.exists():
        shutil.rmtree(work)
    work.mkdir(parents=True)
    marker.write_text(key, encoding="utf-8")


def _read_side(task: _Task) -> None:
    """Write one file into its store."""
    stream = open_stream(task.path, building_id=task.building_id, crs=task.crs)
    store = OutlineStore(task.folder, task.division)
    labels: list[Any] = []
    repairs: list[Repair] = []

    def batches() -> Iterator[OutlineBatch]:
        for outlines, own in stream.outlines():
            labels.append(own)
            repairs.extend(outlines.repairs)
            yield outlines

    store.write(batches())
    codes = None if stream.building_id is None or not labels else _building_codes(labels)
    entries = [[repair.id, repair.problem, repair.action] for repair in repairs]
    store.finish(codes, source=str(stream.file), repairs=entries)


@contextmanager
def _another_process(task: _Task) -> Iterator[None]:
    """Read a side in another process while the block runs, and wait for it."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with subprocess.Popen(  # noqa: S603 - our own interpreter with our own code
        [sys.executable, "-P", "-c", f"from {__name__} import serve; serve()"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:
        try:
            assert process.stdin is not None
            process.stdin.write(
                json.dumps([task.path, task.building_id, task.crs, str(task.folder), task.division.parts])
            )
            process.stdin.close()
            yield
            said = process.stdout.read() if process.stdout is not None else ""
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        if process.returncode == 2:
            raise InputError(said.strip())
        raise OutputError(f"{task.path} could not be read in parts: the process ended with code {process.returncode}")


def serve() -> None:
    """Read the side that standard input names; leave with code 2 and a sentence on standard output on bad input."""
    path, building_id, crs, folder, parts = json.load(sys.stdin)
    try:
        _read_side(_Task(path, building_id, crs, Path(folder), Division(parts)))
    except (RoofbenchError, OSError) as error:
        sys.stdout.write(str(error))
        sys.exit(2)


def _building_codes(labels: list[Any]) -> NDArray[np.int64]:
    """Return the building of each row as numbers from 0; rows without a value get one of their own."""
    import pyarrow
    import pyarrow.compute

    column = pyarrow.chunked_array(labels)
    if pyarrow.types.is_floating(column.type):
        column = pyarrow.compute.if_else(pyarrow.compute.is_nan(column), None, column)
    elif pyarrow.types.is_string(column.type) or pyarrow.types.is_large_string(column.type):
        column = pyarrow.compute.if_else(pyarrow.compute.equal(column, ""), None, column)
    encoded = column.combine_chunks().dictionary_encode()
    codes: NDArray[np.int64] = encoded.indices.fill_null(-1).to_numpy(zero_copy_only=False).astype(np.int64)
    lacking = np.flatnonzero(codes < 0)
    codes[lacking] = len(encoded.dictionary) + np.arange(len(lacking))
    return codes
