"""Coordinates in degrees, recognised by the size of footprints where no CRS, or a wrong one, says so.

A building is some 1e-4 degrees long. If these were metres it would be shorter than a millimetre.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import CRSError
from .crs import parse_crs

__all__ = ["JSON_ENDINGS", "JSON_SYSTEMS", "json_means_degrees", "refuse_degrees"]

#: Endings of GeoJSON, whole or a feature per line; without a CRS it is in degrees (RFC 7946).
JSON_ENDINGS = (".geojson", ".json", ".geojsonl", ".geojsons", ".ndjson", ".jsonl")
#: What GDAL takes a GeoJSON file to be in that has no CRS: without and with heights.
JSON_SYSTEMS = ("EPSG:4326", "EPSG:4979")
#: Longest side of a footprint in degrees, some 500 m; no footprint in metres is so short.
_LONGEST = 0.005
#: Bytes of a GeoJSON file up to which its member ``crs`` is looked for.
_LARGEST_JSON = 1 << 27


def refuse_degrees(geometries: NDArray[np.object_], where: str) -> None:
    """Raise `CRSError` when most footprints can only be in degrees, though the CRS says metres or is not known.

    Most are enough, so that a stray place elsewhere does not change what the others are.
    """
    bounds, sizes = _bounds(geometries)
    if _are_degrees(bounds, sizes):
        x, y = np.median(bounds[:, :2], axis=0)
        raise CRSError(
            f"{where}: footprints at places such as ({x:.5g}, {y:.5g}) are {np.median(sizes):.1g} long, so the "
            "coordinates are degrees, not metres, whatever CRS is named: transform them, for instance with "
            "ogr2ogr -s_srs EPSG:4326 -t_srs and the projected system"
        )


def json_means_degrees(file: Path, geometries: NDArray[np.object_]) -> bool:
    """Return whether a file that GDAL takes as WGS 84 can be in degrees; always for other formats than GeoJSON.

    RFC 7946 lets GeoJSON without a CRS be in degrees. A file that is empty, that says ``"crs": null``, or whose
    coordinates cannot be degrees has no known CRS.

    Raises
    ------
    CRSError
        Degrees with latitude first, or a named CRS that is not known.
    """
    if file.suffix.lower() not in JSON_ENDINGS:
        return True
    bounds, sizes = _bounds(geometries)
    if not len(bounds):
        return False
    small = _are_degrees(bounds, sizes)
    if not small:
        member = _crs_member(file)
        if member is None:
            return False
        _refuse_unknown(member, file)
    x, y = np.median(np.abs(bounds[:, [0, 1]]), axis=0)
    if x <= 90 < y <= 180:
        raise CRSError(
            f"{file}: its coordinates look like degrees with latitude first, GeoJSON has longitude first: swap the "
            "axes, and reproject to metres, for instance with ogr2ogr -t_srs"
        )
    return small or bool(x <= 360 and y <= 90)


def _bounds(geometries: NDArray[np.object_]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the bounds of geometries that have an extent, shape (n, 4), and their longer sides, shape (n,)."""
    bounds = shapely.bounds(geometries).reshape(-1, 4)
    bounds = bounds[np.isfinite(bounds).all(axis=1)]
    with np.errstate(over="ignore"):
        sizes = np.maximum(bounds[:, 2] - bounds[:, 0], bounds[:, 3] - bounds[:, 1])
    return bounds[sizes > 0], sizes[sizes > 0]


def _are_degrees(bounds: NDArray[np.float64], sizes: NDArray[np.float64]) -> bool:
    small = (np.abs(bounds) <= 360).all(axis=1) & (sizes <= _LONGEST)
    return bool(len(bounds)) and 2 * int(np.count_nonzero(small)) >= len(bounds)


def _crs_member(file: Path) -> Any:
    """Return the member ``crs`` of a GeoJSON file, wherever it stands; an empty one where there is none."""
    if file.stat().st_size > _LARGEST_JSON:
        return {}
    try:
        content = json.loads(file.read_bytes())
    except (ValueError, RecursionError):  # a feature per line, or what GDAL alone reads
        return {}
    return content.get("crs", {}) if isinstance(content, dict) else {}


def _refuse_unknown(member: Any, file: Path) -> None:
    """Raise `CRSError` for a named CRS that is not known: GDAL takes such a file to be in degrees."""
    properties = member.get("properties") if isinstance(member, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if isinstance(name, str) and name:
        try:
            parse_crs(name)
        except CRSError as error:
            raise CRSError(
                f"{file}: its CRS {name[:60]!r} is not known: name one such as EPSG:25832, in the file or by crs="
            ) from error
