"""GeoTIFF files: reading, writing and checks of orthoimages and elevation models.

Nouns
-----
north up
    The affine transform has no rotation and rows run southwards; that is what `Grid` can hold.
header
    What a file says of itself, checked before anything is read.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import CRSError, InputError
from ...core.inputs import require_file
from ...core.plain_paths import plain_path
from .crs import file_crs
from .raster import Elevation, Grid, Image

__all__ = [
    "BANDS",
    "RasterHeader",
    "alpha_of",
    "assumed_bands",
    "band_names",
    "data_mask",
    "looks_like_values",
    "opened",
    "read_elevation",
    "read_image",
    "read_raster_header",
    "require_image_type",
    "source_crs",
    "write_elevation",
    "write_image",
]

#: Names that a band can have; any other in ``bands=`` is refused, ``-`` skips one.
BANDS = ("red", "green", "blue", "nir", "grey")
_DEFAULT_BANDS = {1: ("grey",), 3: ("red", "green", "blue"), 4: ("red", "green", "blue", "nir")}


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
        Whether a further, last band without a name holds a mask: one value beside 0, the highest or 1.
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
        )


def read_image(
    path: str | os.PathLike[str], *, bands: Sequence[str] | None = None, window: Sequence[float] | None = None
) -> Image:
    """Read an orthoimage on its own grid, whole or the cells that a window meets.

    Parameters
    ----------
    path : path
    bands : sequence of str, optional
        Names in the order of the file; ``"-"`` skips one. Without it the descriptions in the file, else by number:
        1 grey, 3 red, green, blue, 4 red, green, blue, nir.
    window : sequence of float, optional
        ``(xmin, ymin, xmax, ymax)``, metres; `InputError` where the image does not meet it.
    """
    header = _square(read_raster_header(path))
    names = band_names(header, bands)
    require_image_type(header)
    part = _part(header, window)
    with opened(header.path, alpha=alpha_of(header, names)) as source:
        indexes, kept = _band_indexes(names)
        values = source.read(indexes, window=part)
        valid = data_mask(source, part)
    return Image(values, kept, header.grid.cut(*part), None if valid.all() else valid)


def read_elevation(path: str | os.PathLike[str], *, window: Sequence[float] | None = None) -> Elevation:
    """Read an elevation model on its own grid, whole or as in `read_image`; cells without data are NaN."""
    header = _square(read_raster_header(path))
    part = _part(header, window)
    with opened(header.path) as source:
        values = source.read(1, masked=True, window=part).astype(np.float32).filled(np.nan)
        values = values * np.float32(header.scale) + np.float32(header.offset)
    return Elevation(values, header.grid.cut(*part))


def _part(header: RasterHeader, window: Sequence[float] | None) -> tuple[slice, slice]:
    """Return rows and columns of a window."""
    grid = header.grid
    if window is None:
        return slice(0, grid.rows), slice(0, grid.columns)
    part = grid.part(window)
    if part is None:
        raise InputError(f"{header.path} does not reach into the window {tuple(window)}: choose another one")
    return part


def band_names(header: RasterHeader, bands: Sequence[str] | None) -> tuple[str, ...]:
    """Return one name per band of a file, ``"-"`` for those to skip."""
    if bands is not None:
        unknown = [name for name in bands if name not in (*BANDS, "-")]
        if unknown:
            raise InputError(
                f"bands= has {unknown[0]!r}, which is no band name; use {', '.join(BANDS)}, and - to skip one"
            )
        further = header.alpha or header.mask_band
        if len(bands) != header.band_count and not (further and len(bands) == header.band_count + 1):
            raise InputError(
                f"{header.path} has {header.band_count} bands, but bands= names {len(bands)} "
                f"({','.join(bands)}): name one for each, - to skip one"
            )
        named = [name for name in bands if name != "-"]
        if len(set(named)) != len(named) or not named:
            raise InputError(f"bands={','.join(bands)} must name at least one band and none twice")
        return tuple(bands)
    if all(name in BANDS for name in header.band_names) and len(set(header.band_names)) == header.band_count:
        return header.band_names
    by_colour = _names_by_colour(header.colours)
    if by_colour is not None:
        return by_colour
    if header.band_count not in _DEFAULT_BANDS:
        raise InputError(
            f"{header.path} has {header.band_count} bands, expected 1 (grey), 3 (red, green, blue) or 4 (and nir): "
            "name them by bands=, - to skip one"
        )
    return _DEFAULT_BANDS[header.band_count]


def _names_by_colour(colours: Sequence[str]) -> tuple[str, ...] | None:
    """Return names by colour interpretation, a fourth band of no colour as near infrared; None when they do not do."""
    names = tuple({"gray": "grey", "undefined": "nir"}.get(colour, colour) for colour in colours)
    return names if sorted(names) in (["blue", "green", "red"], ["blue", "green", "nir", "red"]) else None


def assumed_bands(header: RasterHeader, bands: Sequence[str] | None) -> str | None:
    """Return a note on names of bands that the file does not give; None when it gives all of them."""
    names = band_names(header, bands)
    if bands is not None or names == header.band_names or len(names) == 1:
        return None
    if _names_by_colour(header.colours) is None:
        return f"{header.path.name} does not name its bands: they were taken for {', '.join(names)}"
    unnamed = [name for name, colour in zip(names, header.colours, strict=True) if name != colour]
    if unnamed:
        return f"{header.path.name} does not name band {names.index('nir') + 1}: it was taken for near infrared"
    return None


def alpha_of(header: RasterHeader, names: Sequence[str]) -> bool | None:
    """Return whether the last band is read as a mask (True), as values (False), or as the file marks it (None)."""
    if len(names) > header.band_count and names[-1] != "-":
        return False
    return True if header.mask_band else None


def looks_like_values(header: RasterHeader) -> bool:
    """Return whether the band that is marked as alpha holds more than opaque and transparent."""
    if not header.alpha:
        return False
    with opened(header.path) as source:
        rows, columns = (min(side, 512) for side in source.shape)
        values = np.unique(source.read(source.count, out_shape=(rows, columns)))
    return len(values) > 8  # soft edges of a mosaic have some


def _holds_mask(source: Any) -> bool:
    """Return whether the fourth band, unnamed and of no colour, holds 0 and one more value: no infrared does."""
    from rasterio.windows import Window

    if source.count != 4 or source.colorinterp[3].name != "undefined" or source.descriptions[3]:
        return False
    if source.dtypes[3] not in ("uint8", "uint16"):
        return False
    seen: set[int] = set()
    for row in range(0, source.height, max(64, source.height // 8)):
        for column in range(0, source.width, max(64, source.width // 8)):
            seen.update(np.unique(source.read(4, window=Window(column, row, 64, 64))).tolist())
    return (seen - {0}) in ({1}, {255}, {65535})


def write_image(image: Image, path: str | os.PathLike[str], *, crs: str | None = None) -> None:
    """Write an orthoimage as a tiled, compressed GeoTIFF with named bands and, where there is one, a mask."""
    import rasterio

    profile = _profile(image.grid, crs, len(image.bands), image.values.dtype.name)
    photometric = {"photometric": "RGB"} if image.bands[:3] == ("red", "green", "blue") else {}
    with (
        rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True),
        rasterio.open(path, "w", predictor=2, **profile, **photometric) as target,
    ):
        target.write(image.values)
        for index, name in enumerate(image.bands, start=1):
            target.set_band_description(index, name)
        if len(image.bands) == 4 and photometric:
            target.colorinterp = [*target.colorinterp[:3], rasterio.enums.ColorInterp.undefined]
        if image.valid is not None:
            target.write_mask(image.valid)


def write_elevation(elevation: Elevation, path: str | os.PathLike[str], *, crs: str | None = None) -> None:
    """Write an elevation model as a tiled, compressed float32 GeoTIFF; no data is NaN."""
    import rasterio

    profile = _profile(elevation.grid, crs, 1, "float32")
    with rasterio.open(path, "w", predictor=3, nodata=float("nan"), **profile) as target:
        target.write(elevation.values.astype(np.float32), 1)


def _profile(grid: Grid, crs: str | None, count: int, dtype: str) -> dict[str, Any]:
    from rasterio import Affine

    return {
        "driver": "GTiff",
        "width": grid.columns,
        "height": grid.rows,
        "count": count,
        "dtype": dtype,
        "crs": crs,
        "transform": Affine(*grid.transform),
        "tiled": True,
        "blockxsize": 256,
        "blockysize": 256,
        "compress": "deflate",
        "bigtiff": "if_safer",
    }


@contextmanager
def opened(file: Path, *, alpha: bool | None = None) -> Iterator[Any]:
    """Open a raster; what rasterio raises inside the block becomes one sentence.

    With `alpha` False no band masks, with True the last one does, whatever the file says.
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
            with source:
                if alpha is None:
                    yield source
                    return
                with _with_last_band(source, "alpha" if alpha else "undefined") as view:
                    yield view
    except (RasterioError, RasterioIOError) as error:  # two kinds before rasterio 1.4
        cause = error.__cause__ or error
        reason = " ".join(str(cause).split())
        raise InputError(f"{file} cannot be read as an image ({reason}): give a GeoTIFF") from error


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


