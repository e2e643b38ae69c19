"""Coordinate reference systems (CRS): read, compare, and require metres.

A CRS is kept as the text that a file or a person gives: ``"EPSG:28992"`` or WKT. Areas and distances are in the unit
of its axes, so evaluation and detection accept only projected systems in metres.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

from ...core.errors import CRSError

if TYPE_CHECKING:
    from pyproj import CRS

__all__ = [
    "common_crs",
    "crs_label",
    "crs_text",
    "file_crs",
    "height_unit",
    "is_geographic",
    "misfit",
    "named_crs",
    "parse_crs",
    "require_metric",
    "same_crs",
    "scale_warning",
    "unusable",
]

#: Largest deviation of mapped from true areas that passes without a warning; national grids stay below a tenth of it.
_AREA_TOLERANCE = 0.02


@lru_cache(maxsize=64)
def parse_crs(text: str) -> CRS:
    """Return the `pyproj.CRS` of an authority code, WKT or PROJ string."""
    import pyproj
    from pyproj.exceptions import CRSError as ProjError

    try:
        return pyproj.CRS.from_user_input(text)
    except ProjError as error:
        raise CRSError(f"{text[:60]!r} is not a coordinate reference system: write for instance EPSG:25832") from error


def named_crs(text: str) -> str:
    """Return what a person wrote as a CRS in the form that files keep: ``2154`` and ``epsg:2154`` as ``EPSG:2154``."""
    return crs_text(parse_crs(text.strip()))


@lru_cache(maxsize=64)
def crs_label(text: str | None) -> str:
    """Return a short name for people: ``EPSG:28992`` where the authority is known, else the name in the WKT."""
    if text is None:
        return "no CRS"
    if text.upper().startswith("EPSG:"):
        return text.upper()
    authority = _likely_authority(text)
    return ":".join(authority) if authority else str(parse_crs(text).name)


def crs_text(crs: CRS) -> str:
    """Return the text by which roofbench keeps the horizontal part: ``EPSG:28992`` where there is a code, else WKT."""
    horizontal = _horizontal(crs.to_wkt())
    text = str(horizontal.to_wkt())
    authority = horizontal.to_authority(min_confidence=100) or _authority(text)
    return ":".join(authority) if authority else text


def file_crs(crs: CRS, where: str = "the input") -> str | None:
    """Return the text of the CRS of a file; None for a local or undefined system, which does not locate anything.

    Raises
    ------
    CRSError
        A local system in other units than metres: they stay what they are in any place.
    """
    horizontal = _horizontal(crs.to_wkt())
    if not horizontal.is_engineering:
        return crs_text(crs)
    foreign = [axis.unit_name for axis in horizontal.axis_info if abs(axis.unit_conversion_factor - 1.0) > 1e-9]
    # Undefined systems of GeoPackage and GeoJSON are in degrees or unknown units.
    if foreign and not {"degree", "unknown"} & set(foreign):
        raise CRSError(f"{where}: its local system is in {foreign[0]}, metres are needed: convert the coordinates")
    return None


@lru_cache(maxsize=64)
def _authority(text: str) -> tuple[str, str] | None:
    """Return the registered system that a CRS is by its parameters; None when there is none.

    PROJ compares the order of the axes, too, which WKT 1 does not keep: northing before easting, as the register has
    it for New Zealand, Poland or Japan, comes back as easting before northing.
    """
    import pyproj
    from pyproj.exceptions import CRSError as ProjError

    crs = _horizontal(text)
    root = crs.to_json_dict().get("id")
    codes = [(str(root["authority"]), str(root["code"]))] if root else []
    codes += [(match.auth_name, match.code) for match in crs.list_authority(min_confidence=20)]
    for authority, code in codes:
        try:
            registered = pyproj.CRS.from_authority(authority, code)
        except ProjError:
            continue
        if _same_projection(registered, crs):
            return authority, code
    return None


def _likely_authority(text: str) -> tuple[str, str] | None:
    """Return the registered system that a CRS is, or that PROJ finds similar."""
    crs = parse_crs(text)
    return crs.to_authority(min_confidence=100) or _authority(text) or crs.to_authority(min_confidence=60)


def _same_projection(one: CRS, two: CRS) -> bool:
    """Return whether two projected systems have the same datum, method and parameters, in any order of axes."""
    if not (one.is_projected and two.is_projected):
        return False
    from pyproj.exceptions import CRSError as ProjError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # PROJ strings lose the names, which are compared besides
            parameters = one.to_dict(), two.to_dict()
    except ProjError:  # a method that PROJ does not have
        return False
    return bool(parameters[0]) and parameters[0] == parameters[1] and _datum_name(one) == _datum_name(two)


def _datum_name(crs: CRS) -> str:
    """Return the name of the datum without the marks that dialects of WKT add."""
    name = crs.datum.name if crs.datum is not None else ""
    return re.sub(r"[^a-z0-9]", "", name.lower().removeprefix("d_").removesuffix("ensemble"))


@lru_cache(maxsize=64)
def _horizontal(text: str) -> CRS:
    """Return the horizontal part of a compound CRS, else the CRS itself."""
    crs = parse_crs(text)
    while crs.is_compound or crs.is_bound:
        crs = crs.sub_crs_list[0] if crs.is_compound else crs.source_crs
    return crs


def is_geographic(text: str | None) -> bool:
    """Return whether coordinates in a CRS are degrees; False where none is known."""
    return text is not None and _horizontal(text).is_geographic


def misfit(text: str, bounds: Sequence[float]) -> str | None:
    """Return why coordinates cannot be in a CRS, as words that follow its name; None when they can.

    A record of heights alone, or of degrees beside metres, is wrong and says nothing of the place.

    Parameters
    ----------
    text : str
    bounds : sequence of float
        Values of the coordinates, in any order.
    """
    crs = _horizontal(text)
    if crs.is_geographic:
        return "is geographic (degrees), which its coordinates cannot be" if max(map(abs, bounds)) > 360 else None
    return None if crs.is_geocentric else unusable(text)


@lru_cache(maxsize=64)
def unusable(text: str) -> str | None:
    """Return why coordinates of a system are neither degrees nor on a map; None when they are."""
    import pyproj
    from pyproj.exceptions import CRSError as ProjError

    crs = _horizontal(text)
    if crs.is_geocentric:
        return "is geocentric (measured from the centre of the earth), a projected system is needed"
    if crs.is_vertical:
        return "is a system of heights alone, a projected system is needed"
    if crs.is_engineering:
        return "is a local system, which does not say where on earth the coordinates are"
    if crs.is_geographic:
        return None
    try:
        pyproj.Proj(crs)
    except ProjError:
        return "is not a projected system that PROJ can compute with"
    return None if crs.is_projected else "is not a projected system"


#: How files of other kinds than points get another CRS.
_REPROJECT = "reproject it, for instance with ogr2ogr -t_srs or gdalwarp -t_srs"


def require_metric(text: str | None, where: str, *, heights: bool = True, remedy: str | None = None) -> None:
    """Raise `CRSError` unless the CRS is a map projection, with axes (and heights, if it names them) in metres.

    None (not known) passes.

    Parameters
    ----------
    text : str, optional
        CRS as text.
    where : str
        File or argument that it belongs to, for the message.
    heights : bool
        Whether heights matter; for footprints they do not.
    remedy : str, optional
        What to do, for the message; by default to reproject rasters and vector files or to name the true CRS.
    """
    if text is None:
        return
    crs = _horizontal(text)
    reason = unusable(text)
    if reason is not None:
        raise CRSError(f"{where}: {crs_label(text)} {reason}: {remedy or _REPROJECT + ', or set its true CRS by crs='}")
    if crs.is_geographic:
        raise CRSError(
            f"{where}: {crs_label(text)} is geographic (degrees), areas and distances need metres: "
            f"{remedy or _REPROJECT + ', or set its true CRS by crs='}"
        )
    unit = crs.axis_info[0] if crs.axis_info else None
    if unit is not None and abs(unit.unit_conversion_factor - 1.0) > 1e-9:
        name = str(unit.unit_name)
        if name.lower().startswith("met"):
            name = f"a {name} of {unit.unit_conversion_factor:.7g} m"
        raise CRSError(f"{where}: {crs_label(text)} is in {name}, metres are needed: {remedy or _REPROJECT}")
    found = height_unit(parse_crs(text)) if heights else None
    if found is not None:
        raise CRSError(f"{where}: its heights are in {found}, metres are needed: {remedy or 'convert them'}")


def height_unit(crs: CRS) -> str | None:
    """Return the unit of the heights of a CRS with the name of their system; None for metres or without heights."""
    if crs.is_bound:
        return None if crs.source_crs is None else height_unit(crs.source_crs)
    if crs.is_compound:
        return next(filter(None, map(height_unit, crs.sub_crs_list)), None)
    for axis in crs.axis_info:
        if axis.direction in ("up", "down") and abs(axis.unit_conversion_factor - 1.0) > 1e-9:
            return f"{axis.unit_name} ({crs.name})"
    return None


def scale_warning(text: str | None, x: float, y: float) -> str | None:
    """Return in words that areas at a place are far from true ones, as in Web Mercator; None where they are not."""
    if text is None:
        return None
    import pyproj
    from pyproj.exceptions import ProjError

    projection = pyproj.Proj(_horizontal(text))
    try:
        scale = projection.get_factors(*projection(x, y, inverse=True)).areal_scale
    except ProjError:
        return None  # outside the domain of the projection
    scale = abs(scale)  # systems that count westwards or southwards are mirrored
    if not math.isfinite(scale) or abs(scale - 1.0) <= _AREA_TOLERANCE:
        return None
    return (
        f"warning: {crs_label(text)} shows areas {scale:.2f} and lengths {scale**0.5:.2f} times as large as they are "
        "here: reproject to the national grid or a UTM zone"
    )


def same_crs(first: str, second: str) -> bool:
    """Return whether two CRS texts mean the same horizontal system."""
    if first == second:
        return True
    one, two = _horizontal(first), _horizontal(second)
    if one.equals(two, ignore_axis_order=True):
        return True
    code = _likely_authority(str(one.to_wkt()))
    return code is not None and code == _likely_authority(str(two.to_wkt()))


def common_crs(first: str | None, second: str | None, names: tuple[str, str]) -> str | None:
    """Return the CRS that two inputs share, or raise `CRSError`.

    Both unknown is accepted (coordinates are taken as metres); only one unknown is not, since a guess would be silent.
    """
    if first is None and second is None:
        return None
    if first is None or second is None:
        lacking, other = (names[0], second) if first is None else (names[1], first)
        raise CRSError(
            f"{lacking} has no coordinate reference system while the other is in {crs_label(other)}: set it by crs="
        )
    if not same_crs(first, second):
        raise CRSError(
            f"{names[0]} is in {crs_label(first)} but {names[1]} in {crs_label(second)}: "
            "reproject one of them, for instance with ogr2ogr -t_srs"
        )
    return first
