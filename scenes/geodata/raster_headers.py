"""Headers of rasters: what a file says of itself, checked before anything is read.

Nouns
-----
north up
    The affine transform has no rotation and rows run southwards; that is what `Grid` can hold.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.errors import CRSError, InputError
from .crs import crs_label, file_crs, height_unit, unusable
from .opened_rasters import opened
from .raster import Grid

__all__ = ["RasterHeader", "read_raster_header", "source_crs"]

#: Colours of models other than RGB.
_OTHER_COLOURS = {"hue", "saturation", "lightness", "cyan", "magenta", "yellow", "black", "Y", "Cb", "Cr"}
#: Units of heights that are metres, whatever follows: ``m (NAVD88)``, ``metres above sea level``, ``[m]``, ``masl``.
_METRES = re.compile(
    r"\W*(m|met(er|re|ro|ri)s?|m[eè]tres?|masl)(?![\w*/^])|(?!us|ft|f[eo][eo]t)[^\W\d_]+\s+(in\s+)?[(\[]?(m|met(er|re)s?)[\])]?$",
    re.IGNORECASE,
)
#: Words of descriptions of masks.
_MASKS = {"alpha", "mask", "maske", "masque", "transparency", "opacity"}
#: Words that name no unit.
_NO_UNIT = ("", "unknown", "none", "undefined", "n/a", "-")
#: Largest coordinate and smallest pixel of an image, in its unit; beyond them a header is broken.
_LARGEST, _SMALLEST = 1e9, 1e-9


@dataclass(frozen=True)
class RasterHeader:
    """What a raster file says of itself.

    Attributes
    ----------
    path : Path
    crs : str, optional
        Horizontal CRS; None when the file has none.
    grid : Grid
        Its own grid; for cells that are not square, the one of the smaller side.
    band_count : int
        Without an alpha band.
    band_names : tuple of str
        Descriptions of the bands; empty texts where there are none.
    colours : tuple of str
        What each band shows by the colour interpretation of the file: ``red``, ``undefined``, ...
    dtype : str
        ``"uint8"``.
    square : bool
        Whether the cells are square.
    height_unit : str, optional
        Unit of the values of an elevation model where the file names another one than metres.
    scale, offset : float
        From the values in the file to heights: ``value * scale + offset``; mostly 1 and 0.
    alpha : bool
        Whether a further, last band is marked as alpha. Many programs mark near infrared so.
    mask_band : bool
        Whether a further, last band without a colour holds a mask: it is described so, or has one value beside 0.
    mask_named : bool
        Whether that is by its description.
    depth : int, optional
        Bits of each value, where the file names fewer than its type has.
    """

    path: Path
    crs: str | None
    grid: Grid
    band_count: int
    band_names: tuple[str, ...]
    colours: tuple[str, ...]
    dtype: str
    square: bool
    height_unit: str | None
    scale: float
    offset: float
    alpha: bool = False
    mask_band: bool = False
    mask_named: bool = False
    depth: int | None = None


def read_raster_header(path: str | os.PathLike[str], *, crs: str | None = None) -> RasterHeader:
    """Read what a raster file says of itself and check its georeference.

    Parameters
    ----------
    path : path
    crs : str, optional
        CRS that replaces the file's own (which is then not checked).

    Raises
    ------
    InputError
        Missing, not a raster, no georeference, rotated or upside down.
    CRSError
        Units other than metres. A geographic CRS passes when it can be warped, which is for the caller to say.
    """
    file = Path(path)
    with opened(file) as source:
        if source.transform.is_identity and (source.gcps[0] or source.rpcs is not None):
            how = "ground control points" if source.gcps[0] else "a camera model (RPC)"
            raise InputError(f"{file} is placed by {how} alone: warp it to a grid, for instance with gdalwarp -t_srs")
        if source.transform.is_identity and not source.crs:
            raise InputError(
                f"{file} has no georeference: expected a GeoTIFF with an affine transform and a CRS; "
                "set them with gdal_edit.py -a_srs -a_ullr, or put its world file (.tfw) beside it"
            )
        if source.transform.is_identity:
            raise InputError(
                f"{file} has a CRS but no affine transform: set its corners with gdal_edit.py -a_ullr or put its "
                "world file (.tfw) beside it"
            )
        a, b, c, d, e, f = tuple(source.transform)[:6]
        ends = (c, f, c + a * source.width, f + e * source.height)
        if not all(abs(number) <= _LARGEST for number in (b, d, *ends)) or not min(abs(a), abs(e)) >= _SMALLEST:
            raise InputError(
                f"{file} is broken: its affine transform ({a:g}, {b:g}, {c:g}, {d:g}, {e:g}, {f:g}) is that of no "
                "image; copy or download it again, or set its corners with gdal_edit.py -a_ullr"
            )
        if abs(b) > 1e-9 * abs(a) or abs(d) > 1e-9 * abs(e) or a <= 0 or e >= 0:
            raise InputError(
                f"{file} is rotated or not north up (affine transform {a:g}, {b:g}, {d:g}, {e:g}): make it north up, "
                "for instance with gdalwarp"
            )
        own = crs
        if own is None and source.crs:
            own = source_crs(file, source)
        side = min(a, -e)
        grid = Grid(c, f, side, max(1, round(source.height * -e / side)), max(1, round(source.width * a / side)))
        colours = source.colorinterp
        if colours[0].name == "palette":
            raise InputError(
                f"{file} has a colour table instead of bands: expand it, for instance with gdal_translate -expand rgb"
            )
        odd = sorted({colour.name for colour in colours} & _OTHER_COLOURS)
        if odd:
            raise InputError(
                f"{file} has bands of {', '.join(odd)}, expected red, green, blue, near infrared or grey: convert it "
                "to RGB"
            )
        if len(set(source.dtypes)) > 1:
            raise InputError(
                f"{file} has bands of several types ({', '.join(source.dtypes)}): convert them to one, for instance "
                "with gdal_translate -ot"
            )
        mask_band = _holds_mask(source)
        count = sum(colour.name != "alpha" for colour in colours) - mask_band
        return RasterHeader(
            path=file,
            crs=own,
            grid=grid,
            band_count=count,
            band_names=tuple((text or "").lower() for text in source.descriptions[:count]),
            colours=tuple(colour.name for colour in colours if colour.name != "alpha")[:count],
            dtype=source.dtypes[0],
            square=abs(a + e) <= 1e-6 * a,
            height_unit=_height_unit(source),
            scale=source.scales[0],
            offset=source.offsets[0],
            alpha=count < len(colours) and colours[-1].name == "alpha",
            mask_band=mask_band,
            mask_named=_named_mask(source),
            depth=_depth(source),
        )


def source_crs(file: Path, source: Any) -> str | None:
    """Return the horizontal CRS of an open raster that has one; None where it is a local system."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError as ProjError

    try:
        crs = CRS.from_wkt(source.crs.to_wkt())
    except ProjError as error:
        raise CRSError(f"{file}: its CRS cannot be read ({error}): set it with gdal_edit.py -a_srs") from error
    text = file_crs(crs, str(file))
    reason = None if text is None else unusable(text)
    if text is not None and reason is not None:
        raise CRSError(
            f"{file}: {crs_label(text)} {reason}: reproject it, for instance with gdalwarp -t_srs, or set its true CRS "
            "with gdal_edit.py -a_srs"
        )
    return text


