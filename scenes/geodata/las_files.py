"""LAS, LAZ and COPC files: laser points read by chunk or by window, and written.

Nouns
-----
chunk
    Some 1e6 consecutive points of a file: what is unpacked at a time, so that reading needs the arrays of the result
    and one chunk, never a second copy of the file.
window
    ``(xmin, ymin, xmax, ymax)`` in metres; points on its border belong to it. A COPC file is read only where its
    octree meets the window, other files only in the chunks that do, where their bounds are known (`point_chunks`).

Columns that a file carries but never fills (all return numbers, intensities, classes or colours 0) are None.
Points flagged *withheld* are left out: the standard (ASPRS LAS 1.4 R15, table 16) says they must not be processed.
"""

from __future__ import annotations

import datetime
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError, OutputError
from ...core.inputs import require_file
from .colour_depth import common_depths, depth_note, scaled_to_16_bit, stretch_to_16_bit
from .crs import parse_crs
from .las_headers import (
    HEADER_BYTES,
    header_crs,
    refuse_counts,
    refuse_cut_off,
    refuse_pointwise,
    refuse_record_counts,
    refuse_version,
)
from .point_chunks import chunks_of_file, fits, met_points, refuse_broken_chunks
from .points import PointCloud

__all__ = ["LasHeader", "read_chunks", "read_las_header", "read_points", "write_points"]

#: Name under which point files are written.
_SOFTWARE = "roofbench"
#: Dimensions of LAS by the names of the columns of a cloud.
_DIMENSIONS = {
    "return_number": "return_number",
    "number_of_returns": "number_of_returns",
    "intensity": "intensity",
    "classification": "classification",
    "source": "point_source_id",
}
#: Largest coordinate, metres; beyond it a header is broken.
_LARGEST = 1e9
#: Points unpacked at a time; about 100 MB with the scaled coordinates.
CHUNK = 1_000_000


@dataclass(frozen=True)
class LasHeader:
    """What a point file says of itself.

    Attributes
    ----------
    path : Path
    count : int
        Number of points, withheld ones included.
    bounds : tuple of float
        ``(xmin, ymin, zmin, xmax, ymax, zmax)``, metres.
    crs : str, optional
        Horizontal CRS, None when the file has no record of it.
    version : str
        ``"1.4"``.
    point_format : int
        0 to 10.
    has_colour, has_nir : bool
        Whether the point format carries red, green, blue, and near infrared (perhaps all 0).
    is_copc : bool
    software : str
        What wrote it.
    """

    path: Path
    count: int
    bounds: tuple[float, float, float, float, float, float]
    crs: str | None
    version: str
    point_format: int
    has_colour: bool
    has_nir: bool
    is_copc: bool
    software: str


def read_las_header(path: str | os.PathLike[str], *, crs: str | None = None, fallback: str | None = None) -> LasHeader:
    """Read the header of a point file and check that roofbench can use it.

    Parameters
    ----------
    path : path
    crs : str, optional
        CRS that replaces the file's own (which is then not checked).
    fallback : str, optional
        CRS to assign where the record of the file cannot be read.

    Raises
    ------
    InputError
        Missing, not LAS, truncated, no points, coordinates that are not finite.
    CRSError
        Geographic, or horizontal or vertical units that are not metres.
    """
    file = Path(path)
    with _opened(file) as reader:
        header = reader.header
        refuse_cut_off(file, header)
        scaling = np.concatenate([header.scales, header.offsets])
        if not np.isfinite(scaling).all() or (header.scales == 0).any():
            raise InputError(
                f"{file}: scale {header.scales.tolist()} and offset {header.offsets.tolist()} in its header give "
                "coordinates that are not finite: export it again"
            )
        refuse_counts(file, header)
        bounds = tuple(float(value) for value in (*header.mins, *header.maxs))
        if not (np.abs(bounds) <= _LARGEST).all():
            shown = ", ".join(f"{value:.9g}" for value in bounds)
            raise InputError(f"{file}: the bounds in its header, ({shown}), are not finite: export it again")
        if not any(bounds):
            raise InputError(
                f"{file}: the bounds in its header are all 0: write the header anew, for instance with lasinfo "
                "-repair, or export it again if all its points lie at (0, 0, 0)"
            )
        if (header.mins > header.maxs).any():
            raise InputError(
                f"{file}: the bounds in its header end before they begin, from {header.mins.tolist()} to "
                f"{header.maxs.tolist()}: write the header anew, for instance with lasinfo -repair"
            )
        own = None if crs is not None else header_crs(file, header, fallback)
        names = set(header.point_format.dimension_names)
        return LasHeader(
            path=file,
            count=int(header.point_count),
            bounds=bounds,  # type: ignore[arg-type]
            crs=crs if crs is not None else own,
            version=str(header.version),
            point_format=int(header.point_format.id),
            has_colour="red" in names,
            has_nir="nir" in names,
            is_copc=bool(header.vlrs.get("CopcInfoVlr")),
            software=str(header.generating_software),
        )


