"""GeoTIFF files: orthoimages and elevation models read, whole or by window, and written."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from .image_bands import alpha_of, band_names, require_image_type
from .opened_rasters import opened
from .raster import Elevation, Grid, Image
from .raster_headers import RasterHeader, read_raster_header

__all__ = ["data_mask", "read_elevation", "read_image", "write_elevation", "write_image"]


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


def _square(header: RasterHeader) -> RasterHeader:
    if not header.square:
        raise InputError(f"{header.path}: its cells are not square: warp it, for instance with gdalwarp -tr")
    return header


def _band_indexes(names: Sequence[str]) -> tuple[list[int], tuple[str, ...]]:
    indexes = [index for index, name in enumerate(names, start=1) if name != "-"]
    return indexes, tuple(name for name in names if name != "-")


def data_mask(source: Any, part: tuple[slice, slice] | None = None) -> NDArray[np.bool_]:
    """Return where a raster has data, shape (rows, columns): by its alpha band, else by its mask or no-data values.

    GDAL itself regards an alpha band only beside one or three bands of whole numbers.
    """
    alpha = [index for index, colour in enumerate(source.colorinterp, start=1) if colour.name == "alpha"]
    if alpha:
        return np.asarray(source.read(alpha[-1], window=part) > 0)
    return np.asarray(source.dataset_mask(window=part) > 0)
