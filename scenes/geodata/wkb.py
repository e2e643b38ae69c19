"""Geometries of WKB, as files store them.

Rings that are not closed are closed and reported. Surfaces (TIN, triangle, polyhedral surface), which GEOS does not
know, become polygons by their type codes alone: ISO 19125-1 gives both the same layout of rings.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import InputError
from .polygon_repair import Repair

__all__ = ["geometries_of_wkb"]

#: Code of a surface to that of the geometry with the same layout: polyhedral surface, TIN, triangle.
_SURFACES = {15: 6, 16: 6, 17: 3}
#: Codes of geometries that consist of geometries: multipoint to collection, polyhedral surface, TIN.
_COLLECTIONS = (4, 5, 6, 7, 15, 16)
#: Deepest nesting of collections that is followed.
_DEEPEST = 200


def geometries_of_wkb(wkb: NDArray[np.object_], file: Path) -> tuple[NDArray[np.object_], list[Repair]]:
    """Return geometries of WKB; rings that end elsewhere than they began are closed and reported."""
    closed = []
    with np.errstate(invalid="ignore"):  # coordinates that are NaN: left out and reported by Footprints.of
        try:
            geometries = np.asarray(shapely.from_wkb(wkb, on_invalid="ignore"), dtype=object)
        except NotImplementedError as error:
            raise InputError(
                f"{file}: the outline of feature {_first_curve(wkb)} is a curve: convert it to straight lines, for "
                "instance with ogr2ogr -nlt CONVERT_TO_LINEAR"
            ) from error
        unread = [row for row in np.flatnonzero(shapely.is_missing(geometries)) if wkb[row] is not None]
        for row in unread:
            if isinstance(wkb[row], str):
                raise InputError(
                    f"{file}: its geometry is text where WKB is announced ({wkb[row][:40]!r}): write the file anew, "
                    "for instance with ogr2ogr"
                )
            polygons = _with_polygons(bytes(wkb[row]))
            geometries[row] = shapely.from_wkb(polygons, on_invalid="ignore")
            if geometries[row] is not None:
                continue
            geometries[row] = shapely.from_wkb(polygons, on_invalid="fix")
            if geometries[row] is None:
                raise InputError(
                    f"{file}: the geometry of feature {row} is damaged, or a surface (multipatch, TIN) that cannot be "
                    "read: copy the file again, or convert it, for instance with ogr2ogr -nlt MULTIPOLYGON"
                )
            closed.append(Repair(int(row), "a ring that is not closed", "repaired"))
    return geometries, closed


def _first_curve(wkb: NDArray[np.object_]) -> int:
    """Return the row of the first geometry whose type GEOS knows and shapely does not pass on."""
    for row, one in enumerate(wkb):
        try:
            shapely.from_wkb(one, on_invalid="ignore")
        except NotImplementedError:
            return row
    return 0


def _with_polygons(wkb: bytes) -> bytes:
    """Return WKB in which surfaces are polygons; bytes that are no WKB are returned as they are."""
    changed = bytearray(wkb)
    try:
        _rewrite(changed, 0, 0)
    except (struct.error, ValueError, IndexError):
        return wkb
    return bytes(changed)


def _rewrite(wkb: bytearray, start: int, depth: int) -> int:
    """Rewrite the geometry at `start` in place and return where it ends."""
    if depth > _DEEPEST:
        raise ValueError("nested too deeply")
    order = "<" if wkb[start] == 1 else ">"
    (code,) = struct.unpack_from(f"{order}I", wkb, start + 1)
    kind, iso = (code & 0x0FFFFFFF) % 1000, (code & 0x0FFFFFFF) // 1000
    axes = 2 + bool(code & 0x80000000 or iso in (1, 3)) + bool(code & 0x40000000 or iso in (2, 3))
    struct.pack_into(f"{order}I", wkb, start + 1, code - kind + _SURFACES.get(kind, kind))
    position = start + (9 if code & 0x20000000 else 5)
    if kind == 1:
        return position + 8 * axes
    (count,) = struct.unpack_from(f"{order}I", wkb, position)
    position += 4
    if kind in _COLLECTIONS:
        for _ in range(count):
            position = _rewrite(wkb, position, depth + 1)
    elif kind == 2:
        position += 8 * axes * count
    elif kind in (3, 17):
        for _ in range(count):
            (points,) = struct.unpack_from(f"{order}I", wkb, position)
            position += 4 + 8 * axes * points
    else:
        raise ValueError(f"geometry type {kind}")
    return position
