"""LAS, LAZ and COPC files: laser points read by chunk or by window, and written.

Nouns
-----
chunk
    Some 1e6 consecutive points of a file: what is unpacked at a time, so that reading needs the arrays of the result
    and one chunk, never a second copy of the file.
window
    ``(xmin, ymin, xmax, ymax)`` in metres; points on its border belong to it. A COPC file is read only where its
    octree meets the window.

Columns that a file carries but never fills (all return numbers, intensities, classes or colours 0) are None.
Points flagged *withheld* are left out: the standard (ASPRS LAS 1.4 R15, table 16) says they must not be processed.
"""

from __future__ import annotations

import datetime
import os
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import CRSError, InputError, OutputError
from ...core.inputs import require_file
from .crs import file_crs, parse_crs, require_metric
from .points import PointCloud

__all__ = ["LasHeader", "read_las_header", "read_points", "write_points"]

#: Name under which point files are written.
_SOFTWARE = "roofbench"
#: Length of the longest header (LAS 1.4), bytes.
_HEADER_BYTES = 375
#: Points unpacked at a time; about 100 MB with the scaled coordinates.
CHUNK = 1_000_000
#: GeoTIFF codes of linear units that are not metres, in the GeoKeys of LAS up to 1.3.
_FEET = {9002: "feet", 9003: "US survey feet", 9005: "Clarke's feet"}
#: How point files get another CRS.
_REPROJECT = "reproject it, for instance with pdal's filters.reprojection, or correct its record if that is wrong"
_HORIZONTAL_UNIT_KEY, _VERTICAL_UNIT_KEY = 3076, 4099


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