def read_points(
    paths: Sequence[str | os.PathLike[str]] | str | os.PathLike[str],
    *,
    window: tuple[float, float, float, float] | None = None,
    chunks: Mapping[Path, NDArray[np.float64]] | None = None,
    progress: Callable[[int, int], None] | None = None,
    note: Callable[[str], None] | None = None,
) -> PointCloud:
    """Read the points of one or several files, in the order of the files.

    Parameters
    ----------
    paths : path or sequence of path
        All in one CRS; that is for the caller to check (`read_las_header`).
    window : tuple of float, optional
        ``(xmin, ymin, xmax, ymax)``, metres; everything when not given.
    chunks : mapping of Path to ndarray, optional
        Bounds of the chunks of files (`point_chunks`): a window reads only those that it meets.
    progress : callable, optional
        Called with (points unpacked so far, points in all).
    note : callable, optional
        Called with a sentence where colours of 10 to 14 bit are scaled to 16; without it they stay as they are.

    Raises
    ------
    InputError
        A file that is missing, not LAS, truncated or broken.
    """
    files = [Path(path) for path in ([paths] if isinstance(paths, str | os.PathLike) else paths)]
    headers = [read_las_header(file, crs="") for file in files]
    total = sum(header.count for header in headers)
    columns = _Columns(total, colour=any(h.has_colour for h in headers), nir=any(h.has_nir for h in headers))
    seen = 0
    for header in headers:
        missed = window is not None and not _meet(window, header.bounds)
        for chunk in () if missed else _chunks(header, window, (chunks or {}).get(header.path)):
            columns.add(chunk, window, header.bounds)
            seen += len(chunk)
            if progress is not None:
                progress(seen, total)
        columns.end_file(header)
    if seen and columns.withheld == seen:
        raise InputError(f"{files[0]}: all points are flagged as withheld, which means that they must not be used")
    if note is not None:
        columns.scale_colours(note)
    return columns.cloud()


@contextmanager
def _written(path: str | os.PathLike[str]) -> Iterator[None]:
    """Raise `OutputError` when LAZ compression fails; the library names neither file nor reason."""
    from lazrs import LazrsError

    try:
        yield
    except LazrsError as error:
        raise OutputError(f"{Path(path).name} cannot be written ({error}): is there room on the disk?") from error


def write_points(cloud: PointCloud, path: str | os.PathLike[str], *, crs: str | None = None) -> None:
    """Write a point cloud as LAS 1.4 (LAZ when `path` ends in ``.laz``), coordinates rounded to 1 mm.

    The same points give the same bytes on any day: the creation date is fixed.
    """
    import laspy

    point_format = 6 if cloud.colour is None else 7 if cloud.colour.shape[1] == 3 else 8
    header = laspy.LasHeader(version="1.4", point_format=point_format)
    header.creation_date = datetime.date(2000, 1, 1)
    header.generating_software = _SOFTWARE
    header.scales = np.full(3, 0.001)
    if len(cloud):
        header.offsets = np.floor([cloud.x.min(), cloud.y.min(), cloud.z.min()])
    if crs is not None:
        header.add_crs(parse_crs(crs))
    with _written(path), laspy.open(os.fspath(path), mode="w", header=header) as writer:
        for start in range(0, len(cloud), CHUNK):
            part = cloud.take(slice(start, start + CHUNK))
            record = laspy.ScaleAwarePointRecord.zeros(len(part), header=header)
            record.x, record.y, record.z = part.x, part.y, part.z
            for name, dimension in _DIMENSIONS.items():
                column = getattr(part, name)
                if column is not None:
                    record[dimension] = column
            if part.colour is not None:
                for band, name in enumerate(("red", "green", "blue", "nir")[: part.colour.shape[1]]):
                    record[name] = part.colour[:, band]
            writer.write_points(record)