def _depth(source: Any) -> int | None:
    """Return the bits of a value by GDAL's item NBITS, where all bands name the same number."""
    found = {str(source.tags(band, ns="IMAGE_STRUCTURE").get("NBITS", "")) for band in range(1, source.count + 1)}
    text = found.pop() if len(found) == 1 else ""
    return int(text) if text.isdecimal() and 8 <= int(text) < 16 else None


def _height_unit(source: Any) -> str | None:
    """Return the unit of the values when band or vertical CRS name one that is not metres."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError as ProjError

    unit = str(source.units[0] or "").strip()
    if unit.lower() not in _NO_UNIT and not _METRES.match(unit):
        return unit
    try:
        return height_unit(CRS.from_wkt(source.crs.to_wkt())) if source.crs else None
    except ProjError:
        return None


def _named_mask(source: Any) -> bool:
    """Return whether the last of several bands is described as a mask, and not marked as one."""
    words = set(re.findall(r"[^\W\d_]+", (source.descriptions[-1] or "").lower()))
    return source.count > 1 and source.colorinterp[-1].name == "undefined" and bool(words & _MASKS)


def _holds_mask(source: Any) -> bool:
    """Return whether the last band is named as a mask, or the fourth, unnamed and of no colour, holds 0 and one value.

    No infrared has two values only.
    """
    from rasterio.windows import Window

    if _named_mask(source):
        return True
    if source.count != 4 or source.colorinterp[3].name != "undefined" or source.descriptions[3]:
        return False
    if source.dtypes[3] not in ("uint8", "uint16"):
        return False
    seen: set[int] = set()
    for row in range(0, source.height, max(64, source.height // 8)):
        for column in range(0, source.width, max(64, source.width // 8)):
            seen.update(np.unique(source.read(4, window=Window(column, row, 64, 64))).tolist())
    return (seen - {0}) in ({1}, {255}, {65535})
