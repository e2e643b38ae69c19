"""Headers of point files: what is refused before anything is read, and the CRS that their records name."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from ...core.errors import CRSError, InputError
from .crs import file_crs, require_metric

__all__ = ["HEADER_BYTES", "header_crs", "refuse_cut_off", "refuse_pointwise", "refuse_record_counts"]

#: Length of the longest header (LAS 1.4), bytes.
HEADER_BYTES = 375
#: GeoTIFF codes of linear units that are not metres, in the GeoKeys of LAS up to 1.3.
_FEET = {9002: "feet", 9003: "US survey feet", 9005: "Clarke's feet"}
#: Compressor in the record of LASzip: one stream of points, without chunks.
_POINTWISE = b"\x01\x00"
#: How point files get another CRS.
_REPROJECT = "reproject it, for instance with pdal's filters.reprojection, or correct its record if that is wrong"
#: GeoKeys of the horizontal unit, the vertical unit and the vertical CRS.
_HORIZONTAL_UNIT_KEY, _VERTICAL_UNIT_KEY, _VERTICAL_CRS_KEY = 3076, 4099, 4096


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

    Where the record cannot be read, the fallback is returned.
    """
    from pyproj.exceptions import CRSError as ProjError

    _refuse_feet(file, header)
    try:
        crs = header.parse_crs()
    except ProjError as error:
        if fallback is not None:
            return fallback
        raise CRSError(f"{file}: its CRS record cannot be read ({error}): name the CRS by crs=") from error
    if crs is None:
        return None
    text = file_crs(crs)
    if text is not None:
        require_metric(crs.to_wkt(), str(file), remedy=_REPROJECT)
    return text


def _refuse_feet(file: Path, header: Any) -> None:
    """Refuse GeoKeys that name feet, by a unit or by a vertical CRS: the horizontal code does not define heights."""
    if any(record.string.strip("\0 ") for record in header.vlrs.get("WktCoordinateSystemVlr")):
        return
    for record in header.vlrs.get("GeoKeyDirectoryVlr"):
        for key in record.geo_keys:
            unit = _FEET.get(key.value_offset) if key.tiff_tag_location == 0 else None
            if unit and key.id in (_HORIZONTAL_UNIT_KEY, _VERTICAL_UNIT_KEY):
                what = "coordinates" if key.id == _HORIZONTAL_UNIT_KEY else "heights"
                raise CRSError(f"{file}: its {what} are in {unit}, metres are needed: {_REPROJECT}")
            if key.id == _VERTICAL_CRS_KEY and key.tiff_tag_location == 0:
                vertical = _vertical_unit(key.value_offset)
                if vertical is not None:
                    raise CRSError(f"{file}: its heights are in {vertical}, metres are needed: {_REPROJECT}")


def _vertical_unit(code: int) -> str | None:
    """Return the unit of a registered vertical CRS; None for metres and for codes that are not registered."""
    import pyproj
    from pyproj.exceptions import CRSError as ProjError

    try:
        axis = pyproj.CRS.from_epsg(code).axis_info[-1]
    except (ProjError, IndexError):
        return None
    return None if abs(axis.unit_conversion_factor - 1.0) < 1e-9 else str(axis.unit_name)
