"""Vector files read into stores of outlines, in a work folder that belongs to their contents.

The work folder keeps what was read and found, so a comparison of the same files that was interrupted continues from
there.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError, OutputError, RoofbenchError
from ...core.package import FOLDER, VERSION
from ...core.tasks import run_tasks
from ...scenes.geodata.common_place import Extent, extent_warnings
from ...scenes.geodata.crs import common_crs
from ...scenes.geodata.footprint_stream import FootprintStream, open_stream
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.outline_batch import OutlineBatch
from ...scenes.geodata.polygon_repair import Repair
from .outline_arrays import polygons_of
from .outline_store import Division, OutlineStore

__all__ = ["FileStores", "serve", "store_files"]

#: Footprints of each side in one part, about.
_PART = 200_000
#: Integers that name buildings serve as codes where they span less than so many times their number.
_SPARSE = 4


@dataclass(frozen=True, eq=False)
class FileStores:
    """Some files, read into stores.

    Attributes
    ----------
    streams : tuple of FootprintStream
    stores : tuple of OutlineStore
        Complete, of one division.
    work : Path
        Work folder.
    """

    streams: tuple[FootprintStream, ...]
    stores: tuple[OutlineStore, ...]
    work: Path

    @property
    def count(self) -> int:
        """Number of footprints of all files."""
        return sum(len(store.objects) for store in self.stores)

    def footprints(self, place: int) -> Footprints:
        """Return the footprints of a file, which must fit into the memory, without their attributes."""
        objects, stream = self.stores[place].objects, self.streams[place]
        rows = np.arange(len(objects))
        polygons = polygons_of(self.stores[place].outlines(rows), rows)
        return Footprints(polygons=polygons, crs=stream.crs, ids=objects.ids, source=str(stream.file))

    def repairs(self, place: int) -> Footprints:
        """Return the name and the repairs of a file, as a set of no footprints."""
        repairs = tuple(Repair(*entry) for entry in self.stores[place].facts["repairs"])
        return replace(Footprints.empty(source=str(self.streams[place].file)), repairs=repairs)

    def warnings(self) -> list[str]:
        """Return signs that the last file, the reference, is of another place than one of the others."""
        extents = [
            Extent(store.facts["bounds"], stream.crs, str(stream.file))
            for store, stream in zip(self.stores, self.streams, strict=True)
        ]
        found = [warning for other in extents[:-1] for warning in extent_warnings(other, extents[-1])]
        return list(dict.fromkeys(found))

    def repaired(self, place: int) -> frozenset[int]:
        """Return the features of a file whose outlines were repaired."""
        return frozenset(repair.id for repair in self.repairs(place).repairs if repair.action == "repaired")


@dataclass(frozen=True)
class _Task:
    """One side to be read, in a form that another process can take."""

    path: str
    building_id: str | None
    crs: str | None
    folder: Path
    division: Division


def store_files(
    streams: Sequence[FootprintStream],
    names: Sequence[str],
    work: Path,
    *,
    parts: int | None = None,
    executor: Executor | None = None,
    say: Callable[[str], None] = lambda sentence: None,
) -> FileStores:
    """Read files into stores, or keep those of an interrupted comparison of the same files.

    Parameters
    ----------
    streams : sequence of FootprintStream
    names : sequence of str
        Names of the stores in the work folder.
    work : Path
    parts : int, optional
        By default one for each 200 000 footprints.
    executor : Executor, optional
        Where files are read; its processes must see the files and the work folder under the same paths. By default on
        this machine.
    say : callable
        Takes a sentence on what is being done.

    Raises
    ------
    CRSError
        The files have no common CRS.
    """
    some = [stream for stream in streams if stream.count]
    for stream in some[1:]:
        common_crs(some[0].crs, stream.crs, (str(some[0].file), str(stream.file)))
    division = Division(parts or 1 + max(stream.count for stream in streams) // _PART)
    _claim(work, _key(streams, division), say)
    stores = [OutlineStore(work.absolute() / name, division) for name in names]
    # The processes of an executor may have another working folder.
    paths = [stream.file if executor is None else stream.file.absolute() for stream in streams]
    tasks = [
        _Task(
            str(path) if stream.layer is None else f"{path}|layername={stream.layer}",
            stream.building_id,
            stream.crs,
            store.folder,
            division,
        )
        for path, stream, store in zip(paths, streams, stores, strict=True)
        if not store.complete
    ]
    total = sum(stream.count for stream in streams)
    if tasks:
        say(f"sorting {total:,} footprints by place into {division.parts} parts")
    if executor is not None:
        for _ in run_tasks(_read_side, tasks, executor):
            pass
    elif len(tasks) > 1 and total > _PART:
        with _another_process(tasks.pop()):
            for task in tasks:
                _read_side(task)
    else:
        for task in tasks:
            _read_side(task)
    files = FileStores(tuple(streams), tuple(stores), work)
    for warning in files.warnings():
        say(warning)
    return files


def _key(streams: Sequence[FootprintStream], division: Division) -> str:
    """Return what the contents of a work folder depend on."""
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        checksums = list(pool.map(_checksum, [stream.file for stream in streams]))
    sides = [
        [checksum, stream.layer, stream.building_id, stream.crs]
        for checksum, stream in zip(checksums, streams, strict=True)
    ]
    facts = {"version": VERSION, "code": _code(), "parts": division.parts, "tile": division.tile, "sides": sides}
    return json.dumps(facts)


def _checksum(file: Path) -> str:
    with file.open("rb") as content:
        return hashlib.file_digest(content, "blake2b").hexdigest()


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
        for unfinished in work.glob(".*"):
            shutil.rmtree(unfinished, ignore_errors=True)
        return
    if work.exists():
        shutil.rmtree(work)
    work.mkdir(parents=True)
    marker.write_text(key, encoding="utf-8")


def _read_side(task: _Task) -> None:
    """Write one file into its store."""
    import pyarrow

    stream = open_stream(task.path, building_id=task.building_id, crs=task.crs)
    store = OutlineStore(task.folder, task.division)
    labels: list[Any] = []
    repairs: list[Repair] = []
    corners: list[NDArray[np.float64]] = []

    def batches() -> Iterator[OutlineBatch]:
        for outlines, own in stream.outlines():
            labels.append(own)
            repairs.extend(outlines.repairs)
            if len(outlines):
                corners.extend([np.nanmin(outlines.points, axis=0), np.nanmax(outlines.points, axis=0)])
            yield outlines

    store.write(batches())
    codes = None if stream.building_id is None or not labels else _building_codes(labels)
    entries = [[repair.id, repair.problem, repair.action] for repair in repairs]
    bounds = [*np.min(corners, axis=0).tolist(), *np.max(corners, axis=0).tolist()] if corners else None
    store.finish(codes, source=str(stream.file), repairs=entries, bounds=bounds)
    labels.clear()
    # Of a file of ten million footprints the pool keeps a gigabyte for later, which never comes.
    pyarrow.default_memory_pool().release_unused()


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
    if pyarrow.types.is_integer(column.type) and len(column) and not column.null_count:
        extremes = pyarrow.compute.min_max(column)
        low, high = extremes["min"].as_py(), extremes["max"].as_py()
        if high - low < _SPARSE * len(column):  # they are codes already: a dictionary would take ten times the memory
            numbers = (part.to_numpy() - low for part in column.chunks)
            return np.concatenate([number.astype(np.int64) for number in numbers])
    if pyarrow.types.is_floating(column.type):
        column = pyarrow.compute.if_else(pyarrow.compute.is_nan(column), None, column)
    elif pyarrow.types.is_string(column.type) or pyarrow.types.is_large_string(column.type):
        column = pyarrow.compute.if_else(pyarrow.compute.equal(column, ""), None, column)
    encoded = column.combine_chunks().dictionary_encode()
    codes: NDArray[np.int64] = encoded.indices.fill_null(-1).to_numpy(zero_copy_only=False).astype(np.int64)
    lacking = np.flatnonzero(codes < 0)
    codes[lacking] = len(encoded.dictionary) + np.arange(len(lacking))
    return codes