def read_las_header(path: str | os.PathLike[str], *, crs: str | None = None) -> LasHeader:
    """Read the header of a point file and check that roofbench can use it.

    Parameters
    ----------
    path : path
    crs : str, optional
        CRS that replaces the file's own (which is then not checked).

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
        _refuse_cut_off(file, header)
        scaling = np.concatenate([header.scales, header.offsets])
        if not np.isfinite(scaling).all() or (header.scales == 0).any():
            raise InputError(
                f"{file}: scale {header.scales.tolist()} and offset {header.offsets.tolist()} in its header give "
                "coordinates that are not finite: export it again"
            )
        if header.point_count == 0:
            raise InputError(f"{file} holds no points: leave it out or export it again")
        bounds = tuple(float(value) for value in (*header.mins, *header.maxs))
        if not np.isfinite(bounds).all():
            raise InputError(f"{file}: the bounds in its header, {bounds}, are not finite: export it again")
        own = None if crs is not None else _header_crs(file, header)
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
    progress: Callable[[int, int], None] | None = None,
) -> PointCloud:
    """Read the points of one or several files, in the order of the files.

    Parameters
    ----------
    paths : path or sequence of path
        All in one CRS; that is for the caller to check (`read_las_header`).
    window : tuple of float, optional
        ``(xmin, ymin, xmax, ymax)``, metres; everything when not given.
    progress : callable, optional
        Called with (points unpacked so far, points in all).

    Raises
    ------
    InputError
        A file that is missing, not LAS, truncated or broken.
    """
    files = [Path(path) for path in ([paths] if isinstance(paths, str | os.PathLike) else paths)]
    headers = [read_las_header(file, crs="") for file in files]
    total = sum(header.count for header in headers)
    columns = _Columns(total, colour=any(h.has_colour for h in headers), nir=any(h.has_nir for h in headers))
    own = all(header.software == _SOFTWARE for header in headers)
    seen = 0
    for header in headers:
        missed = window is not None and not _meet(window, header.bounds)
        for chunk in () if missed else _chunks(header, window):
            columns.add(chunk, window)
            seen += len(chunk)
            if progress is not None:
                progress(seen, total)
    return columns.cloud(stretch=not own)


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
            for name in ("return_number", "number_of_returns", "intensity", "classification"):
                column = getattr(part, name)
                if column is not None:
                    record[name] = column
            if part.colour is not None:
                for band, name in enumerate(("red", "green", "blue", "nir")[: part.colour.shape[1]]):
                    record[name] = part.colour[:, band]
            writer.write_points(record)


class _Columns:
    """Preallocated arrays that chunks are copied into; pages never written to cost no memory."""

    def __init__(self, total: int, *, colour: bool, nir: bool) -> None:
        self._filled = 0
        self._x, self._y, self._z = (np.empty(total, dtype=np.float64) for _ in range(3))
        self._small: dict[str, NDArray[Any]] = {
            "return_number": np.empty(total, dtype=np.uint8),
            "number_of_returns": np.empty(total, dtype=np.uint8),
            "classification": np.empty(total, dtype=np.uint8),
            "intensity": np.empty(total, dtype=np.uint16),
        }
        self._colour = np.empty((total, 3 + nir), dtype=np.uint16) if colour else None

    def add(self, chunk: Any, window: tuple[float, float, float, float] | None) -> None:
        keep = np.asarray(chunk.withheld) == 0
        x, y = np.asarray(chunk.x), np.asarray(chunk.y)
        if window is not None:
            keep &= (x >= window[0]) & (x <= window[2]) & (y >= window[1]) & (y <= window[3])
        everything = bool(keep.all())

        def kept(values: NDArray[Any]) -> NDArray[Any]:
            return values if everything else values[keep]

        new = slice(self._filled, self._filled + (len(keep) if everything else int(np.count_nonzero(keep))))
        self._x[new], self._y[new], self._z[new] = kept(x), kept(y), kept(np.asarray(chunk.z))
        for name, column in self._small.items():
            column[new] = kept(np.asarray(chunk[name]))
        if self._colour is not None:
            names = set(chunk.point_format.dimension_names)
            for band, name in enumerate(("red", "green", "blue", "nir")[: self._colour.shape[1]]):
                self._colour[new, band] = kept(np.asarray(chunk[name])) if name in names else 0
        self._filled = new.stop

    def cloud(self, *, stretch: bool) -> PointCloud:
        end = self._filled
        small = {name: column[:end] if column[:end].any() else None for name, column in self._small.items()}
        colour = None if self._colour is None else self._colour[:end]
        if colour is not None and colour.shape[1] == 4 and not colour[:, 3].any():
            colour = colour[:, :3]
        if colour is not None and not colour.any():
            colour = None
        if colour is not None and stretch and colour.max() <= 255:
            colour *= 257  # written as 8 bit by many programs: to the full range
        return PointCloud(x=self._x[:end], y=self._y[:end], z=self._z[:end], colour=colour, **small)


@contextmanager
def _opened(file: Path) -> Iterator[Any]:
    """Open a LAS or LAZ file; what laspy and lazrs raise inside the block becomes one sentence."""
    import laspy
    from laspy.errors import LaspyException
    from lazrs import LazrsError

    require_file(file, f"LAS, LAZ or COPC files, for instance {file}/*.laz")
    with file.open("rb") as stream:
        head = stream.read(_HEADER_BYTES)
    if head[:4] != b"LASF":
        raise InputError(
            f"{file} is not a LAS file: it begins with {head[:4]!r} instead of b'LASF'; give LAS, LAZ or COPC files"
        )
    _refuse_record_counts(file, head)
    try:
        with laspy.open(file) as reader:
            yield reader
    except InputError:
        raise
    except (LaspyException, LazrsError, OSError, RuntimeError, ValueError, EOFError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        if "not supported" in reason:
            raise InputError(f"{file} cannot be read ({reason}): write it anew, for instance with laszip") from error
        raise InputError(f"{file} is truncated or broken ({reason}): copy or download it again") from error


def _refuse_record_counts(file: Path, head: bytes) -> None:
    """Refuse a header that announces more records than the file can hold, since laspy would try to read them all."""
    size = file.stat().st_size
    counts = [(*struct.unpack_from("<I", head, 100), 54)] if len(head) >= 104 else []
    if len(head) == _HEADER_BYTES and head[25] >= 4:
        counts.append((*struct.unpack_from("<I", head, 243), 60))
    for count, least_bytes in counts:
        if count * least_bytes > size:
            raise InputError(
                f"{file} is truncated or broken (its header announces {count} records of variable length in {size} "
                "bytes): copy or download it again"
            )


def _refuse_cut_off(file: Path, header: Any) -> None:
    """Refuse a file that is shorter than its header says, before records of half a file are believed."""
    needed = header.offset_to_point_data
    if not header.are_points_compressed:
        needed += header.point_count * header.point_format.size
    size = file.stat().st_size
    if size < needed:
        raise InputError(
            f"{file} is truncated: it has {size} bytes, its header announces at least {needed}; "
            "copy or download it again"
        )


def _chunks(header: LasHeader, window: tuple[float, float, float, float] | None) -> Iterator[Any]:
    """Yield the points of a file by chunk; of a COPC file only those of the octree nodes in the window."""
    if header.is_copc and window is not None and not _covers(window, header.bounds):
        yield _copc_points(header, window)
        return
    with _opened(header.path) as reader:
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


def _header_crs(file: Path, header: Any) -> str | None:
    """Return the horizontal CRS of a header after checking its units, or None when there is no record."""
    from pyproj.exceptions import CRSError as ProjError

    _refuse_feet(file, header)
    try:
        crs = header.parse_crs()
    except ProjError as error:
        raise CRSError(f"{file}: its CRS record cannot be read ({error}): name the CRS by crs=") from error
    if crs is None:
        return None
    text = file_crs(crs)
    if text is not None:
        require_metric(crs.to_wkt(), str(file), remedy=_REPROJECT)
    return text


def _refuse_feet(file: Path, header: Any) -> None:
    """Refuse GeoKeys that name feet: their CRS code alone does not define the unit of the heights."""
    if header.vlrs.get("WktCoordinateSystemVlr"):
        return
    for record in header.vlrs.get("GeoKeyDirectoryVlr"):
        for key in record.geo_keys:
            unit = _FEET.get(key.value_offset) if key.tiff_tag_location == 0 else None
            if unit and key.id in (_HORIZONTAL_UNIT_KEY, _VERTICAL_UNIT_KEY):
                what = "coordinates" if key.id == _HORIZONTAL_UNIT_KEY else "heights"
                raise CRSError(f"{file}: its {what} are in {unit}, metres are needed: {_REPROJECT}")
