"""Open rasters: what rasterio raises becomes one sentence, and views give files one layout.

Nouns
-----
view
    A virtual raster (VRT) in memory that shows a file in the layout that is read: a band of transparency is the last
    one, and where each band has its own no-data value, their masks become one mask.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from ...core.errors import InputError
from ...core.inputs import require_file
from ...core.plain_paths import plain_path
from .band_descriptions import described_band

__all__ = ["alpha_inside", "opened"]

#: Colours that a view passes on.
_COLOURS = ("red", "green", "blue", "gray", "alpha")


@contextmanager
def opened(file: Path, *, alpha: bool | None = None) -> Iterator[Any]:
    """Open a raster; what rasterio raises inside the block becomes one sentence.

    With `alpha` False no band masks and all are in the order of the file, with True the last one masks, whatever the
    file says. By default the band that is marked as alpha masks, unless its description names a colour or near
    infrared: GDAL marks the fourth of four bands so.
    """
    import warnings

    import rasterio
    from rasterio.errors import NotGeoreferencedWarning, RasterioError, RasterioIOError

    require_file(file, "a raster, for instance a GeoTIFF")
    try:
        with plain_path(file) as path:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", NotGeoreferencedWarning)  # reported as an error by read_raster_header
                source = rasterio.open(path)
            with source, _in_layout(source, path, alpha) as ordered:
                if alpha is None:
                    yield ordered
                    return
                with _with_last_band(ordered, "alpha" if alpha else "undefined") as view:
                    yield view
    except (RasterioError, RasterioIOError) as error:  # two kinds before rasterio 1.4
        cause = error.__cause__ or error
        reason = " ".join(str(cause).split())
        remedy = "copy or download it again, or give a GeoTIFF"
        if file.suffix.lower() == ".vrt" and "No such file" in reason:
            remedy = "put the file back that it shows, make it anew without that, or choose an extent beside it"
        raise InputError(f"{file} cannot be read as a raster ({reason}): {remedy}") from error


@contextmanager
def _in_layout(source: Any, path: Path, alpha: bool | None) -> Iterator[Any]:
    """Yield a raster, or the view of one whose alpha band is none or not the last, or whose bands differ in no data."""
    from rasterio.io import MemoryFile

    marked = [colour.name for colour in source.colorinterp]
    colours = ["undefined" if alpha is False and colour == "alpha" else colour for colour in _colours(source)]
    several = len({str(value) for value in source.nodatavals}) > 1
    if colours == marked and "alpha" not in colours[:-1] and not several:
        yield source
        return
    with MemoryFile(_view(source, path, colours, several).encode(), ext=".vrt") as memory, memory.open() as view:
        yield view


def _colours(source: Any) -> list[str]:
    """Return what the bands of a raster show; what is described as a colour or near infrared is no alpha."""
    return [
        "undefined" if colour.name == "alpha" and described_band(text or "") else colour.name
        for colour, text in zip(source.colorinterp, source.descriptions, strict=True)
    ]


def alpha_inside(file: Path) -> bool:
    """Return whether a band before the last one is marked as alpha, so that the order of bands in a view is another."""
    import rasterio

    with plain_path(file) as path, rasterio.open(path) as source:
        return "alpha" in _colours(source)[:-1]


def _view(source: Any, path: Path, colours: list[str], masked: bool) -> str:
    """Return the text of a virtual raster; if `masked` with the masks of all bands as one."""
    from rasterio.dtypes import _gdal_typename

    file = f'<SourceFilename relativeToVRT="0">{escape(os.path.abspath(path))}</SourceFilename>'
    order = sorted(range(1, source.count + 1), key=lambda band: colours[band - 1] == "alpha")
    last = max((band for band in order if colours[band - 1] == "alpha"), default=0)
    lines = [f'<VRTDataset rasterXSize="{source.width}" rasterYSize="{source.height}">']
    if source.crs:
        lines.append(f"<SRS>{escape(source.crs.to_wkt())}</SRS>")
    lines.append(f"<GeoTransform>{', '.join(map(repr, source.transform.to_gdal()))}</GeoTransform>")
    for place, band in enumerate(order, start=1):
        colour = colours[band - 1] if colours[band - 1] in _COLOURS else "undefined"
        if colour == "alpha" and band != last:
            colour = "undefined"
        kind = _gdal_typename(source.dtypes[band - 1])
        text = escape(source.descriptions[band - 1] or "")
        lines.append(f'<VRTRasterBand dataType="{kind}" band="{place}"><Description>{text}</Description>')
        if not masked and source.nodatavals[band - 1] is not None:
            lines.append(f"<NoDataValue>{source.nodatavals[band - 1]!r}</NoDataValue>")
        lines.append(f"<ColorInterp>{colour.capitalize()}</ColorInterp>")
        lines.append(f"<SimpleSource>{file}<SourceBand>{band}</SourceBand></SimpleSource></VRTRasterBand>")
    if masked:
        lines.append('<MaskBand><VRTRasterBand dataType="Byte">')
        for band in order:
            lines.append(f"<ComplexSource>{file}<SourceBand>mask,{band}</SourceBand><NODATA>0</NODATA></ComplexSource>")
        lines.append("</VRTRasterBand></MaskBand>")
    return "".join([*lines, "</VRTDataset>"])


@contextmanager
def _with_last_band(source: Any, colour: str) -> Iterator[Any]:
    """Open a view of a raster whose last band has another colour interpretation, and no other band is alpha."""
    import rasterio
    from rasterio.enums import ColorInterp
    from rasterio.io import MemoryFile
    from rasterio.shutil import copy

    with MemoryFile(ext=".vrt") as memory:
        copy(source, memory.name, driver="VRT")
        with rasterio.open(memory.name, "r+") as view:
            others = [ColorInterp.undefined if kind == ColorInterp.alpha else kind for kind in view.colorinterp[:-1]]
            view.colorinterp = [*others, ColorInterp[colour]]
        with rasterio.open(memory.name) as view:
            yield view