def source_crs(file: Path, source: Any) -> str | None:
    """Return the horizontal CRS of an open raster that has one; None where it is a local system."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError as ProjError

    try:
        crs = CRS.from_wkt(source.crs.to_wkt())
    except ProjError as error:
        raise CRSError(f"{file}: its CRS cannot be read ({error}): set it with gdal_edit.py -a_srs") from error
    return file_crs(crs)


def _square(header: RasterHeader) -> RasterHeader:
    if not header.square:
        raise InputError(f"{header.path}: its cells are not square: warp it, for instance with gdalwarp -tr")
    return header


def _height_unit(source: Any) -> str | None:
    """Return the unit of the values when band or vertical CRS name one that is not metres."""
    from pyproj import CRS
    from pyproj.exceptions import CRSError as ProjError

    unit = str(source.units[0] or "")
    if unit.lower() not in ("", "m", "metre", "metres", "meter", "meters"):
        return unit
    try:
        crs = CRS.from_wkt(source.crs.to_wkt()) if source.crs else None
    except ProjError:
        return None
    for part in crs.sub_crs_list if crs is not None else ():
        for axis in part.axis_info:
            if axis.direction == "up" and abs(axis.unit_conversion_factor - 1.0) > 1e-9:
                return str(axis.unit_name)
    return None


def _band_indexes(names: Sequence[str]) -> tuple[list[int], tuple[str, ...]]:
    indexes = [index for index, name in enumerate(names, start=1) if name != "-"]
    return indexes, tuple(name for name in names if name != "-")


def require_image_type(header: RasterHeader) -> None:
    """Raise `InputError` unless the values can be those of an orthoimage."""
    if header.dtype not in ("uint8", "uint16"):
        raise InputError(
            f"{header.path} has {header.dtype} values, an orthoimage needs uint8 or uint16: convert it, for instance "
            "with gdal_translate -ot Byte -scale"
        )


def data_mask(source: Any, part: tuple[slice, slice] | None = None) -> NDArray[np.bool_]:
    """Return where a raster has data, shape (rows, columns): by its alpha band, else by its mask or no-data values.

    GDAL itself regards an alpha band only beside one or three bands of whole numbers.
    """
    alpha = [index for index, colour in enumerate(source.colorinterp, start=1) if colour.name == "alpha"]
    if alpha:
        return np.asarray(source.read(alpha[-1], window=part) > 0)
    return np.asarray(source.dataset_mask(window=part) > 0)