class _Columns:
    """Preallocated arrays that chunks are copied into; pages never written to cost no memory."""

    def __init__(self, total: int, *, colour: bool, nir: bool) -> None:
        self._filled, self._first = 0, 0
        self._outside = 0
        self._foreign: list[tuple[Path, slice, int]] = []
        self.withheld = 0
        self._x, self._y, self._z = (np.empty(total, dtype=np.float64) for _ in range(3))
        self._small: dict[str, NDArray[Any]] = {
            "return_number": np.empty(total, dtype=np.uint8),
            "number_of_returns": np.empty(total, dtype=np.uint8),
            "classification": np.empty(total, dtype=np.uint8),
            "intensity": np.empty(total, dtype=np.uint16),
            "source": np.empty(total, dtype=np.uint16),
        }
        self._colour = np.empty((total, 3 + nir), dtype=np.uint16) if colour else None

    def add(
        self,
        chunk: Any,
        window: tuple[float, float, float, float] | None,
        bounds: tuple[float, float, float, float, float, float],
    ) -> None:
        """Append the points of a chunk in a window, and count those outside the bounds of their file."""
        keep = np.asarray(chunk.withheld) == 0
        self.withheld += len(keep) - int(np.count_nonzero(keep))
        x, y = np.asarray(chunk.x), np.asarray(chunk.y)
        # Rounded outwards to whole metres, like the extent of a scene: small errors of a header lose no points.
        low, high = np.floor(bounds[:2]), np.ceil(bounds[3:5])
        inside = (x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1])
        self._outside += int(np.count_nonzero(keep & ~inside))
        if window is not None:
            keep &= (x >= window[0]) & (x <= window[2]) & (y >= window[1]) & (y <= window[3])
        everything = bool(keep.all())

        def kept(values: NDArray[Any]) -> NDArray[Any]:
            return values if everything else values[keep]

        new = slice(self._filled, self._filled + (len(keep) if everything else int(np.count_nonzero(keep))))
        self._x[new], self._y[new], self._z[new] = kept(x), kept(y), kept(np.asarray(chunk.z))
        for name, column in self._small.items():
            column[new] = kept(np.asarray(chunk[_DIMENSIONS[name]]))
        if self._colour is not None:
            names = set(chunk.point_format.dimension_names)
            for band, name in enumerate(("red", "green", "blue", "nir")[: self._colour.shape[1]]):
                self._colour[new, band] = kept(np.asarray(chunk[name])) if name in names else 0
        self._filled = new.stop

    def end_file(self, header: LasHeader) -> None:
        """Check the points of a file against its header, and stretch its colours to 16 bit.

        Many programs write colours of 8 bit as they are; each file is taken by itself, since tiles are mixed.
        """
        if self._outside:
            xmin, ymin, _, xmax, ymax, _ = header.bounds
            raise InputError(
                f"{header.path}: {self._outside} points lie outside the bounds in its header (x {xmin:.1f} to "
                f"{xmax:.1f}, y {ymin:.1f} to {ymax:.1f}): write the header anew, for instance with lasinfo -repair"
            )
        if self._colour is not None and header.software != _SOFTWARE:
            rows = slice(self._first, self._filled)
            part = self._colour[rows]
            narrow = int(part.max(initial=0)) <= 255
            for bands in (part[:, :3], part[:, 3:]):  # near infrared may have another depth
                stretch_to_16_bit(bands)
            if not narrow:
                self._foreign.append((header.path, rows, int(part.max(initial=0))))
        self._first = self._filled

    def scale_colours(self, note: Callable[[str], None]) -> None:
        """Scale colours of files of 10 to 14 bit to 16, and report them."""
        depths = common_depths([largest for _, _, largest in self._foreign])
        for depth in sorted(set(depths) - {16}):
            files = [item for item, own in zip(self._foreign, depths, strict=True) if own == depth]
            for _, rows, _ in files:
                assert self._colour is not None
                self._colour[rows] = scaled_to_16_bit(self._colour[rows], depth)
            more = f" and {len(files) - 1} more" if len(files) > 1 else ""
            note(f"{files[0][0].name}{more}: {depth_note(depth)}")

    def cloud(self) -> PointCloud:
        """Return the points; columns that no file fills are None."""
        end = self._filled
        small = {name: column[:end] if column[:end].any() else None for name, column in self._small.items()}
        source = small["source"]
        if source is not None and (source == source[0]).all():
            small["source"] = None
        colour = None if self._colour is None else self._colour[:end]
        if colour is not None and colour.shape[1] == 4 and not colour[:, 3].any():
            colour = colour[:, :3]
        if colour is not None and not colour.any():
            colour = None
        return PointCloud(x=self._x[:end], y=self._y[:end], z=self._z[:end], colour=colour, **small)


