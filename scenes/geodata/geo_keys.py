"""GeoKeys: the CRS records of GeoTIFF, which point files before LAS 1.4 carry, too.

A registered system is named by its code alone. A user-defined one (code 32767) is described by its method and
parameters; GDAL reads those from a GeoTIFF of one cell that is given the same keys.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pyproj import CRS

__all__ = ["foreign_units", "is_user_defined", "user_defined_crs"]

#: Keys of the kind of system, of the projected system, of its unit, of the vertical system and of its unit.
_MODEL, _PROJECTED, _UNIT, _VERTICAL, _VERTICAL_UNIT = 1024, 3072, 3076, 4096, 4099
#: Value of `_MODEL` for a map projection, and that of any key for "user-defined".
_ON_MAP, _USER_DEFINED = 1, 32767
#: Tag of the keys; tags of their numbers and of their texts, with the types of TIFF for the values.
_DIRECTORY = 34735
_VALUES = {"GeoDoubleParamsVlr": (34736, 12, 8), "GeoAsciiParamsVlr": (34737, 2, 1)}


def is_user_defined(keys: Iterable[Any]) -> bool:
    """Return whether keys (of laspy) describe a map projection without the code of a registered one."""
    values = {key.id: key.value_offset for key in keys if key.tiff_tag_location == 0}
    code = values.get(_PROJECTED, 0)
    return code == _USER_DEFINED or (code == 0 and values.get(_MODEL) == _ON_MAP)


def user_defined_crs(records: Any) -> CRS | None:
    """Return the projected system that keys describe by its parameters; None where they do not suffice.

    Parameters
    ----------
    records : laspy.vlrs.vlrlist.VLRList
        Records of a point file.
    """
    import rasterio
    from pyproj import CRS
    from pyproj.exceptions import CRSError as ProjError

    # Some programs write a first key of zeros, for which GDAL rejects all of them.
    keys = [bytes(key) for record in records.get("GeoKeyDirectoryVlr") for key in record.geo_keys if key.id]
    directory = struct.pack("<4H", 1, 1, 0, len(keys)) + b"".join(keys)
    tags = [(_DIRECTORY, 3, len(directory) // 2, directory)]
    for kind, (tag, code, size) in _VALUES.items():
        for record in records.get(kind)[:1]:
            content = record.record_data_bytes()
            tags.append((tag, code, len(content) // size, content))
    try:
        with rasterio.MemoryFile(_tiff(tags)) as memory, memory.open() as source:
            crs = CRS.from_wkt(source.crs.to_wkt()) if source.crs else None
    except (rasterio.errors.RasterioError, ProjError):
        return None
    return crs if crs is not None and (crs.is_projected or crs.is_compound) else None


def _tiff(tags: Iterable[tuple[int, int, int, bytes]]) -> bytes:
    """Return a TIFF of one cell with further tags: number, type, count and content of each."""
    simple = {256: 1, 257: 1, 258: 8, 259: 1, 262: 1, 273: 8, 277: 1, 278: 1, 279: 1}
    scale, corner = struct.pack("<3d", 1, 1, 0), struct.pack("<6d", 0, 0, 0, 500_000, 5_000_000, 0)
    further = [(33550, 12, 3, scale), (33922, 12, 6, corner), *tags]
    entries, extra = b"", b""
    start = 10 + 12 * (len(simple) + len(further)) + 6
    for tag, value in simple.items():
        entries += struct.pack("<2H2I", tag, 3, 1, value)
    for tag, kind, count, content in further:
        inside = len(content) <= 4
        place = content.ljust(4, b"\0") if inside else struct.pack("<I", start + len(extra))
        entries += struct.pack("<2HI", tag, kind, count) + place
        extra += b"" if inside else content + b"\0" * (len(content) % 2)
    # The cell comes right after the header of 8 bytes, the directory after the cell.
    return (
        struct.pack("<2sHI2x", b"II", 42, 10)
        + struct.pack("<H", len(simple) + len(further))
        + entries
        + (b"\0" * 4 + extra)
    )


def foreign_units(keys: Iterable[Any]) -> tuple[str, str] | None:
    """Return what keys give in a unit other than metres, ``coordinates`` or ``heights``, and the unit; else None.

    The unit of heights is also that of a registered vertical system: the horizontal code does not define heights.
    """
    for key in keys:
        if key.tiff_tag_location != 0:
            continue
        unit = None
        if key.id in (_UNIT, _VERTICAL_UNIT):
            unit = _linear_units().get(key.value_offset)
        elif key.id == _VERTICAL:
            unit = _vertical_unit(key.value_offset)
        if unit is not None:
            return "coordinates" if key.id == _UNIT else "heights", unit
    return None


@lru_cache(maxsize=1)
def _linear_units() -> dict[int, str]:
    """Return the registered units of length other than the metre, by code."""
    from pyproj.database import get_units_map

    units = get_units_map(auth_name="EPSG", category="linear", allow_deprecated=True).values()
    return {int(unit.code): unit.name for unit in units if abs(unit.conv_factor - 1.0) > 1e-9}


def _vertical_unit(code: int) -> str | None:
    """Return the unit of a registered vertical CRS; None for metres and for codes that are not registered."""
    import pyproj
    from pyproj.exceptions import CRSError as ProjError

    try:
        axis = pyproj.CRS.from_epsg(code).axis_info[-1]
    except (ProjError, IndexError):
        return None
    return None if abs(axis.unit_conversion_factor - 1.0) < 1e-9 else str(axis.unit_name)
