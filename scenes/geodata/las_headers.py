"""Headers of point files: what is refused before anything is read, and the CRS that their records name."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from ...core.errors import CRSError, InputError
from .crs import crs_label, file_crs, height_unit, misfit, require_metric
from .geo_keys import foreign_units, is_user_defined, user_defined_crs

__all__ = [
    "HEADER_BYTES",
    "header_crs",
    "refuse_counts",
    "refuse_cut_off",
    "refuse_pointwise",
    "refuse_record_counts",
    "refuse_version",
]

#: Length of the longest header (LAS 1.4), bytes.
HEADER_BYTES = 375
#: Versions that are read: major, and minor numbers.
_MAJOR, _MINORS = 1, range(5)
#: Largest number of a point format.
_LAST_FORMAT = 10
#: Compressor in the record of LASzip: one stream of points, without chunks.
_POINTWISE = b"\x01\x00"
#: How point files get another CRS.
_REPROJECT = "reproject it, for instance with pdal's filters.reprojection, or correct its record if that is wrong"


def refuse_version(file: Path, head: bytes) -> None:
    """Refuse a version of LAS that is not read; its header may have other fields at other places."""
    if len(head) > 25 and not (head[24] == _MAJOR and head[25] in _MINORS):
        raise InputError(
            f"{file} is of LAS version {head[24]}.{head[25]}, versions 1.0 to 1.4 are read: write it as LAS 1.4, for "
            "instance with pdal, or copy it again if that is not its version"
        )
    # The two highest bits mark compression.
    if len(head) > 104 and head[104] & 0x3F > _LAST_FORMAT:
        raise InputError(
            f"{file} has points of format {head[104] & 0x3F}, formats 0 to {_LAST_FORMAT} are read: copy or download "
            "it again"
        )


def refuse_record_counts(file: Path, head: bytes) -> None:
    """Refuse a header that announces more records than the file can hold, since laspy would try to read them all."""
    size = file.stat().st_size
    counts = [(*struct.unpack_from("<I", head, 100), 54)] if len(head) >= 104 else []
    if len(head) == HEADER_BYTES and head[25] >= 4:
        counts.append((*struct.unpack_from("<I", head, 243), 60))
    for count, least_bytes in counts:
        if count * least_bytes > size:
            raise InputError(
                f"{file} is truncated or broken (its header announces {count} records of variable length in {size} "
                "bytes): copy or download it again"
            )


def refuse_pointwise(file: Path, header: Any) -> None:
    """Refuse what the first releases of LASzip wrote, one stream without chunks: the decompressor panics on it."""
    for record in header.vlrs.get("LasZipVlr"):
        if record.record_data_bytes()[:2] == _POINTWISE:
            raise InputError(
                f"{file} is compressed point by point, as the first releases of LASzip did: write it anew, for "
                "instance with a current laszip"
            )


def refuse_counts(file: Path, header: Any) -> None:
    """Refuse a number of points that is 0, or that leaves whole points of an uncompressed file unread."""
    size, count = header.point_format.size, header.point_count
    behind = (header.start_of_first_evlr, header.start_of_waveform_data_packet_record)
    end = min([file.stat().st_size, *(start for start in behind if start)])
    held = end - header.offset_to_point_data
    whole = not header.are_points_compressed and held > count * size and held % size == 0
    if whole:
        raise InputError(
            f"{file}: its header announces {count} points, and the file holds {held // size}: write the header anew, "
            "for instance with lasinfo -repair"
        )
    if count == 0:
        raise InputError(f"{file} holds no points: leave it out or export it again")


def refuse_cut_off(file: Path, header: Any) -> None:
    """Refuse a file that is shorter than its header says, before records of half a file are used."""
    needed = header.offset_to_point_data
    if not header.are_points_compressed:
        needed += header.point_count * header.point_format.size
    size = file.stat().st_size
    if size < needed:
        raise InputError(
            f"{file} is truncated: it has {size} bytes, its header announces at least {needed}; "
            "copy or download it again"
        )


def header_crs(file: Path, header: Any, fallback: str | None) -> str | None:
    """Return the horizontal CRS of a header after checking its units; None when there is no record.

    Where the record cannot be read, or is of another kind than the coordinates, the fallback is returned.
    """
    from pyproj.exceptions import CRSError as ProjError

    keys = _keys(header)
    foreign = foreign_units(keys)
    if foreign is not None:
        what, unit = foreign
        raise CRSError(f"{file}: its {what} are in {unit}, metres are needed: {_REPROJECT}")
    try:
        if is_user_defined(keys):
            crs = user_defined_crs(header.vlrs)
            reason = "user-defined, and described incompletely"
        else:
            crs, reason = header.parse_crs(), None
    except ProjError as error:
        crs, reason = None, " ".join(str(error).split())[:150]
    if crs is None and reason is None:
        return None
    if crs is None:
        if fallback is not None:
            return fallback
        raise CRSError(f"{file}: its CRS record cannot be read ({reason}): name the CRS by crs=")
    of_heights = height_unit(crs)
    if of_heights is not None:  # feet stay feet wherever the points are
        raise CRSError(f"{file}: its heights are in {of_heights}, metres are needed: {_REPROJECT}")
    horizontal = file_crs(crs, str(file))
    wrong = None if horizontal is None else misfit(horizontal, [*header.mins[:2], *header.maxs[:2]])
    if wrong is not None:
        if fallback is not None:
            return fallback
        raise CRSError(f"{file}: {crs_label(horizontal)} {wrong}: name the true CRS by crs=")
    if horizontal is not None:
        require_metric(crs.to_wkt(), str(file), remedy=_REPROJECT)
    return horizontal


def _keys(header: Any) -> list[Any]:
    """Return the GeoKeys of a header that has no WKT."""
    if any(record.string.strip("\0 ") for record in header.vlrs.get("WktCoordinateSystemVlr")):
        return []
    return [key for record in header.vlrs.get("GeoKeyDirectoryVlr") for key in record.geo_keys]