@contextmanager
def _opened(file: Path) -> Iterator[Any]:
    """Open a LAS or LAZ file; what laspy and lazrs raise inside the block becomes one sentence."""
    import laspy
    from laspy.errors import LaspyException
    from lazrs import LazrsError

    require_file(file, f"LAS, LAZ or COPC files, for instance {file}/*.laz")
    with file.open("rb") as stream:
        head = stream.read(HEADER_BYTES)
    if not head:
        raise InputError(f"{file} is empty: give LAS, LAZ or COPC files")
    if head[:4] != b"LASF":
        raise InputError(
            f"{file} is not a LAS file: it begins with {head[:4]!r} instead of b'LASF'; give LAS, LAZ or COPC files"
        )
    refuse_version(file, head)
    refuse_record_counts(file, head)
    try:
        # Not laszip, which laspy would take where it is installed: the same decompressor reads everywhere.
        backends = (laspy.LazBackend.LazrsParallel, laspy.LazBackend.Lazrs)
        with laspy.open(file, laz_backend=backends) as reader:
            refuse_pointwise(file, reader.header)
            refuse_broken_chunks(file, reader.header)
            yield reader
    except InputError:
        raise
    except (LaspyException, LazrsError, OSError, RuntimeError, ValueError, EOFError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        if "not supported" in reason:
            raise InputError(f"{file} cannot be read ({reason}): write it anew, for instance with laszip") from error
        raise InputError(f"{file} is truncated or broken ({reason}): copy or download it again") from error
    except BaseException as error:
        # The decompressor panics on what it does not know, which is no ordinary exception.
        if type(error).__name__ != "PanicException":
            raise
        raise InputError(
            f"{file} cannot be decompressed ({error}): write it anew with a current laszip, or copy it again"
        ) from error


def read_chunks(path: Path) -> NDArray[np.float64] | None:
    """Return the bounds of the chunks of a point file, shape (n, 4), metres; None where they differ in size."""
    with _opened(path) as reader:
        return chunks_of_file(reader)


def _chunks(
    header: LasHeader, window: tuple[float, float, float, float] | None, bounds: NDArray[np.float64] | None
) -> Iterator[Any]:
    """Yield the points of a file by chunk; of a window only the chunks, or nodes of a COPC file, that it meets."""
    if header.is_copc and window is not None and not _covers(window, header.bounds):
        yield _copc_points(header, window)
        return
    with _opened(header.path) as reader:
        if window is not None and bounds is not None and fits(reader.header, bounds):
            yield from met_points(reader, bounds, window, CHUNK)
            return
        found = 0
        for chunk in reader.chunk_iterator(CHUNK):
            found += len(chunk)
            yield chunk
    if found != header.count:
        raise InputError(
            f"{header.path} is truncated: {found} of the {header.count} points that its header announces are there; "
            "copy or download it again"
        )


def _copc_points(header: LasHeader, window: tuple[float, float, float, float]) -> Any:
    import laspy
    from laspy.errors import LaspyException
    from lazrs import LazrsError

    # Cut to the points, since laspy turns the window into 32 bit numbers.
    low = np.maximum(window[:2], header.bounds[:2])
    high = np.minimum(window[2:], header.bounds[3:5])
    try:
        with laspy.CopcReader.open(header.path) as reader:
            return reader.query(laspy.copc.Bounds(mins=low, maxs=high))
    except (LaspyException, LazrsError, OSError, RuntimeError, ValueError) as error:
        raise InputError(f"{header.path} is truncated or broken ({error}): copy or download it again") from error


def _covers(window: tuple[float, float, float, float], bounds: tuple[float, float, float, float, float, float]) -> bool:
    return window[0] <= bounds[0] and window[1] <= bounds[1] and window[2] >= bounds[3] and window[3] >= bounds[4]


def _meet(window: tuple[float, float, float, float], bounds: tuple[float, float, float, float, float, float]) -> bool:
    return window[0] <= bounds[3] and window[2] >= bounds[0] and window[1] <= bounds[4] and window[3] >= bounds[1]
