"""Chunks of point files: where the points of each lie, so that a window reads only the chunks that it meets.

Nouns
-----
chunk
    Consecutive points of a file that can be unpacked without the others: the chunks of LAZ (50 000 points, as most
    programs write them), and as many points of an uncompressed file. Points follow the flight, so that a chunk covers
    a small part of a large file.
chunk index
    The file ``chunks.npz`` beside the manifest of a folder of tiles: of each point file, by its SHA-256, the bounds of
    its chunks. It only saves time: without it, or where it does not fit a file, all points of a file are read.

LAZ files whose chunks differ in size (COPC, which has an octree) have no entry.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.output import whole_file

__all__ = [
    "CHUNK_INDEX",
    "chunk_size",
    "chunks_of_file",
    "fits",
    "met_points",
    "read_chunk_index",
    "refuse_broken_chunks",
    "write_chunk_index",
]

CHUNK_INDEX = "chunks.npz"
#: Points of a chunk of an uncompressed file.
_UNCOMPRESSED = 50_000

_Extent = tuple[float, float, float, float]


def chunk_size(header: Any) -> int | None:
    """Return the points of each chunk of a file with a laspy header, the last one excepted; None where they differ."""
    if not header.are_points_compressed:
        return _UNCOMPRESSED
    from lazrs import LazVlr

    for record in header.vlrs.get("LasZipVlr"):
        table = LazVlr(record.record_data_bytes())
        return None if table.uses_variable_size_chunks() else int(table.chunk_size())
    return None


def refuse_broken_chunks(file: Path, header: Any) -> None:
    """Refuse a LAZ file whose table of chunks cannot be that of its points.

    The decompressor reserves memory for what the table announces, and ends the process where there is none.

    Raises
    ------
    InputError
        The table lies outside the file, or its chunks need more bytes than the file has.
    lazrs.LazrsError, OSError
        The table cannot be read.
    """
    if not header.are_points_compressed or not header.point_count:
        return
    from lazrs import LazVlr, read_chunk_table

    size, start = file.stat().st_size, header.offset_to_point_data
    with file.open("rb") as stream:
        stream.seek(start)
        place = int.from_bytes(stream.read(8), "little", signed=True)
        if place == -1:  # written by a program that could not go back: the offset is at the end
            stream.seek(size - 8)
            place = int.from_bytes(stream.read(8), "little", signed=True)
        if not start + 8 <= place <= size - 8:
            raise _broken_chunks(file, "its table of chunks lies outside the file")
        stream.seek(place + 4)
        count = int.from_bytes(stream.read(4), "little")
        # A chunk begins with a point that is not compressed; some programs write one chunk without points at the end.
        if (count - 1) * header.point_format.size > size:
            raise _broken_chunks(file, f"its table announces {count} chunks in {size} bytes")
        for record in header.vlrs.get("LasZipVlr"):
            stream.seek(start)
            table = read_chunk_table(stream, LazVlr(record.record_data_bytes()))
            needed = sum(length for _, length in table)
            if needed > place - start:
                raise _broken_chunks(file, f"its chunks need {needed} bytes, there are {place - start}")


def _broken_chunks(file: Path, reason: str) -> InputError:
    return InputError(f"{file} is truncated or broken ({reason}): copy or download it again")


def chunks_of_file(reader: Any) -> NDArray[np.float64] | None:
    """Return the bounds of the chunks of an open file, shape (n, 4), metres; None where they differ in size."""
    size = chunk_size(reader.header)
    if size is None:
        return None
    found = []
    for part in reader.chunk_iterator(max(1_000_000 // size, 1) * size):
        x, y = np.asarray(part.x), np.asarray(part.y)
        starts = np.arange(0, len(x), size)
        lows = [np.minimum.reduceat(values, starts) for values in (x, y)]
        found.append(np.stack([*lows, *(np.maximum.reduceat(values, starts) for values in (x, y))], axis=1))
    return np.concatenate(found) if found else None


def met_points(reader: Any, chunks: NDArray[np.float64], window: _Extent, most: int) -> Iterator[Any]:
    """Yield the points of the chunks that meet a window, at most so many at a time (laspy records).

    The chunks must fit the file (`fits`).
    """
    size, count = chunk_size(reader.header), reader.header.point_count
    assert size is not None
    xmin, ymin, xmax, ymax = window
    met = (chunks[:, 0] <= xmax) & (chunks[:, 2] >= xmin) & (chunks[:, 1] <= ymax) & (chunks[:, 3] >= ymin)
    numbers = np.flatnonzero(met)
    for run in np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1):
        if not len(run):
            continue
        first, last = int(run[0]) * size, min((int(run[-1]) + 1) * size, count)
        reader.seek(first)
        while first < last:
            part = reader.read_points(min(last - first, most))
            if not len(part):
                return
            first += len(part)
            yield part


def fits(header: Any, chunks: NDArray[np.float64]) -> bool:
    """Return whether chunks have the number that a file has."""
    size = chunk_size(header)
    return size is not None and len(chunks) == -(-header.point_count // size)


def write_chunk_index(folder: Path, chunks: Mapping[str, NDArray[np.float64]]) -> None:
    """Write the chunk index of a folder, by the SHA-256 of its files; without files an old one is removed."""
    if not chunks:
        (folder / CHUNK_INDEX).unlink(missing_ok=True)
        return
    with whole_file(folder / CHUNK_INDEX, overwrite=True) as scratch, scratch.open("wb") as stream:
        np.savez_compressed(stream, **{name: np.ascontiguousarray(bounds) for name, bounds in chunks.items()})  # type: ignore[arg-type]


def read_chunk_index(folder: Path) -> Mapping[str, NDArray[np.float64]]:
    """Return the chunks of the files of a folder by SHA-256; none where there is no index that can be read."""
    file = folder / CHUNK_INDEX
    return _read(os.fspath(file), file.stat().st_mtime_ns) if file.is_file() else {}


@lru_cache(maxsize=4)
def _read(file: str, changed: int) -> Mapping[str, NDArray[np.float64]]:
    try:
        with np.load(file, allow_pickle=False) as stored:
            found = {name: stored[name] for name in stored.files}
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
        return {}
    return {name: bounds for name, bounds in found.items() if bounds.ndim == 2 and bounds.shape[1] == 4}
