"""Shapefiles: whether their parts belong together, before GDAL reads fewer rows than there are.

A Shapefile is three files: outlines (.shp), their places in it (.shx) and a table (.dbf), with a row for each outline.
GDAL reads what the shorter of index and table names, and a row whose outline is damaged has no geometry.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from ...core.wording import counted

__all__ = ["damaged_rows", "refuse_broken_parts"]

#: Bytes of the headers of .shp and .shx.
_HEADER = 100
#: What to do about an index that does not fit.
_RESTORE = (
    "copy the file again with all its parts, or restore the .shx (delete an old one) with ogrinfo --config "
    "SHAPE_RESTORE_SHX YES"
)


def refuse_broken_parts(file: Path) -> None:
    """Raise `InputError` when a .shp is cut off, has no index, or index or table have fewer rows than outlines."""
    size = file.stat().st_size
    with file.open("rb") as stream:
        head = stream.read(28)
    announced = 2 * int.from_bytes(head[24:28], "big")
    if len(head) < 28 or size < announced:
        raise InputError(
            f"{file} is truncated: it has {size} bytes, its header announces {announced}; copy or download it again"
        )
    if _part(file, ".shx") is None:
        raise InputError(f"{file}: its index ({file.stem}.shx) is missing: {_RESTORE}")
    index = _index(file)
    if index is None or not (len(index) or announced > _HEADER):
        return
    announced_rows = _announced_rows(file)
    if announced_rows is not None and announced_rows < len(index):
        raise InputError(
            f"{file}: its index (.shx) has {counted(len(index), 'row')} and announces {announced_rows}, so outlines "
            f"would be missing: {_RESTORE}"
        )
    end = int((index.sum(axis=1) + 4).max(initial=_HEADER // 2)) * 2
    if end < announced:
        raise InputError(
            f"{file}: its index (.shx) of {counted(len(index), 'row')} ends at byte {end} of {announced}, so outlines "
            f"are missing from it: {_RESTORE}"
        )
    rows = _table_rows(file)
    if rows is not None and rows != len(index):
        numbers = f"{counted(rows, 'row')} for {counted(len(index), 'outline')}"
        raise InputError(
            f"{file}: its table (.dbf) has {numbers}, so they are not of one file: copy "
            "it again with all its parts, or delete the .dbf to read outlines alone"
        )


def damaged_rows(file: Path, missing: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Return the rows without geometry whose outline is there, though GDAL cannot read it.

    Parameters
    ----------
    file : Path
    missing : ndarray of int64
        Rows without geometry.
    count : int
        Number of rows that were read; where rows are deleted they cannot be assigned to outlines.
    """
    index = _index(file) if len(missing) else None
    if index is None or len(index) != count:
        return np.empty(0, dtype=np.int64)
    damaged = []
    with file.open("rb") as stream:
        for row in missing.tolist():
            stream.seek(int(index[row, 0]) * 2 + 8)
            is_none = stream.read(4) == b"\0\0\0\0"  # the type of an outline
            if not is_none or index[row, 0] * 2 < _HEADER:
                damaged.append(row)
    return np.array(damaged, dtype=np.int64)


def _index(file: Path) -> NDArray[np.int64] | None:
    """Return place and length of each outline, 16-bit words, shape (n, 2); None where there is no whole index."""
    part = _part(file, ".shx")
    if part is None:
        return None
    content = part.read_bytes()[_HEADER:]
    if len(content) % 8:
        return None
    return np.frombuffer(content, dtype=">i4").reshape(-1, 2).astype(np.int64)


def _announced_rows(file: Path) -> int | None:
    """Return the number of rows that the header of the index announces; None where it cannot be a number of rows."""
    part = _part(file, ".shx")
    if part is None:
        return None
    with part.open("rb") as stream:
        head = stream.read(28)
    rows, rest = divmod(2 * int.from_bytes(head[24:28], "big") - _HEADER, 8)
    return rows if rows >= 0 and not rest else None


def _table_rows(file: Path) -> int | None:
    part = _part(file, ".dbf")
    if part is None:
        return None
    with part.open("rb") as stream:
        head = stream.read(8)
    return int.from_bytes(head[4:8], "little") if len(head) == 8 else None


def _part(file: Path, suffix: str) -> Path | None:
    """Return the part of a Shapefile with an ending in small or capital letters."""
    for ending in (suffix, suffix.upper()):
        part = file.with_suffix(ending)
        if part.is_file():
            return part
    return None
